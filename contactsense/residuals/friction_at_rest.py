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
from typing import Annotated, NamedTuple

import numpy as np

from contactsense.residuals.joint_friction import JointTorqueModel, unmodelled_torque_std
from contactsense.robots.jit.array_views import copy
from contactsense.robots.jit.declaration import Floats, Records, record
from contactsense.robots.jit.kernel import inlined_kernel, kernel

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


@record
class RestStatus:
    """What is known of the arm at rest."""

    started: bool
    """Whether there was a sample at all."""
    rest_time: float
    """Time since the last slip [s]."""
    log_time: float
    """Its logarithm."""
    deviation_time: float
    """For how long the torques have deviated from their references [s]."""
    in_contact: bool
    """Whether that is a contact."""
    peak_energy: float
    """The largest energy of it."""
    was_touched: bool
    """Whether any contact was present at the last sample."""
    energy: float
    """The energy returned for it."""


@record
class TimeSlice:
    """A slice of ln(s)."""

    log_time: float
    """Its ln(s)."""
    variance_ratio: float
    """Variance of its mean over that of one residual, infinite for empty slices."""
    duration: float
    """[s]"""


class TorqueVariance(NamedTuple):
    """Variance of the residuals of the joint torques."""

    noise: np.ndarray
    """Variance of the noise in one sample, shape (n,) [Nm^2]."""
    ratio: float
    """Variance of the residuals over that of one sample's noise."""
    model: np.ndarray
    """Variance due to biases and masses, shape (n,) [Nm^2]."""


class FrictionAtRest(NamedTuple):
    """Reference torques of joints at rest. n joints."""

    mean_residual: Annotated[Floats, f"{SLICE_COUNT} + 1, joints"]
    """Mean residual of the slice being filled and of those before, the latest first [Nm]."""
    slices: Annotated[Records[TimeSlice], f"{SLICE_COUNT} + 1"]
    """The slice being filled and those before."""
    anchor: Annotated[Floats, "joints"]
    """Joint positions at the last slip [rad]."""
    status: Annotated[Records[RestStatus], "1"]


@inlined_kernel
def _clear_status(status: RestStatus) -> None:
    status.started, status.in_contact, status.was_touched = False, False, False
    status.rest_time, status.log_time, status.deviation_time = 0.0, 0.0, 0.0
    status.peak_energy, status.energy = 0.0, 0.0


@kernel
def reset_friction_at_rest(state: FrictionAtRest) -> None:
    """Restart with the next sample."""
    _clear_status(state.status[0])


@kernel
def energy_beyond_static_friction(
    state: FrictionAtRest,
    torque_model: JointTorqueModel,
    q: np.ndarray,
    residual: np.ndarray,
    variance: TorqueVariance,
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
        variance: Of the residuals.
        dt: Time since the last torques [s]; 0 restarts, negative: no torques in this sample.
        touched: Whether a contact is present, by any evidence.
        thresholds: Onset and release threshold of the energy.
        bandwidth: Cut-off frequency of the residuals [Hz].

    Returns:
        0 while the arm moves or nothing has changed; half the squared deviations in units of their variance
        once torques have deviated from their references for `BREAKAWAY_TIME`.
    """
    status = state.status[0]
    if dt < 0.0:
        return status.energy
    slipped = dt == 0.0 or not status.started or (status.was_touched and not touched)
    for j in range(q.shape[0]):
        slipped = slipped or abs(q[j] - state.anchor[j]) > PRESLIDING_DISPLACEMENT
    if slipped:
        _restart(state, q)
    status.was_touched = touched
    status.energy = 0.0
    status.rest_time += dt
    if status.rest_time < SETTLING_TIME:
        return 0.0
    status.log_time += dt / min(status.rest_time, CREEP_TIME)
    energy = _largest_deviation_energy(state, torque_model, residual, variance)
    onset, release = thresholds
    if status.in_contact:
        status.peak_energy = max(status.peak_energy, energy)
        if energy <= release or energy <= RELEASE_RATIO * status.peak_energy:
            _restart(state, q)
        else:
            status.energy = energy
    elif energy > (onset if status.deviation_time == 0.0 else release):
        _clear_slice(state, 0)
        status.deviation_time += dt
        if status.deviation_time >= BREAKAWAY_TIME:
            status.in_contact, status.peak_energy, status.energy = True, energy, energy
    else:
        status.deviation_time = 0.0
        if touched:
            _clear_slice(state, 0)
        else:
            _update_slice(state, residual, dt, bandwidth)
    return status.energy


@kernel
def _largest_deviation_energy(
    state: FrictionAtRest,
    torque_model: JointTorqueModel,
    residual: np.ndarray,
    variance: TorqueVariance,
) -> float:
    """Energy of the deviation of the residuals from the slice that differs most."""
    highest = 0.0
    for k in range(1, SLICE_COUNT + 1):
        if math.isinf(state.slices[k].variance_ratio):
            break
        squared_log_ratio = (state.status[0].log_time - state.slices[k].log_time) ** 2
        energy = 0.0
        for j in range(residual.shape[0]):
            deviation = residual[j] - state.mean_residual[k, j]
            noise = (1.0 + state.slices[k].variance_ratio) * variance.ratio * variance.noise[j]
            sigma2 = unmodelled_torque_std(torque_model, j, 0.0) ** 2 + variance.model[j]
            energy += deviation * deviation / (squared_log_ratio * sigma2 + noise)
        highest = max(highest, 0.5 * energy)
    return highest


@kernel
def _update_slice(state: FrictionAtRest, residual: np.ndarray, dt: float, bandwidth: float) -> None:
    """Add residuals to the slice being filled; close it when it is long enough."""
    mean_residual, slices, log_time = state.mean_residual, state.slices, state.status[0].log_time
    newest = slices[0]
    if newest.duration == 0.0:
        newest.log_time = log_time
    newest.duration += dt
    weight = dt / newest.duration
    for j in range(residual.shape[0]):
        mean_residual[0, j] += weight * (residual[j] - mean_residual[0, j])
    if log_time - newest.log_time < SLICE_LENGTH:
        return
    newest.log_time = 0.5 * (newest.log_time + log_time)
    # Mean of an Ornstein-Uhlenbeck process over k of its time constants.
    k = 2.0 * math.pi * bandwidth * newest.duration
    newest.variance_ratio = 2.0 / k * (1.0 - (1.0 - math.exp(-k)) / k)
    for i in range(SLICE_COUNT, 0, -1):
        copy(mean_residual[i - 1], mean_residual[i])
        slices[i] = slices[i - 1]
    _clear_slice(state, 0)


@kernel
def _clear_slice(state: FrictionAtRest, k: int) -> None:
    state.mean_residual[k] = 0.0
    empty = state.slices[k]
    empty.log_time, empty.variance_ratio, empty.duration = 0.0, math.inf, 0.0


@kernel
def _restart(state: FrictionAtRest, q: np.ndarray) -> None:
    """Discard all references."""
    _clear_status(state.status[0])
    state.status[0].started = True
    copy(q, state.anchor)
    for k in range(SLICE_COUNT + 1):
        _clear_slice(state, k)
