"""The energy up to which noise explains what a set of contacts leaves of a measurement."""

import math

from contactsense.detection.false_alarm_rate import sample_threshold
from contactsense.detection.thresholds import degrees_of_freedom_of
from contactsense.scene import Scene
from contactsense.sensors.usable_sensors import Usable


def energy_limit(scene: Scene, present: Usable, known_count: int, drift: float) -> float:
    """Energy of known contacts that noise alone exceeds at the false-alarm rate of the scene.

    Each contact has as many unknowns as priors, plus three priors if its force is known.

    Args:
        scene: The scene.
        present: Which sensors have measured.
        known_count: Number of known contacts.
        drift: Standard deviation of the change of each component of their forces [N]; infinity: their forces
            are not known.
    """
    degrees_of_freedom = degrees_of_freedom_of(len(scene.robot.joints), present)
    if drift < math.inf:
        degrees_of_freedom += 3 * known_count
    return sample_threshold(scene.false_alarms_per_hour, degrees_of_freedom, scene.bandwidth)
