"""Friction of joints at rest (presliding): any torque up to Coulomb friction, but nearly constant in time.

Without a base sensor, a single residual of a joint at rest does not reveal a contact unless it exceeds
Coulomb friction. But friction at rest does not change by itself, except for creep after a stop, which is
logarithmic in the time s since then: as much in the second second as in the third and fourth together. So
between s1 and s2 the friction torque changes by ln(s2 / s1) times sigma, the standard deviation of the torque
model at rest. Mean residuals over slices of ln(s) are stored, and the newest residuals are compared with each
of them: the last mean before a contact reveals it best, however slowly the force rises.

A deviation is either a contact or the start of a motion, whose motors first reverse friction. The latter ends
within `BREAKAWAY_TIME`, and the motion is measured; a contact persists. The references are valid only while
the whole arm is at rest, as motion of one joint changes the load of the others. Once a joint has slipped, all
references are discarded. During a contact the references are held and become less certain; its effect on
friction is learned afterwards.
"""

import math
from typing import NamedTuple

import numpy as np

from contactsense.residuals.joint_friction import JointTorqueModel, unmodelled_torque_std
from contactsense.robots.jit.array_views import copy
from contactsense.robots.jit.kernel import kernel

PRESLIDING_DISPLACEMENT = 5e-4
"""A joint that has moved further has slipped; below, friction acts as a spring [rad]."""
BREAKAWAY_TIME = 0.2
"""An arm that starts to move has slipped after this time: PRESLIDING_DISPLACEMENT at 0.025 rad/s^2 [s]."""
SETTLING_TIME = 0.5
"""Time after a slip until friction and controller have settled and only creep remains [s]."""
CREEP_TIME = 10.0
"""From this time on the change of the torques no longer slows down: temperature, controller [s]."""
SLICE_LENGTH, SLICE_COUNT = 0.1, 8
"""Length of a slice of ln(s), and number of slices stored."""
RELEASE_RATIO = 0.25
"""The contact ends when its energy has fallen to this fraction of its maximum, its torques to half: friction
may have shifted meanwhile, so the torques need not return to their references."""
_STARTED, _REST_TIME, _LOG_TIME, _DEVIATION_TIME, _IN_CONTACT, _PEAK_ENERGY, _WAS_TOUCHED, _ENERGY = (
    0,
    1,
    2,
    3,
    4,
    5,
    6,
    7,
)


class FrictionAtRest(NamedTuple):
    """Reference torques of joints at rest. n joints."""

    mean_residual: np.ndarray
    """Mean residual of the slice being filled and of those before, the latest first, shape (SLICE_COUNT + 1,
    n) [Nm]."""
    slices: np.ndarray
    """Of each slice: its ln(s); variance of its mean over that of one residual, infinite for empty slices;
    its duration [s]; shape (SLICE_COUNT + 1, 3)."""
    anchor: np.ndarray
    """Joint positions at the last slip, shape (n,) [rad]."""
    scalars: np.ndarray
    """Whether it has started; time since the last slip [s], and its logarithm; for how long the torques have
    deviated from their references [s]; whether that is a contact, and the largest energy of it; whether any
    contact was present at the last sample; the energy returned for it; shape (8,)."""


def empty_friction_at_rest(joints: int) -> FrictionAtRest:
    """State before the first sample, for that many joints."""
    return FrictionAtRest(
        mean_residual=np.zeros((SLICE_COUNT + 1, joints)),
        slices=np.zeros((SLICE_COUNT + 1, 3)),
        anchor=np.zeros(joints),
        scalars=np.zeros(8),
    )


@kernel
def reset_friction_at_rest(state: FrictionAtRest) -> None:
    """Restart with the next sample."""
    state.scalars[:] = 0.0


@kernel
def energy_beyond_static_friction(
    state: FrictionAtRest,
    torque_model: JointTorqueModel,
    q: np.ndarray,
    residual: np.ndarray,
    noise_variance: np.ndarray,
    variance_ratio: float,
    model_variance: np.ndarray,
    dt: float,
    touched: bool,
    thresholds: tuple[float, float],
    bandwidth: float,
) -> float:
    """Process one sample; energy of the no-contact hypothesis from the change of the torques since the arm
    came to rest.

    Args:
        state: Changed in place.
        torque_model: Of the joints; its standard deviation at rest is used.
        q: Joint positions, shape (n,) [rad].
        residual: Residuals of the joint torques, shape (n,) [Nm].
        noise_variance: Variance of their noise in one sample, shape (n,) [Nm^2].
        variance_ratio: Variance of the residuals over that of one sample's noise.
        model_variance: Variance due to biases and masses, shape (n,) [Nm^2].
        dt: Time since the last torques [s]; 0 restarts, negative: no torques in this sample.
        touched: Whether a contact is present, by any evidence.
        thresholds: Onset and release threshold of the energy.
        bandwidth: Cut-off frequency of the residuals [Hz].

    Returns:
        0 while the arm moves or nothing has changed; half the squared deviations in units of their variance
        once torques have deviated from their references for `BREAKAWAY_TIME`.
    """
    scalars = state.scalars
    if dt < 0.0:
        return float(scalars[_ENERGY])
    slipped = dt == 0.0 or scalars[_STARTED] == 0.0 or (scalars[_WAS_TOUCHED] > 0.0 and not touched)
    for j in range(q.shape[0]):
        slipped = slipped or abs(q[j] - state.anchor[j]) > PRESLIDING_DISPLACEMENT
    if slipped:
        _restart(state, q)
    scalars[_WAS_TOUCHED] = 1.0 if touched else 0.0
    scalars[_ENERGY] = 0.0
    scalars[_REST_TIME] += dt
    if scalars[_REST_TIME] < SETTLING_TIME:
        return 0.0
    scalars[_LOG_TIME] += dt / min(scalars[_REST_TIME], CREEP_TIME)
    energy = _largest_deviation_energy(
        state, torque_model, residual, noise_variance, variance_ratio, model_variance
    )
    onset, release = thresholds
    if scalars[_IN_CONTACT] > 0.0:
        scalars[_PEAK_ENERGY] = max(scalars[_PEAK_ENERGY], energy)
        if energy <= release or energy <= RELEASE_RATIO * scalars[_PEAK_ENERGY]:
            _restart(state, q)
        else:
            scalars[_ENERGY] = energy
    elif energy > (onset if scalars[_DEVIATION_TIME] == 0.0 else release):
        _clear_slice(state, 0)
        scalars[_DEVIATION_TIME] += dt
        if scalars[_DEVIATION_TIME] >= BREAKAWAY_TIME:
            scalars[_IN_CONTACT], scalars[_PEAK_ENERGY], scalars[_ENERGY] = 1.0, energy, energy
    else:
        scalars[_DEVIATION_TIME] = 0.0
        if touched:
            _clear_slice(state, 0)
        else:
            _update_slice(state, residual, dt, bandwidth)
    return float(scalars[_ENERGY])


@kernel
def _largest_deviation_energy(
    state: FrictionAtRest,
    torque_model: JointTorqueModel,
    residual: np.ndarray,
    noise_variance: np.ndarray,
    variance_ratio: float,
    model_variance: np.ndarray,
) -> float:
    """Energy of the deviation of the residuals from the slice that differs most."""
    highest = 0.0
    for k in range(1, SLICE_COUNT + 1):
        if math.isinf(state.slices[k, 1]):
            break
        log_time = (state.scalars[_LOG_TIME] - state.slices[k, 0]) ** 2
        energy = 0.0
        for j in range(residual.shape[0]):
            deviation = residual[j] - state.mean_residual[k, j]
            sigma2 = unmodelled_torque_std(torque_model, j, 0.0, 0.0) ** 2 + model_variance[j]
            energy += (
                deviation
                * deviation
                / (log_time * sigma2 + (1.0 + state.slices[k, 1]) * variance_ratio * noise_variance[j])
            )
        highest = max(highest, 0.5 * energy)
    return highest


@kernel
def _update_slice(state: FrictionAtRest, residual: np.ndarray, dt: float, bandwidth: float) -> None:
    """Add residuals to the slice being filled; close it when it is long enough."""
    mean_residual, slices, log_time = state.mean_residual, state.slices, state.scalars[_LOG_TIME]
    if slices[0, 2] == 0.0:
        slices[0, 0] = log_time
    slices[0, 2] += dt
    weight = dt / slices[0, 2]
    for j in range(residual.shape[0]):
        mean_residual[0, j] += weight * (residual[j] - mean_residual[0, j])
    if log_time - slices[0, 0] < SLICE_LENGTH:
        return
    slices[0, 0] = 0.5 * (slices[0, 0] + log_time)
    # Mean of an Ornstein-Uhlenbeck process over k of its time constants.
    k = 2.0 * math.pi * bandwidth * slices[0, 2]
    slices[0, 1] = 2.0 / k * (1.0 - (1.0 - math.exp(-k)) / k)
    for i in range(SLICE_COUNT, 0, -1):
        copy(mean_residual[i - 1], mean_residual[i])
        copy(slices[i - 1], slices[i])
    _clear_slice(state, 0)


@kernel
def _clear_slice(state: FrictionAtRest, k: int) -> None:
    state.mean_residual[k] = 0.0
    state.slices[k, 0], state.slices[k, 1], state.slices[k, 2] = 0.0, math.inf, 0.0


@kernel
def _restart(state: FrictionAtRest, q: np.ndarray) -> None:
    """Discard all references."""
    state.scalars[:] = 0.0
    state.scalars[_STARTED] = 1.0
    copy(q, state.anchor)
    for k in range(SLICE_COUNT + 1):
        _clear_slice(state, k)
