"""Onset and release thresholds of one scene, for the energy of the no-contact hypothesis.

In a scene without a base sensor two tests look for a contact, one of each sample and one of the residuals'
EWMA (`contactsense.residuals.residual_ewma`): each may give half of the permitted false alarms.
"""

import math

import numpy as np

from contactsense.detection.false_alarm_rate import onset_threshold, release_threshold, sample_threshold
from contactsense.residuals.residual_ewma import RELATIVE_BANDWIDTH
from contactsense.robots.jit.kernel import kernel
from contactsense.scene import Scene
from contactsense.sensors.usable_sensors import Usable

LONGEST_STEP_MS = 20
"""For longer sample times the thresholds are those of this one [ms]: there are fewer false alarms."""
HALVINGS = 4
"""Sample times below 1 ms are 1/2, 1/4, ... ms, as many as this."""
STEPS = HALVINGS + LONGEST_STEP_MS
"""Number of sample times that have thresholds of their own."""


def degrees_of_freedom_of(joints: int, usable: Usable) -> int:
    """Number of residuals of the sensors that are used, at least one; `joints`: of the arm."""
    base, torque, link_sensors = usable
    return max(6 * base + joints * torque + 6 * link_sensors.bit_count(), 1)


def stream_thresholds(scene: Scene) -> np.ndarray:
    """Onset and release thresholds for a stream of `scene`.

    Returns:
        Onset and release threshold, and onset threshold of the EWMA (infinite where it is not tested), for
        each set of sensors, see `sensor_set`, and each usual sample time, see `threshold_index`; shape
        (4 (S + 1), STEPS, 3).
    """
    joints = len(scene.robot.joints)
    thresholds = np.zeros((4 * (len(scene.link_sensors) + 1), STEPS, 3))
    cached: dict[int, np.ndarray] = {}
    for i in range(len(thresholds)):
        # Link sensors are alike: only their number counts.
        used = (i & 1 != 0, i & 2 != 0, (1 << i // 4) - 1)
        degrees_of_freedom = degrees_of_freedom_of(joints, used)
        if degrees_of_freedom not in cached:
            cached[degrees_of_freedom] = np.array(
                [_thresholds(scene, degrees_of_freedom, index) for index in range(STEPS)]
            )
        thresholds[i] = cached[degrees_of_freedom]
    return thresholds


def _thresholds(scene: Scene, degrees_of_freedom: int, index: int) -> tuple[float, float, float]:
    """One entry of `stream_thresholds`, for the sample times of that `threshold_index`."""
    release = release_threshold(degrees_of_freedom)
    dt = 1e-3 * (index + 1 - HALVINGS if index >= HALVINGS else 0.5 ** (HALVINGS - index))
    if scene.base_wrench is not None:
        onset = onset_threshold(scene.false_alarms_per_hour, degrees_of_freedom, scene.bandwidth, dt)
        return onset, release, math.inf
    onset, average = (
        onset_threshold(0.5 * scene.false_alarms_per_hour, degrees_of_freedom, bandwidth, dt)
        for bandwidth in (scene.bandwidth, RELATIVE_BANDWIDTH * scene.bandwidth)
    )
    return onset, release, average


class SampleThresholds:
    """Thresholds of single measurements, computed once for each set of sensors."""

    def __init__(self, scene: Scene) -> None:
        """Take the false alarms per hour from `scene`."""
        self._per_hour, self._bandwidth = scene.false_alarms_per_hour, scene.bandwidth
        self._joints = len(scene.robot.joints)
        self._cached: dict[Usable, float] = {}

    def threshold(self, usable: Usable) -> float:
        """Energy that noise exceeds at the scene's false-alarm rate; `usable`: which sensors are used."""
        if usable not in self._cached:
            degrees_of_freedom = degrees_of_freedom_of(self._joints, usable)
            self._cached[usable] = sample_threshold(self._per_hour, degrees_of_freedom, self._bandwidth)
        return self._cached[usable]


@kernel
def sensor_set(has_base: bool, has_torque: bool, link_sensors: int) -> int:
    """Index of a set of sensors in the table of `stream_thresholds`; arguments as in `Usable`."""
    count = 0
    while link_sensors > 0:
        count += link_sensors & 1
        link_sensors >>= 1
    return 1 * has_base + 2 * has_torque + 4 * count


@kernel
def threshold_index(usual_step: float) -> int:
    """Index of a stream's usual sample time [s] in the table of `stream_thresholds`: ..., 1/4, 1/2, 1, 2, 3,
    ... ms. That of 1 ms if the sample time is not known yet, so zero."""
    if 0.0 < usual_step < 1e-3:
        return HALVINGS - int(min(round(-math.log2(1e3 * usual_step)), HALVINGS))
    return HALVINGS + int(min(max(round(1e3 * usual_step), 1), LONGEST_STEP_MS)) - 1
