"""What averaging over a contact could give at best: the contact located once, from one posture, with as
little noise as if every sample since its onset had been averaged without loss."""

from typing import NamedTuple

import numpy as np

from contactsense import Localizer, Scene
from contactsense.benchmarks.motion.at_rest import locate_at_rest, with_noise_scaled
from contactsense.benchmarks.motion.streams import Stream
from contactsense.benchmarks.static_truth.cases import Noise


class AveragingLimit(NamedTuple):
    """Shares of the contacts."""

    link_right: float
    """Located on the correct link, and detected with the scene's rate of false alarms."""
    felt: float
    """Detected."""


def averaging_limit(
    scene: Scene,
    rows: list[tuple[Stream, int]],
    noise: Noise,
    age: float,
    sensors: tuple[bool, bool] = (True, True),
) -> AveragingLimit:
    """The limit for contacts of one age.

    An estimator that knows neither how force and place changed meanwhile nor the biases exactly stays below
    it. One that makes use of several postures of a moving arm may exceed it.

    Args:
        scene: With the sensors.
        rows: The newest sample of each contact, as (stream, number).
        noise: Of one sample.
        age: Time since the onset [s].
        sensors: Whether there are base sensor and joint torques.
    """
    samples = max(age / float(np.median(np.diff(rows[0][0].t))), 1.0)
    averaged = Noise(*(level / np.sqrt(samples) for level in noise))
    localizer = Localizer(with_noise_scaled(scene, 1.0 / np.sqrt(samples)))
    batch = locate_at_rest(localizer, rows, averaged, sensors)
    right = batch.link == np.array([stream.link[i] for stream, i in rows])
    return AveragingLimit(float(np.mean(right & batch.detected)), float(np.mean(batch.detected)))
