"""Noise of base sensor and joint torques in units of the stated one, followed in a stream.

The third difference of readings at a constant interval, x0 - 3 x1 + 3 x2 - x3, has 20 times the variance of
their white noise and next to nothing of weight, motion and contacts, which are smooth over four samples. So
it measures the noise in free motion and in contact alike, and no contact is taken for noise. A step or an
outlier is in four differences only, each of which counts at most `LARGEST_RATIO` times the present estimate.

The estimate is used where it is above 1 by more than `SIGNIFICANT` of its standard deviations. It never makes
a sensor less noisy than stated.
"""

import math
from typing import Annotated, NamedTuple

import numpy as np

from contactsense.robots.jit.declaration import Floats, Records, record
from contactsense.robots.jit.kernel import kernel

AVERAGING_TIME = 0.5
"""Averaging time of the estimate [s]: a change of the noise is followed by 98 % after 2 s."""
LARGEST_RATIO = 4.0
"""Largest value of one sample, in units of the present estimate."""
SIGNIFICANT = 4.0
"""Standard deviations by which an estimate must exceed 1 to be used."""
REGULAR = 0.5
"""Steps that differ by more than this fraction are no constant interval."""
_GAIN = 20.0
"""Variance of a third difference over that of the noise: 1 + 9 + 9 + 1."""
_CORRELATION = 2.31
"""Number of squared third differences over the number of independent ones that would average as well: 1 + 2
times the sum of their squared autocorrelations -15/20, 6/20, -1/20."""
_ORDER = 3


@record
class SensorNoise:
    """Noise of one sensor."""

    scale: float
    """Its variance over the stated one, at least 1."""
    mean_square: float
    """Mean squared third difference in units of the stated noise's."""
    limit: float
    """`mean_square` above which noise is larger than stated."""
    differences: int
    """Number of third differences taken."""
    regular_samples: int
    """Number of readings at a constant interval."""
    last_step: float
    """[s]"""


class NoiseScale(NamedTuple):
    """State of one stream, for base sensor and joint torques (indices of `StreamState.steps`)."""

    base_readings: Annotated[Floats, "3, 6"]
    """Last three readings of the base sensor, the newest first [N, Nm]."""
    torque_readings: Annotated[Floats, "3, joints"]
    """The same of the joint torques [Nm]."""
    noise: Annotated[Records[SensorNoise], "2"]
    base_variance: Annotated[Floats, "6"]
    """Stated variance of each component of the base sensor's readings [N^2, Nm^2]."""


def restart(state: NoiseScale, base_covariance: np.ndarray) -> None:
    """Forget everything: noise as stated.

    Args:
        state: Changed in place.
        base_covariance: Stated covariance of the base sensor's noise, shape (6, 6).
    """
    for array in state:
        np.asarray(array).fill(0)
    for noise in state.noise:
        noise.scale, noise.mean_square = 1.0, 1.0
    state.base_variance[:] = np.diag(base_covariance)


@kernel
def follow_noise(
    state: NoiseScale, sensor: int, last: np.ndarray, reading: np.ndarray, variance: np.ndarray, dt: float
) -> None:
    """Process one reading of one sensor.

    Args:
        state: Changed in place.
        sensor: Index of the sensor, 0: base, 1: joint torques.
        last: Its field of `state`.
        reading: The reading, shape (k,) [N, Nm].
        variance: Stated variance of the noise of each component, shape (k,).
        dt: Time since its last reading [s]; 0 after a gap, negative: none in this sample.
    """
    noise = state.noise[sensor]
    if dt >= 0.0:
        _follow_reading(noise, last, reading, variance, dt)
    # Without a reading, too: a single measurement in between has its own noise, as stated.
    noise.scale = noise.mean_square if noise.mean_square > noise.limit else 1.0


@kernel
def _follow_reading(
    noise: SensorNoise, last: np.ndarray, reading: np.ndarray, variance: np.ndarray, dt: float
) -> None:
    """Update the mean square by one reading; arguments as for `follow_noise`."""
    if dt == 0.0:
        noise.regular_samples = 0
    if noise.regular_samples > 1 and abs(dt - noise.last_step) > REGULAR * noise.last_step:
        noise.regular_samples = 0
    size = reading.shape[0]
    if noise.regular_samples >= _ORDER:
        total = 0.0
        for i in range(size):
            difference = reading[i] - 3.0 * last[0, i] + 3.0 * last[1, i] - last[2, i]
            total += difference * difference / (_GAIN * variance[i])
        ratio = min(total / size, LARGEST_RATIO * noise.mean_square)
        noise.differences += 1
        weight = max(min(dt / AVERAGING_TIME, 1.0), 1.0 / noise.differences)
        noise.mean_square += weight * (ratio - noise.mean_square)
        # A running mean with that weight has the variance of 2 / weight - 1 equal weights.
        independent = size * min(noise.differences, 2.0 / weight - 1.0) / _CORRELATION
        noise.limit = 1.0 + SIGNIFICANT * math.sqrt(2.0 / independent)
    for i in range(size):
        last[2, i], last[1, i], last[0, i] = last[1, i], last[0, i], reading[i]
    noise.regular_samples += 1
    noise.last_step = dt
