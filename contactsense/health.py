"""Do model and sensors still fit? Statistics of the residuals of a stream, and what to go on with.

Three things are watched. Where nothing touches, each sensor's residual is to be as large as stated. In a
contact base sensor and joint torques are to agree: if for seconds no link makes them agree, the torques,
which hang on friction and drives, are left out. And a base sensor that feels what no push is, while the
joints feel nothing, is left out. What is left out is watched on, and used again once it fits.
"""

import math
from typing import NamedTuple

import numpy as np

from robots.compiled import kernel

BASE, TORQUE, AGREEMENT, FORCE, NOTHING = 0, 1, 2, 3, 4
"""Places in `Memory.fit`; the last holds the energy of "nothing touches" that decides about a contact."""
PACE = 0.02
"""Residuals are looked at so often: they are low-passed anyway [s]."""
LATELY = 2.0
"""Time over which statistics are averaged [s]."""
LARGE, FINE = 1.6, 1.3
"""Mean square residual, in units of its variance, from which on a sensor does not fit, and below which it
does again."""
APART, TOGETHER = 4.0, 2.0
"""The same for the two against each other."""
MOST = 10.0
"""No single sample counts as worse, so that what is over is over soon."""
ENOUGH = 3.0
"""Doubts that last so long have consequences [s]."""
NO_PUSH = 10.0
"""Forces at the base larger than usual contact forces by this factor, unfelt by the joints, are none."""
WAITED, FORCES, SINGLE = 0, 1, 2
"""Places in `Health.clock`."""
_NAMES = ("base_wrench", "joint_torque")


class Health(NamedTuple):
    """Of one stream."""

    level: np.ndarray
    """Lately's mean of `Memory.fit`, but for the force, shape (3,)."""
    large: np.ndarray
    """1 where the residual of base wrench or torques is too large, shape (2,)."""
    left_out: np.ndarray
    """1 where one of the two is not used, shape (2,)."""
    doubt: np.ndarray
    """For how long a sensor has been in doubt, or out of it while it is left out, shape (2,) [s]."""
    clock: np.ndarray
    """Time since the last look [s]; a force at the base that no push has [N]; 1 if only one contact at a time
    is expected. Several may leave the sensors without a link on which they agree, so that torques are never
    left out. Shape (3,)."""


def empty_health() -> Health:
    """Before the first sample; `restart` fills it in."""
    return Health(np.zeros(3), np.zeros(2), np.zeros(2), np.zeros(2), np.zeros(3))


def restart(health: Health, force: float, single: bool) -> None:
    """Forget everything: nothing is wrong yet.

    Args:
        health: Changed in place.
        force: Usual force of contacts [N].
        single: Whether only one contact at a time is expected.
    """
    health.level[:] = 1.0
    for array in (health.large, health.left_out, health.doubt):
        array[:] = 0.0
    health.clock[:] = 0.0, NO_PUSH * force, float(single)


@kernel
def trust(health: Health, usable: np.ndarray) -> None:
    """Leave out what does not fit, if the other sensor is there; `usable`: 1 for sensors that are ready, base
    wrench and torques first; changed in place."""
    if usable[BASE] > 0.0 and usable[TORQUE] > 0.0:
        usable[BASE] -= health.left_out[BASE]
        usable[TORQUE] -= health.left_out[TORQUE]


@kernel
def attend(
    health: Health, fit: np.ndarray, touched: bool, has_base: bool, has_torque: bool, dt: float
) -> bool:
    """Take in one sample; returns whether anything is wrong, which `complaints` says.

    Args:
        health: Changed in place.
        fit: `Memory.fit`.
        touched: Whether a contact is on.
        has_base, has_torque: Which sensors could be used, left out or not.
        dt: Time since the last sample [s].
    """
    health.clock[WAITED] += dt
    if health.clock[WAITED] >= PACE:
        _look(health, fit, touched, has_base, has_torque, health.clock[WAITED])
        health.clock[WAITED] = 0.0
    return bool(
        health.large[BASE] + health.large[TORQUE] + health.left_out[BASE] + health.left_out[TORQUE] > 0.0
    )


@kernel
def _look(
    health: Health, fit: np.ndarray, touched: bool, has_base: bool, has_torque: bool, waited: float
) -> None:
    share = min(waited / LATELY, 1.0)
    if not touched:
        if has_base:
            _compare(health, BASE, fit, share)
        if has_torque:
            _compare(health, TORQUE, fit, share)
    if has_base and has_torque:
        _average(health, AGREEMENT, fit, share)
        agree = health.level[AGREEMENT] if health.clock[SINGLE] > 0.0 else 1.0
        no_push = health.clock[FORCES]
        none = fit[FORCE] > no_push and fit[TORQUE] < APART
        _judge(health, BASE, waited, none, fit[FORCE] < 0.5 * no_push)
        # A base sensor that is left out is no witness against the torques.
        against = agree > APART and health.left_out[BASE] == 0.0
        _judge(health, TORQUE, waited, against, agree < TOGETHER)


@kernel
def _average(health: Health, what: int, fit: np.ndarray, share: float) -> None:
    health.level[what] += share * (min(fit[what], MOST) - health.level[what])


@kernel
def _compare(health: Health, sensor: int, fit: np.ndarray, share: float) -> None:
    if health.left_out[sensor] == 0.0:
        _average(health, sensor, fit, share)
        limit = FINE if health.large[sensor] > 0.0 else LARGE
        health.large[sensor] = 1.0 if health.level[sensor] > limit else 0.0


@kernel
def _judge(health: Health, sensor: int, dt: float, bad: bool, good: bool) -> None:
    against = good if health.left_out[sensor] > 0.0 else bad
    health.doubt[sensor] = health.doubt[sensor] + dt if against else 0.0
    if health.doubt[sensor] >= ENOUGH:
        health.left_out[sensor] = 1.0 - health.left_out[sensor]
        health.doubt[sensor] = 0.0


def complaints(health: Health) -> list[str]:
    """What is wrong, a phrase each."""
    found = [
        f"{name}: without contact its residual is {math.sqrt(health.level[i]):.1f} times as large as noise "
        "and model allow"
        for i, name in enumerate(_NAMES)
        if health.large[i]
    ]
    if health.left_out[BASE]:
        found.append("base_wrench is not used: it feels what no push is, and the joints nothing")
    if health.left_out[TORQUE]:
        found.append("joint_torque is not used: it contradicts base_wrench, whatever link is touched")
    return found
