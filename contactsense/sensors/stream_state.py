"""State of one live stream in the kernels: its newest sample, and which sensors can be used in it."""

import math
from typing import Annotated, NamedTuple, TypeAlias

import numpy as np

from contactsense.robots.jit.declaration import Floats, Integers, Records, record
from contactsense.robots.jit.kernel import kernel
from contactsense.sensors.timing import (
    LONGEST_FIRST_STEP,
    SensorTiming,
    has_settled,
    is_overdue,
    is_silent,
    reset_timing,
    time_since_last,
)

SETTLING_PERIODS = 5.0 / (2.0 * math.pi)
"""Time from a start of the observers until their residuals are used, in periods of their cut-off frequency:
five time constants, after which a residual is within 1 % of its value."""
BASE, TORQUE, TORQUE_DIFFERENCE, LINK = 0, 1, 2, 3
"""Indices of `StreamState.timing`, `steps` and `usable`: base sensor, joint torques, difference of torques to
the base wrench; from `LINK` on the S link sensors, then their S differences to the base wrench."""
_STEP_SMOOTHING = 0.05
"""Weight of the newest step in the stream's usual one."""
_LARGEST_VALUE = 1e6
"""Larger positions, velocities, forces and torques are implausible; their squares could overflow [rad, rad/s,
N, Nm]."""
SHORTEST_STEP = 1e-9
"""Two samples nearer in time have the same time: squares of rates over shorter steps could overflow [s]."""
LONGEST_STEP = 86400.0
"""Longest step that enters the random walk of the biases; a longer one counts as this [s]."""

MAX_SENSORS = 11
"""Base sensor, joint torques, and at most nine link sensors: a sensor's flags have a bit for each."""
MISSING, INVALID, UNSETTLED = 1, 1 << MAX_SENSORS, 1 << 2 * MAX_SENSORS
"""Flags of a sample, bits of one number; 0: sensors in order and no contact. These, shifted by the number of
a sensor, are of that sensor: it has no value, or one that is not finite or implausible, or its residual has
not settled after its start or its return."""
INCONSISTENT, SETTLING, TOUCHED, RESTARTED, REPEATED, UNUSABLE, WRONG_SIZE, BLIND, SUSPECT = (
    1 << 3 * MAX_SENSORS + i for i in range(9)
)
"""Flags of the whole sample. `INCONSISTENT`: see `contactsense.residuals.sensor_consistency`. `SETTLING`: no
sensor can be used yet. `TOUCHED`: a contact is detected. `RESTARTED`: time has jumped back, a new stream
begins. `REPEATED`, `UNUSABLE`, `WRONG_SIZE` (a field has the wrong size) and `SUSPECT` (a value may be
implausible): the sample was not used. `BLIND`: no sensor has a value, and at least one should have."""
ALL_MISSING = INVALID - MISSING
"""Every sensor is missing."""
DEGRADED = ALL_MISSING * (MISSING | INVALID | UNSETTLED) | INCONSISTENT | SETTLING | BLIND
"""Flags of used samples for which the estimate is `degraded`."""


Readings: TypeAlias = tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray, np.ndarray]
"""Positions and velocities, shape (n,), torques (n,), base wrench (6,), and wrenches on the link sensors (S,
6), as in `contactsense.types.Sample`. A plain tuple: Numba takes longer to recognize a named one."""


@record
class StreamClock:
    """Times of the samples."""

    t: float
    """Time of the newest sample [s]."""
    step: float
    """Step to it [s]."""
    usual_step: float
    """Usual step, in which a gap counts as the longest step between usable samples [s]."""
    variance_ratio: float
    """Variance of its residuals over that of one sample's noise."""


class StreamState(NamedTuple):
    """State of a stream apart from its residuals."""

    q: Annotated[Floats, "joints"]
    """Joint positions of the newest sample, see `contactsense.types.Sample` [rad]."""
    qd: Annotated[Floats, "joints"]
    """[rad/s]"""
    torque: Annotated[Floats, "joints"]
    """[Nm]"""
    base_wrench: Annotated[Floats, "6"]
    """[N, Nm]"""
    link_wrench: Annotated[Floats, "link_sensors, 6"]
    """Wrench on each of the S link sensors, base axes, base origin [N, Nm]."""
    timing: Annotated[Records[SensorTiming], f"{LINK} + 2 * link_sensors"]
    steps: Annotated[Floats, f"{LINK} + 2 * link_sensors"]
    """Step of each observer [s]: 0 restarts it, negative: no value."""
    usable: Annotated[Integers, f"{LINK} + 2 * link_sensors"]
    """1 where a residual can be used."""
    clock: Annotated[Records[StreamClock], "1"]


@kernel
def restart(stream: StreamState) -> None:
    """Reset to the state before the first sample."""
    reset_timing(stream.timing)
    clock = stream.clock[0]
    clock.t, clock.step, clock.usual_step, clock.variance_ratio = -math.inf, 0.0, 0.0, 0.0


@kernel
def store_sample(stream: StreamState, readings: Readings) -> bool:
    """Store a sample's values; returns False if one has the wrong size."""
    # One by one: an array of one joint is contiguous, and then not of the same type as one of six numbers.
    q, qd, torque, base_wrench, link_wrench = readings
    joints = len(stream.q)
    if len(q) != joints or len(qd) != joints or len(torque) != joints or len(base_wrench) != 6:
        return False
    for k in range(joints):
        stream.q[k], stream.qd[k], stream.torque[k] = q[k], qd[k], torque[k]
    for k in range(6):
        stream.base_wrench[k] = base_wrench[k]
    for s in range(stream.link_wrench.shape[0]):
        for k in range(6):
            stream.link_wrench[s, k] = link_wrench[s, k]
    return True


@kernel
def _is_plausible(vector: np.ndarray) -> bool:
    for value in vector:  # noqa: SIM110 (a generator cannot be compiled)
        if not abs(value) < _LARGEST_VALUE:
            return False
    return True


@kernel
def register_sample(stream: StreamState, t: float, sensor_bits: int, bandwidth: float) -> int:
    """Update the timing with a new sample: step of each observer, and which residuals can be used.

    Args:
        stream: With the sample's values; changed in place.
        t: Time of the sample [s].
        sensor_bits: Which sensors have a value in it: 1 base wrench, 2 torques, 4, 8, ... link sensors.
        bandwidth: Cut-off frequency of the observers [Hz].

    Returns:
        Flags of the sample.
    """
    clock, timing, steps, usable = stream.clock[0], stream.timing, stream.steps, stream.usable
    if not (math.isfinite(t) and _is_plausible(stream.q) and _is_plausible(stream.qd)):
        return UNUSABLE
    if 0.0 <= t - clock.t < SHORTEST_STEP:
        return REPEATED
    flags = 0
    if t < clock.t:
        restart(stream)
        flags = RESTARTED
    clock.step = min(t - clock.t, LONGEST_STEP) if clock.t > -math.inf else 0.0
    weight = _STEP_SMOOTHING if clock.usual_step > 0.0 else 1.0
    clock.usual_step += weight * (min(clock.step, LONGEST_FIRST_STEP) - clock.usual_step)
    clock.t = t
    blind = True
    link_sensors = stream.link_wrench.shape[0]
    for sensor in range(2 + link_sensors):
        i = _index(sensor)
        has_value = sensor_bits >> sensor & 1 == 1
        valid = has_value and _has_plausible_value(stream, sensor)
        steps[i] = time_since_last(timing[i], t, valid)
        if is_silent(timing[i], t):
            flags |= MISSING << sensor
        elif has_value and not valid:
            flags |= INVALID << sensor
        blind = blind and is_overdue(timing[i], t, clock.step)
    if blind:
        flags |= BLIND
    with_base = steps[BASE] >= 0.0
    steps[TORQUE_DIFFERENCE] = time_since_last(
        timing[TORQUE_DIFFERENCE], t, with_base and steps[TORQUE] >= 0.0
    )
    for i in range(LINK, LINK + link_sensors):
        difference = i + link_sensors
        steps[difference] = time_since_last(timing[difference], t, with_base and steps[i] >= 0.0)
    settling_time = SETTLING_PERIODS / bandwidth
    for i in range(usable.shape[0]):
        usable[i] = 1 if has_settled(timing[i], t, settling_time) else 0
    for sensor in range(2 + link_sensors):
        if usable[_index(sensor)] == 0 and flags & MISSING << sensor == 0:
            flags |= UNSETTLED << sensor
    return flags


@kernel
def _index(sensor: int) -> int:
    """Index of a sensor in `StreamState.timing`, `steps` and `usable`."""
    return sensor if sensor < 2 else LINK + sensor - 2


@kernel
def _has_plausible_value(stream: StreamState, sensor: int) -> bool:
    """Whether the newest value of a sensor is plausible; `sensor`: its bit in `sensor_bits`."""
    if sensor == 0:
        return bool(_is_plausible(stream.base_wrench))
    if sensor == 1:
        return bool(_is_plausible(stream.torque))
    return bool(_is_plausible(stream.link_wrench[sensor - 2]))
