"""Timing of the sensors in a live stream: time of the start, of the last value, and the usual step.

The timing of a sensor is a row of numbers: time of its start, of its last value, and its usual step, all [s].
"""

import math

import numpy as np

from contactsense.robots.jit.kernel import kernel

LONGEST_GAP = 0.05
"""A sensor without a value for longer is missing, and its observer restarts [s]."""
LONGEST_GAP_STEPS = 6.0
"""The same in steps of the sensor, for sensors with long steps."""
STARTED, LAST, USUAL = 0, 1, 2
"""Indices of a sensor's timing."""
_OVERDUE = 1.5
"""A value is overdue after that many usual steps."""
_STEP_SMOOTHING = 0.1
"""Weight of the newest step in the usual one."""


@kernel
def reset_timing(timing: np.ndarray) -> None:
    """Timing before the first value of each sensor, shape (N, 3)."""
    timing[:] = 0.0
    timing[:, LAST] = -math.inf


@kernel
def _longest_gap(timing: np.ndarray) -> float:
    """Time without a value after which the sensor is missing [s]."""
    return float(max(LONGEST_GAP, LONGEST_GAP_STEPS * timing[USUAL]))


@kernel
def time_since_last(timing: np.ndarray, t: float, has_value: bool) -> float:
    """Time since the sensor's last value [s]; 0: restart; negative: no value in the sample at time t."""
    if not has_value:
        return -1.0
    step = t - timing[LAST]
    timing[LAST] = t
    if not 0.0 < step <= _longest_gap(timing):
        timing[STARTED] = t
        return 0.0
    timing[USUAL] += (_STEP_SMOOTHING if timing[USUAL] > 0.0 else 1.0) * (step - timing[USUAL])
    return float(step)


@kernel
def is_silent(timing: np.ndarray, t: float) -> bool:
    """Whether the sensor is missing at time t: no valid value for longer than its longest gap."""
    return bool(t - timing[LAST] > _longest_gap(timing))


@kernel
def is_overdue(timing: np.ndarray, t: float, step: float) -> bool:
    """Whether a value was due by the sample at time t, which has none: at once for a sensor that usually has
    one in each sample, half a usual step later for a slower one.

    Args:
        timing: Of the sensor, with its value in this sample.
        t: Time of the sample [s].
        step: Time since the previous sample [s].
    """
    since = t - timing[LAST]
    return bool(since > 0.0 and since > _OVERDUE * timing[USUAL] - step)


@kernel
def has_settled(timing: np.ndarray, t: float, settling_time: float) -> bool:
    """Whether the residual at time t can be used: the sensor is not missing and has had values for
    `settling_time` [s]. The time of the last value counts, not t: after a single value the residual is zero,
    however long ago that was."""
    return not is_silent(timing, t) and timing[LAST] - timing[STARTED] >= settling_time
