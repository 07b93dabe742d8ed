"""One live stream as the kernels see it: its newest sample, and what can be made of each sensor in it."""

import math
from typing import NamedTuple

import numpy as np

from contactsense.feed import proceed, settled, silence, silent
from contactsense.levels import SLOWEST
from robots.compiled import kernel

SETTLE = 5.0
"""Time constants of the observer after a start until its residual is used: it is within 1 % of its value by
then."""
BASE, TORQUE, WRIST, MATCH, WRIST_MATCH = 0, 1, 2, 3, 4
"""Places in `Stream.feeds`, `steps` and `usable`: the three sensors, and torques and wrist wrench as held
against the base wrench."""
T, STEP, USUAL_STEP, SCALE = 0, 1, 2, 3
"""Places in `Stream.clock`."""
_LATELY = 0.05
"""Share of the newest step in the stream's usual one."""
_ABSURD = 1e6
"""No joint, force or torque is as large; squares of what is nonsense need not be finite [rad, rad/s, N,
Nm]."""
_LONGEST = 86400.0
"""No step counts for more: what has drifted over a day can be anywhere [s]."""

MISSING, SPOILT, DOUBT, SETTLES, TOUCHED, RESTARTED = 1, 8, 64, 128, 256, 512
REPEATED, UNUSABLE, MISFIT = 1024, 2048, 4096
"""What is to be said of a sample, bits of one number; 0: all is well and nothing touches. `MISSING` and
`SPOILT` (a value is not finite or absurd) have three each, the sensors' in their order. `DOUBT`: see
`contactsense.health`. `SETTLES`: no sensor can be used yet. `TOUCHED`: something acts on the arm.
`RESTARTED`: time has jumped back, a new stream begins. `REPEATED`, `UNUSABLE` and `MISFIT` (a field
has the wrong size): the sample was not used."""
TROUBLES = 7 * MISSING | 7 * SPOILT | DOUBT | SETTLES
"""All of these for which an estimate is `degraded`, of samples that were used."""


class Stream(NamedTuple):
    """What is known of a stream beside its residuals."""

    q: np.ndarray
    """Of the newest sample, as the other four, see `contactsense.types.Sample`; shape (n,)."""
    qd: np.ndarray
    torque: np.ndarray
    base_wrench: np.ndarray
    wrist_wrench: np.ndarray
    feeds: np.ndarray
    """See `contactsense.feed`, shape (5, 3)."""
    steps: np.ndarray
    """How far each observer is to step [s]: 0 starts it anew, negative: it has no value, shape (5,)."""
    usable: np.ndarray
    """1 where a residual can be used, shape (5,)."""
    clock: np.ndarray
    """Time of the newest sample, step to it, usual step [s]; factor on the variances of the noise, shape
    (4,)."""


def empty_stream(joints: int) -> Stream:
    """Before the first sample; `restart` starts it."""
    return Stream(
        q=np.zeros(joints),
        qd=np.zeros(joints),
        torque=np.zeros(joints),
        base_wrench=np.zeros(6),
        wrist_wrench=np.zeros(6),
        feeds=np.zeros((5, 3)),
        steps=np.zeros(5),
        usable=np.zeros(5),
        clock=np.zeros(4),
    )


@kernel
def restart(stream: Stream) -> None:
    """No sample has come yet."""
    silence(stream.feeds)
    stream.clock[:] = 0.0
    stream.clock[T] = -math.inf


@kernel
def put(
    stream: Stream,
    q: np.ndarray,
    qd: np.ndarray,
    torque: np.ndarray,
    base_wrench: np.ndarray,
    wrist_wrench: np.ndarray,
) -> bool:
    """Keep a sample's values; False: they are too many or too few."""
    values = (q, qd, torque, base_wrench, wrist_wrench)
    places = (stream.q, stream.qd, stream.torque, stream.base_wrench, stream.wrist_wrench)
    for i in range(5):
        if len(values[i]) != len(places[i]):
            return False
    for i in range(5):
        for k in range(len(places[i])):
            places[i][k] = values[i][k]
    return True


@kernel
def _sound(vector: np.ndarray) -> bool:
    for value in vector:  # noqa: SIM110 (a generator cannot be compiled)
        if not abs(value) < _ABSURD:
            return False
    return True


@kernel
def arrive(stream: Stream, t: float, given: int, bandwidth: float) -> int:
    """A sample has come: how far the observers are to step, and which residuals can be used.

    Args:
        stream: With the sample's values; the rest is changed in place.
        t: Its time [s].
        given: Which sensors have a value in it: 1 base wrench, 2 torques, 4 wrist wrench.
        bandwidth: Cut-off frequency of the observers [Hz].

    Returns:
        What is to be said of it so far.
    """
    clock, feeds, steps, usable = stream.clock, stream.feeds, stream.steps, stream.usable
    if not (math.isfinite(t) and _sound(stream.q) and _sound(stream.qd)):
        return UNUSABLE
    if t == clock[T]:
        return REPEATED
    said = 0
    if t < clock[T]:
        restart(stream)
        said = RESTARTED
    clock[STEP] = min(t - clock[T], _LONGEST) if clock[T] > -math.inf else 0.0
    clock[USUAL_STEP] += (_LATELY if clock[USUAL_STEP] > 0.0 else 1.0) * (clock[STEP] - clock[USUAL_STEP])
    clock[T] = t
    values = (stream.base_wrench, stream.torque, stream.wrist_wrench)
    for i in range(3):
        here = given >> i & 1 == 1
        sound = here and _sound(values[i])
        steps[i] = proceed(feeds[i], t, sound)
        if silent(feeds[i], t):
            said |= MISSING << i
        elif here and not sound:
            said |= SPOILT << i
    for i in (MATCH, WRIST_MATCH):
        steps[i] = proceed(feeds[i], t, steps[BASE] >= 0.0 and steps[i - 2] >= 0.0)
    settle = SETTLE / (2.0 * math.pi * bandwidth)
    for i in range(5):
        usable[i] = 1.0 if settled(feeds[i], t, settle) else 0.0
    return said


@kernel
def sensors_of(stream: Stream) -> tuple[bool, bool, bool]:
    """Which of base wrench, torques and wrist wrench can be used."""
    return stream.usable[BASE] > 0.0, stream.usable[TORQUE] > 0.0, stream.usable[WRIST] > 0.0


@kernel
def sensor_number(stream: Stream) -> float:
    """A number that stands for the sensors that can be used and held against each other."""
    number = 0.0
    for i in range(5):
        number = 2.0 * number + stream.usable[i]
    return float(number)


@kernel
def pace(stream: Stream) -> int:
    """Place of the usual step in `contactsense.levels.stream_levels`."""
    return int(min(max(round(1e3 * stream.clock[USUAL_STEP]), 1), SLOWEST)) - 1
