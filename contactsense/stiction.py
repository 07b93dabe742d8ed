"""What friction takes from a resting joint: any torque up to Coulomb friction, but always nearly the same.

Without a base sensor a push on a resting joint has to exceed all that its friction may hold before a single
residual can tell it from friction. Yet friction does not change by itself. After a stop it creeps, by about
as much in the second second as in the third and fourth together: with the logarithm of the time s since then.
So between s1 and s2 the torque that a joint takes changes by ln(s2 / s1) times sigma, the standard deviation
of what is unexplained at rest. Means of the residuals over slices of ln(s) are kept, and the latest residuals
held against each of them: the last mean before a push tells it best, however long it takes to rise.

What departs from all that is a push - or an arm that begins to move, whose motors turn friction round first.
That is over, and seen as motion, within `BREAKAWAY`; a push stays. Joints are followed only while the whole
arm rests, as motion of one changes the load of the others. Once any has slipped, nothing is known until all
have rested anew. In a contact what is known waits and becomes less certain; what a push has done to friction
is learned after it.
"""

import math
from typing import NamedTuple

import numpy as np

from contactsense.drive import Drive, unexplained
from robots.arrays import copy
from robots.compiled import kernel

PRESLIDING = 5e-4
"""A joint that has moved so far has slipped; before, friction is a spring [rad]."""
BREAKAWAY = 0.2
"""An arm that begins to move has slipped after so long: PRESLIDING at 0.025 rad/s^2 [s]."""
RESTED = 0.5
"""So long after a slip friction and controller have come to rest, and creep [s]."""
CREEPS = 10.0
"""From then on what is unexplained changes as it does so long after a slip: temperature, controller [s]."""
SLICE, SLICES = 0.1, 8
"""Length of a slice of ln(s), and how many are kept."""
OVER = 0.25
"""The contact is over when its energy has fallen to this share, its torques to half: friction may have
shifted meanwhile, so that they need not come back to where they were."""
_STARTED, _RESTS, _CREPT, _AWAY, _ON, _PEAK, _TOUCHED, _ENERGY = 0, 1, 2, 3, 4, 5, 6, 7


class Stiction(NamedTuple):
    """What is known of the torques that resting joints take. n joints."""

    level: np.ndarray
    """Mean residual of the slice that is being filled, and of those before, the latest first, shape (SLICES +
    1, n) [Nm]."""
    slices: np.ndarray
    """Of each: when it was, in ln(s); variance of its mean over that of one residual, infinite for those that
    are empty; how long it lasts [s]; shape (SLICES + 1, 3)."""
    anchor: np.ndarray
    """Joint positions at the last slip, shape (n,) [rad]."""
    clock: np.ndarray
    """Whether it has started; time since the last slip [s], and ln of it; for how long torques have been away
    from their levels [s]; whether that is a contact, and the highest energy of it; whether any contact was on
    at the last sample; the energy that was returned for that; shape (8,)."""


def empty_stiction(joints: int) -> Stiction:
    """Before the first sample, for that many joints."""
    return Stiction(
        level=np.zeros((SLICES + 1, joints)),
        slices=np.zeros((SLICES + 1, 3)),
        anchor=np.zeros(joints),
        clock=np.zeros(8),
    )


@kernel
def forget_levels(state: Stiction) -> None:
    """Start anew with the next sample."""
    state.clock[:] = 0.0


@kernel
def energy_beyond_rest(
    state: Stiction,
    drive: Drive,
    q: np.ndarray,
    residual: np.ndarray,
    noise: np.ndarray,
    scale: float,
    unknown: np.ndarray,
    dt: float,
    touched: bool,
    limits: tuple[float, float],
    bandwidth: float,
) -> float:
    """Take in one sample; energy of "nothing touches" by what has changed since the arm rests.

    Args:
        state: Changed in place.
        drive: Of the joints: what is unexplained at rest.
        q: Joint positions, shape (n,) [rad].
        residual: Torques beyond the model's, shape (n,) [Nm].
        noise: Variance of their noise in one sample, shape (n,) [Nm^2].
        scale: Factor on that which the observer leaves.
        unknown: Variance of what is not known of the model, shape (n,) [Nm^2].
        dt: Time since the last torques [s]; 0 starts anew, negative: none came.
        touched: Whether a contact is on, of whatever evidence.
        limits: Energies at which a contact begins and ends.
        bandwidth: Cut-off frequency of the residuals [Hz].

    Returns:
        0 while the arm moves or nothing has changed; half the sum of squares in units of their variance once
        torques have been away from their levels for `BREAKAWAY`.
    """
    clock = state.clock
    if dt < 0.0:
        return float(clock[_ENERGY])
    slipped = dt == 0.0 or clock[_STARTED] == 0.0 or (clock[_TOUCHED] > 0.0 and not touched)
    for j in range(q.shape[0]):
        slipped = slipped or abs(q[j] - state.anchor[j]) > PRESLIDING
    if slipped:
        _restart(state, q)
    clock[_TOUCHED] = 1.0 if touched else 0.0
    clock[_ENERGY] = 0.0
    clock[_RESTS] += dt
    if clock[_RESTS] < RESTED:
        return 0.0
    clock[_CREPT] += dt / min(clock[_RESTS], CREEPS)
    energy = _furthest(state, drive, residual, noise, scale, unknown)
    onset, release = limits
    if clock[_ON] > 0.0:
        clock[_PEAK] = max(clock[_PEAK], energy)
        if energy <= release or energy <= OVER * clock[_PEAK]:
            _restart(state, q)
        else:
            clock[_ENERGY] = energy
    elif energy > (onset if clock[_AWAY] == 0.0 else release):
        _empty(state, 0)
        clock[_AWAY] += dt
        if clock[_AWAY] >= BREAKAWAY:
            clock[_ON], clock[_PEAK], clock[_ENERGY] = 1.0, energy, energy
    else:
        clock[_AWAY] = 0.0
        if touched:
            _empty(state, 0)
        else:
            _fill(state, residual, dt, bandwidth)
    return float(clock[_ENERGY])


@kernel
def _furthest(
    state: Stiction, drive: Drive, residual: np.ndarray, noise: np.ndarray, scale: float, unknown: np.ndarray
) -> float:
    """Energy of the residuals beyond that slice from which they are furthest."""
    highest = 0.0
    for k in range(1, SLICES + 1):
        if math.isinf(state.slices[k, 1]):
            break
        crept = (state.clock[_CREPT] - state.slices[k, 0]) ** 2
        energy = 0.0
        for j in range(residual.shape[0]):
            away = residual[j] - state.level[k, j]
            sigma2 = unexplained(drive, j, 0.0, 0.0) ** 2 + unknown[j]
            energy += away * away / (crept * sigma2 + (1.0 + state.slices[k, 1]) * scale * noise[j])
        highest = max(highest, 0.5 * energy)
    return highest


@kernel
def _fill(state: Stiction, residual: np.ndarray, dt: float, bandwidth: float) -> None:
    """Take residuals into the slice that is being filled, and close it when it is long enough."""
    level, slices, crept = state.level, state.slices, state.clock[_CREPT]
    if slices[0, 2] == 0.0:
        slices[0, 0] = crept
    slices[0, 2] += dt
    share = dt / slices[0, 2]
    for j in range(residual.shape[0]):
        level[0, j] += share * (residual[j] - level[0, j])
    if crept - slices[0, 0] < SLICE:
        return
    slices[0, 0] = 0.5 * (slices[0, 0] + crept)
    # Mean of an Ornstein-Uhlenbeck process over k of its time constants.
    k = 2.0 * math.pi * bandwidth * slices[0, 2]
    slices[0, 1] = 2.0 / k * (1.0 - (1.0 - math.exp(-k)) / k)
    for i in range(SLICES, 0, -1):
        copy(level[i - 1], level[i])
        copy(slices[i - 1], slices[i])
    _empty(state, 0)


@kernel
def _empty(state: Stiction, k: int) -> None:
    state.level[k] = 0.0
    state.slices[k, 0], state.slices[k, 1], state.slices[k, 2] = 0.0, math.inf, 0.0


@kernel
def _restart(state: Stiction, q: np.ndarray) -> None:
    """Nothing is known but what friction may hold."""
    state.clock[:] = 0.0
    state.clock[_STARTED] = 1.0
    copy(q, state.anchor)
    for k in range(SLICES + 1):
        _empty(state, k)
