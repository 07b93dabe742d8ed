"""Kalman filter for sensor biases, friction, link masses and the place of what the arm carries, updated in
free motion and held in contact.

Biases of the base sensor and of the joint torques drift; friction differs from day to day by a factor for
each joint, mainly with the temperature of its oil; masses are known to a few per cent; the height of a
payload that was picked up is not known at all (`contactsense.residuals.payload_error`). All enter the
residuals linearly: r = -Phi e + noise, with e the errors of biases, factors and masses, true less estimated,
and of the place of the payload. The columns of Phi for the latter two are residuals of the same first-order
filter (`contactsense.residuals.momentum_observer`), driven by the momenta and weights of single links, or by
their change with the payload's place; that of a friction factor is the low-passed friction of its joint. The
filter is updated in free motion only. In a contact it is held, and the uncertainty that remains, Phi P Phi^T,
is added to the covariance of the residuals.

The momentum of a payload is quadratic in its place. While its height is not known, the square of that error
counts as noise in one direction of the residuals, of the mean square 3 s^4 for an error of variance s^2.

Biases are random walks. Their variance is such that each estimate converges to the average of its residual
over a time T: sigma^2 dt / T^2 per second for white noise sigma in samples dt apart; those of the base sensor
are correlated as its noise is, which depends on where it sits. The variance of a friction factor returns to
that between days within `FRICTION_TIME`.
"""

import math
from typing import Annotated, NamedTuple

import numpy as np

from contactsense.kinematics.model import Motion
from contactsense.kinematics.momenta import of_link_alone, per_shift_of_point_mass
from contactsense.kinematics.spatial import dot6
from contactsense.residuals.joint_friction import JointTorqueModel
from contactsense.residuals.momentum_observer import MomentumObserver, advance, start_step
from contactsense.robots.jit.declaration import Floats, Records, Sized, record
from contactsense.robots.jit.kernel import inlined_kernel, kernel
from contactsense.robots.vectors import cross, rotate, scale, vector

UPDATE_INTERVAL = 2.0
"""Time between two updates, in time constants of the observer."""
PAUSE_AFTER_CONTACT = 5.0
"""Time from the end of a contact to the next update, in time constants of the observer."""
FRICTION_TIME = 3600.0
"""Time within which friction may change as much as from day to day, an assumption: arms take about as long to
warm up [s]."""
BASE_BIASES, TORQUE_BIASES = 0, 6
"""First of the six biases of the base sensor and of the n biases of the torques among the estimates."""


@kernel
def friction_factors(n: int) -> int:
    """First of the n friction factors among the estimates."""
    return TORQUE_BIASES + n


@kernel
def masses(n: int) -> int:
    """First of the n masses among the estimates: of the first link behind the base."""
    return TORQUE_BIASES + 2 * n


@kernel
def payload_place(n: int) -> int:
    """First of the three coordinates of the payload among the estimates."""
    return masses(n) + n


@kernel
def regressor_of(n: int, k: int) -> int:
    """First of the n + 6 residuals (joints, then base) that mass k adds, in `BiasFilter.mass_regressor`; from
    k = n on, that a coordinate of the payload adds."""
    return (n + 6) * k


@record
class BiasFilterStatus:
    """When the filter was updated, and what it estimates."""

    time_since_update: float
    """[s]"""
    time_since_contact: float
    """[s]"""
    usual_step: float
    """Usual time between samples up to the last one [s]."""
    estimates_friction: bool
    estimates_masses: bool
    payload_mass: float
    """Mass of a payload, whose place is estimated, as are masses then; 0: there is none [kg]."""


class BiasFilter(NamedTuple):
    """State of the filter: 6 biases of the base sensor, n of the torques, n friction factors, n masses, the
    latter two relative to their estimates; place of the payload in the last link's frame [m]."""

    covariance: Annotated[Floats, "9 + 3 * joints, 9 + 3 * joints"]
    """Covariance of all of them."""
    bias: Annotated[Floats, "6"]
    """Bias of the base wrench in addition to the scene's, base axes, base origin [N, Nm]."""
    mass_regressor: Annotated[MomentumObserver, Sized(equations="(joints + 6) * (joints + 3)")]
    """Columns of Phi for masses and payload: n + 6 equations (joints, then base) for each of n links
    and 3 coordinates."""
    friction_regressor: Annotated[Floats, "joints"]
    """Entry of Phi for each friction factor: friction by the model, low-passed as the joint's residual is
    [Nm]."""
    base_covariance: Annotated[Floats, "6, 6"]
    """Covariance of the base wrench due to biases and masses."""
    torque_variance: Annotated[Floats, "joints"]
    """Variance of each torque due to biases, friction factors and masses."""
    residual_mass_covariance: Annotated[Floats, "joints + 6, joints + 3"]
    """Scratch: covariance of each residual with masses and place of the payload."""
    measurement_row: Annotated[Floats, "9 + 3 * joints"]
    """Scratch: row of Phi for one residual."""
    cross_covariance: Annotated[Floats, "9 + 3 * joints"]
    """Scratch: covariance of all estimates with one residual, P times the row."""
    correction: Annotated[Floats, "9 + 3 * joints"]
    """Scratch: correction of all estimates in an update."""
    combination: Annotated[Floats, "6, 6"]
    """Scratch: combinations of the components of the base wrench whose noise is uncorrelated."""
    combination_variance: Annotated[Floats, "6"]
    """Scratch: variance of the noise of each of them, in units of the residual's variance ratio."""
    wrench_correction: Annotated[Floats, "3, 6"]
    """Scratch: correction of base wrench and momentum; and the latter's part due to the payload's place."""
    payload_place: Annotated[Floats, "3"]
    """Place of the payload, a point mass, in the last link's frame [m]."""
    gravity: Annotated[Floats, "3"]
    """Gravity on the payload, base axes [m/s^2]."""
    height_axis: Annotated[Floats, "3"]
    """Unit vector along which the payload's place was not known, in the last link's frame."""
    height_regressor: Annotated[MomentumObserver, Sized(equations="joints + 6")]
    """By how much the square of an error along that axis makes the residuals wrong: joints, then base."""
    wrench_noise: Annotated[Floats, "6, 6"]
    """Scratch: covariance of the wrench's noise and of the square of that error."""
    bare_covariance: Annotated[Floats, "9 + 3 * joints"]
    """While there is a payload: covariance of all estimates with the relative mass of the last link alone, as
    it was estimated before."""
    status: Annotated[Records[BiasFilterStatus], "1"]


def restart(
    bias_filter: BiasFilter, inertia_error: float, base_weight: np.ndarray, friction_error: np.ndarray
) -> None:
    """Discard all estimates.

    Args:
        bias_filter: Changed in place.
        inertia_error: Relative standard deviation of each link's mass.
        base_weight: Gravity wrench on the base link, shape (6,) [N, Nm]; an error of it is a bias.
        friction_error: Relative standard deviation of each joint's friction, shape (n,).
    """
    observers = (*bias_filter.mass_regressor, *bias_filter.height_regressor)
    for array in (*observers, *(part for part in bias_filter if not isinstance(part, MomentumObserver))):
        np.asarray(array).fill(0)
    base_weight_error = inertia_error * base_weight
    bias_filter.covariance[:6, :6] = np.outer(base_weight_error, base_weight_error)
    variance = np.concatenate((friction_error**2, np.full(len(friction_error), inertia_error**2)))
    factors = 6 + len(friction_error) + np.arange(len(variance))
    bias_filter.covariance[factors, factors] = variance
    status = bias_filter.status[0]
    status.estimates_friction, status.estimates_masses = bool(friction_error.any()), inertia_error > 0.0


@inlined_kernel
def predict(
    bias_filter: BiasFilter,
    torque_model: JointTorqueModel,
    motion: Motion,
    base_noise: np.ndarray,
    torque_noise: np.ndarray,
    bias_rate: float,
    dt: float,
    usual_step: float,
    bandwidth: float,
) -> None:
    """Prediction for one sample: mass regressor, random walks, covariance of the residuals.

    Args:
        bias_filter: Changed in place.
        torque_model: Contents of the joint torque signal.
        motion: After `contactsense.kinematics.momenta.kinematics_and_momenta` for this sample.
        base_noise: Covariance of the base sensor's noise in one sample, shape (6, 6).
        torque_noise: Variance of each torque's noise in one sample, shape (n,).
        bias_rate: 1 / T [1/s]; 0: biases are constant.
        dt: Time since the last sample [s]; 0 restarts.
        usual_step: Usual time between samples up to this one [s].
        bandwidth: Cut-off frequency of the observers [Hz].
    """
    P, n = bias_filter.covariance, torque_noise.shape[0]
    status = bias_filter.status[0]
    status.time_since_update += dt
    status.time_since_contact += dt
    # The step to this sample may be a gap, which is not usual.
    growth = bias_rate * bias_rate * status.usual_step * dt
    status.usual_step = usual_step
    for a in range(6):
        for b in range(6):
            P[a, b] += growth * base_noise[a, b]
            bias_filter.base_covariance[a, b] = P[a, b]
    for j in range(n):
        P[TORQUE_BIASES + j, TORQUE_BIASES + j] += growth * torque_noise[j]
    for j in range(n):
        bias_filter.torque_variance[j] = P[TORQUE_BIASES + j, TORQUE_BIASES + j]
    if status.estimates_friction:
        growth = min(2.0 * dt / FRICTION_TIME, 1.0)
        for j in range(n):
            f, friction = friction_factors(n) + j, bias_filter.friction_regressor[j]
            P[f, f] += growth * max(torque_model.friction_error[j] ** 2 - P[f, f], 0.0)
            bias_filter.torque_variance[j] += friction * (friction * P[f, f] + 2.0 * P[f, TORQUE_BIASES + j])
    if status.estimates_masses:
        _advance_mass_regressor(bias_filter, torque_model, motion, dt, bandwidth)
        _add_mass_covariance(bias_filter, n)


@inlined_kernel
def update_is_due(bias_filter: BiasFilter, bandwidth: float) -> bool:
    """Whether the filter takes in the residuals of this sample, where nothing touches."""
    K, status = 2.0 * math.pi * bandwidth, bias_filter.status[0]
    return (
        status.time_since_update * K >= UPDATE_INTERVAL
        and status.time_since_contact * K >= PAUSE_AFTER_CONTACT
    )


@kernel
def estimated_columns(bias_filter: BiasFilter) -> int:
    """Number of columns of Phi for masses and payload, where masses are estimated."""
    n: int = bias_filter.torque_variance.shape[0]
    return n + 3 if bias_filter.status[0].payload_mass > 0.0 else n


@kernel
def _advance_mass_regressor(
    bias_filter: BiasFilter, torque_model: JointTorqueModel, motion: Motion, dt: float, bandwidth: float
) -> None:
    """Columns of Phi for masses and payload; arguments as for `predict`."""
    n = bias_filter.torque_variance.shape[0]
    step = start_step(bias_filter.mass_regressor, dt, bandwidth)
    H, G = motion.momentum, motion.gravity
    for k in range(estimated_columns(bias_filter)):
        if k < n:
            momentum, weight = of_link_alone(H, k + 1), of_link_alone(G, k + 1)
        else:
            momentum, weight = per_shift_of_point_mass(
                bias_filter.status[0].payload_mass,
                bias_filter.payload_place,
                motion,
                bias_filter.gravity,
                k - n,
            )
        # A joint carries the links distal to it only.
        for j in range(min(k + 1, n)):
            s, v = motion.screw[j], motion.screw_rate[j]
            h = torque_model.inertia * dot6(s, momentum)
            drift = torque_model.inertia * dot6(v, momentum) + torque_model.gravity * dot6(s, weight)
            advance(bias_filter.mass_regressor, regressor_of(n, k) + j, h, drift, step)
        for i in range(6):
            advance(bias_filter.mass_regressor, regressor_of(n, k) + n + i, momentum[i], weight[i], step)
    if bias_filter.status[0].payload_mass > 0.0:
        _advance_height_regressor(bias_filter, torque_model, motion, dt, bandwidth)


@kernel
def _advance_height_regressor(
    bias_filter: BiasFilter, torque_model: JointTorqueModel, motion: Motion, dt: float, bandwidth: float
) -> None:
    """The part of the payload's momentum that is quadratic in its place: with u along `height_axis` and the
    angular velocity w of the link, m u x (w x u) per m^2, at any place. Arguments as for `predict`."""
    n, mass = bias_filter.torque_variance.shape[0], bias_filter.status[0].payload_mass
    step = start_step(bias_filter.height_regressor, dt, bandwidth)
    w = vector(motion.twist[n, 3:])
    u = rotate(motion.rotation[n], vector(bias_filter.height_axis))
    L = scale(mass, cross(u, cross(w, u)))
    for j in range(n):
        s, v = motion.screw[j], motion.screw_rate[j]
        h = torque_model.inertia * (s[3] * L[0] + s[4] * L[1] + s[5] * L[2])
        drift = torque_model.inertia * (v[3] * L[0] + v[4] * L[1] + v[5] * L[2])
        advance(bias_filter.height_regressor, j, h, drift, step)
    for i in range(3):
        advance(bias_filter.height_regressor, n + 3 + i, L[i], 0.0, step)


@kernel
def square_variance(bias_filter: BiasFilter) -> float:
    """Mean square of the squared error along `height_axis`: thrice the square of its variance [m^4]; 0
    without a payload."""
    if bias_filter.status[0].payload_mass <= 0.0:
        return 0.0
    P, d = bias_filter.covariance, bias_filter.height_axis
    place = payload_place(bias_filter.torque_variance.shape[0])
    variance = 0.0
    for i in range(3):
        for k in range(3):
            variance += d[i] * P[place + i, place + k] * d[k]
    return 3.0 * variance * variance


@kernel
def bias_coefficient(n: int, equation: int) -> float:
    """Coefficient of a residual's own bias: 1 for a torque, -1 for the base wrench."""
    return 1.0 if equation < n else -1.0


@kernel
def _bias_index(n: int, equation: int) -> int:
    """Index of a residual's own bias in the filter's state. The joints' equations come first, then six of the
    base."""
    return TORQUE_BIASES + equation if equation < n else BASE_BIASES + equation - n


@kernel
def _add_mass_covariance(bias_filter: BiasFilter, n: int) -> None:
    """Add to `base_covariance` and `torque_variance`, the covariance due to biases, what masses and
    payload add.

    With B the covariance of biases, C that of biases with masses, M that of masses, S the bias coefficients
    and R the mass regressor: S B S + S C R + (S C R)^T + R^T M R = S B S + U R + R^T V with U = S C, V = U^T
    + M R.
    """
    P, base_covariance, torque_variance, residual_mass_covariance = (
        bias_filter.covariance,
        bias_filter.base_covariance,
        bias_filter.torque_variance,
        bias_filter.residual_mass_covariance,
    )
    r, first, count = bias_filter.mass_regressor.residual, masses(n), estimated_columns(bias_filter)
    for equation in range(n + 6):
        index, sign = _bias_index(n, equation), bias_coefficient(n, equation)
        for k in range(count):
            total = sign * P[index, first + k]
            for i in range(count):
                total += P[first + k, first + i] * r[regressor_of(n, i) + equation]
            residual_mass_covariance[equation, k] = total
    square, of_square = square_variance(bias_filter), bias_filter.height_regressor.residual
    for j in range(n):
        friction = bias_filter.friction_regressor[j]
        torque_variance[j] += square * of_square[j] * of_square[j]
        for k in range(count):
            other = P[TORQUE_BIASES + j, first + k] + 2.0 * friction * P[friction_factors(n) + j, first + k]
            torque_variance[j] += r[regressor_of(n, k) + j] * (other + residual_mass_covariance[j, k])
    for a in range(6):
        for b in range(a + 1):
            total = 0.0
            for k in range(count):
                of_base = regressor_of(n, k) + n
                total += (
                    r[of_base + a] * residual_mass_covariance[n + b, k] - P[a, first + k] * r[of_base + b]
                )
            base_covariance[a, b] += total + square * of_square[n + a] * of_square[n + b]
            base_covariance[b, a] = base_covariance[a, b]


@kernel
def mass_covariance(bias_filter: BiasFilter, first_body: int, covariance: np.ndarray) -> None:
    """Covariance that masses and payload add to the wrench on a link sensor.

    Args:
        bias_filter: After `predict` for this sample.
        first_body: First link that the sensor carries.
        covariance: Filled, base axes, about the base origin, shape (6, 6) [N^2, N Nm, Nm^2].
    """
    n = bias_filter.torque_variance.shape[0]
    P, r, first = bias_filter.covariance, bias_filter.mass_regressor.residual, masses(n)
    count = estimated_columns(bias_filter)
    covariance[:] = 0.0
    for k in range(first_body - 1, count):
        one = regressor_of(n, k) + n
        for b in range(6):
            with_mass = 0.0
            for i in range(first_body - 1, count):
                with_mass += P[first + k, first + i] * r[regressor_of(n, i) + n + b]
            for a in range(6):
                covariance[a, b] += r[one + a] * with_mass
    # Every link sensor carries the payload.
    square, of_square = square_variance(bias_filter), bias_filter.height_regressor.residual
    for a in range(6):
        for b in range(6):
            covariance[a, b] += square * of_square[n + a] * of_square[n + b]


@inlined_kernel
def friction_above_scene(bias_filter: BiasFilter, torque_model: JointTorqueModel, j: int) -> float:
    """By how much the estimated factor raises the friction of joint j above the scene's, low-passed [Nm]."""
    return float(bias_filter.friction_regressor[j] * (1.0 - 1.0 / torque_model.friction_factor[j]))
