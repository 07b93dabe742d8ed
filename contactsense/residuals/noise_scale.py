"""Noise of base sensor and joint torques in units of the stated one, followed in a stream.

The third difference of readings at a constant interval, x0 - 3 x1 + 3 x2 - x3, has 20 times the variance of
their white noise and next to nothing of weight, motion and contacts, which are smooth over four samples. So
it measures the noise in free motion and in contact alike, and no contact is taken for noise. A step or an
outlier is in four differences only, each of which counts at most `LARGEST_RATIO` times the present estimate.

The estimate is used where it is above 1 by more than `SIGNIFICANT` of its standard deviations. It never makes
a sensor less noisy than stated.
"""

import math
from typing import NamedTuple

import numpy as np

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
TAKEN, REGULAR_SAMPLES, LAST_STEP, LIMIT = 0, 1, 2, 3
"""Columns of `NoiseScale.counts`."""
SENSORS = 2


class NoiseScale(NamedTuple):
    """State of one stream, for base sensor and joint torques (indices of `StreamState.steps`)."""

    base_readings: np.ndarray
    """Last three readings of the base sensor, the newest first, shape (3, 6) [N, Nm]."""
    torque_readings: np.ndarray
    """The same of the joint torques, shape (3, n) [Nm]."""
    mean_square: np.ndarray
    """Mean squared third difference of each sensor in units of the stated noise's, shape (2,)."""
    counts: np.ndarray
    """Of each sensor: third differences taken; readings at a constant interval; last step [s]; `mean_square`
    above which noise is larger than stated; shape (2, 4)."""
    scale: np.ndarray
    """Variance of each sensor's noise over the stated one, at least 1, shape (2,)."""
    base_variance: np.ndarray
    """Stated variance of each component of the base sensor's readings, shape (6,) [N^2, Nm^2]."""


def empty_noise_scale(joints: int) -> NoiseScale:
    """State before the first sample, for that many joints."""
    return NoiseScale(
        np.zeros((_ORDER, 6)), np.zeros((_ORDER, joints)), np.ones(SENSORS), np.zeros((SENSORS, 4)),
        np.ones(SENSORS), np.ones(6),
    )  # fmt: skip


def restart(state: NoiseScale, base_covariance: np.ndarray) -> None:
    """Forget everything: noise as stated.

    Args:
        state: Changed in place.
        base_covariance: Stated covariance of the base sensor's noise, shape (6, 6).
    """
    for array in state:
        array[:] = 0.0
    state.mean_square[:], state.scale[:] = 1.0, 1.0
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
    counts = state.counts[sensor]
    if dt < 0.0:
        return
    if dt == 0.0:
        counts[REGULAR_SAMPLES] = 0.0
    if counts[REGULAR_SAMPLES] > 1.0 and abs(dt - counts[LAST_STEP]) > REGULAR * counts[LAST_STEP]:
        counts[REGULAR_SAMPLES] = 0.0
    size = reading.shape[0]
    if counts[REGULAR_SAMPLES] >= _ORDER:
        total = 0.0
        for i in range(size):
            difference = reading[i] - 3.0 * last[0, i] + 3.0 * last[1, i] - last[2, i]
            total += difference * difference / (_GAIN * variance[i])
        ratio = min(total / size, LARGEST_RATIO * state.mean_square[sensor])
        counts[TAKEN] += 1.0
        weight = max(min(dt / AVERAGING_TIME, 1.0), 1.0 / counts[TAKEN])
        state.mean_square[sensor] += weight * (ratio - state.mean_square[sensor])
        # A running mean with that weight has the variance of 2 / weight - 1 equal weights.
        independent = size * min(counts[TAKEN], 2.0 / weight - 1.0) / _CORRELATION
        counts[LIMIT] = 1.0 + SIGNIFICANT * math.sqrt(2.0 / independent)
    mean_square = state.mean_square[sensor]
    state.scale[sensor] = mean_square if mean_square > counts[LIMIT] else 1.0
    for i in range(size):
        last[2, i], last[1, i], last[0, i] = last[1, i], last[0, i], reading[i]
    counts[REGULAR_SAMPLES] += 1.0
    counts[LAST_STEP] = dt
