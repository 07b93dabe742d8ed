"""Timing of the sensors in a live stream: time of the start, of the last value, and the usual step."""

import math

from contactsense.robots.jit.declaration import Records, record
from contactsense.robots.jit.kernel import kernel

LONGEST_GAP = 0.05
"""A sensor without a value for longer is missing, and its observer restarts [s]."""
LONGEST_FIRST_STEP = 0.15
"""The same at the start, where the usual step is not known: sensors of 10 Hz are used, times in milliseconds
are not [s]."""
LONGEST_GAP_STEPS = 6.0
"""The same in steps of the sensor, for sensors with long steps."""
_OVERDUE = 1.5
"""A value is overdue after that many usual steps."""
_STEP_SMOOTHING = 0.1
"""Weight of the newest step in the usual one."""


@record
class SensorTiming:
    """Timing of one sensor."""

    started: float
    """Time of its start [s]."""
    last: float
    """Time of its last value [s]."""
    usual_step: float
    """[s]"""


@kernel
def reset_timing(sensors: Records[SensorTiming]) -> None:
    """Timing before the first value of each sensor."""
    for i in range(len(sensors)):
        timing = sensors[i]
        timing.started, timing.last, timing.usual_step = 0.0, -math.inf, 0.0


@kernel
def _longest_gap(timing: SensorTiming) -> float:
    """Time without a value after which the sensor is missing [s]."""
    shortest = LONGEST_GAP if timing.usual_step > 0.0 else LONGEST_FIRST_STEP
    return float(max(shortest, LONGEST_GAP_STEPS * timing.usual_step))


@kernel
def time_since_last(timing: SensorTiming, t: float, has_value: bool) -> float:
    """Time since the sensor's last value [s]; 0: restart; negative: no value in the sample at time t."""
    if not has_value:
        return -1.0
    step = t - timing.last
    timing.last = t
    if not 0.0 < step <= _longest_gap(timing):
        timing.started = t
        return 0.0
    timing.usual_step += (_STEP_SMOOTHING if timing.usual_step > 0.0 else 1.0) * (step - timing.usual_step)
    return float(step)


@kernel
def is_silent(timing: SensorTiming, t: float) -> bool:
    """Whether the sensor is missing at time t: no valid value for longer than its longest gap."""
    return bool(t - timing.last > _longest_gap(timing))


@kernel
def is_overdue(timing: SensorTiming, t: float, step: float) -> bool:
    """Whether a value was due by the sample at time t, which has none: at once for a sensor that usually has
    one in each sample, half a usual step later for a slower one.

    Args:
        timing: Of the sensor, with its value in this sample.
        t: Time of the sample [s].
        step: Time since the previous sample [s].
    """
    since = t - timing.last
    return bool(since > 0.0 and since > _OVERDUE * timing.usual_step - step)


@kernel
def has_settled(timing: SensorTiming, t: float, settling_time: float) -> bool:
    """Whether the residual at time t can be used: the sensor is not missing and has had values for
    `settling_time` [s]. The time of the last value counts, not t: after a single value the residual is zero,
    however long ago that was."""
    return not is_silent(timing, t) and timing.last - timing.started >= settling_time
