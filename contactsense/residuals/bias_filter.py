"""Kalman filter for sensor biases, friction and link masses, updated in free motion and held in contact.

Biases of the base sensor and of the joint torques drift; friction differs from day to day by a factor for
each joint, mainly with the temperature of its oil; masses are known to a few per cent. All enter the
residuals linearly: r = Phi e + noise, with e the error of the biases, factors and masses. The columns of Phi
for the masses are residuals of the same first-order filter (`contactsense.residuals.momentum_observer`),
driven by the momenta and weights of single links; that of a friction factor is the low-passed friction of its
joint. The filter is updated in free motion only. In a contact it is held, and the uncertainty that remains,
Phi P Phi^T, is added to the covariance of the residuals.

Biases are random walks. Their variance is such that each estimate converges to the average of its residual
over a time T: sigma^2 dt / T^2 per second for white noise sigma in samples dt apart; those of the base sensor
are correlated as its noise is, which depends on where it sits. The variance of a
friction factor returns to that between days within `FRICTION_TIME`.
"""

import math
from typing import Annotated, NamedTuple

import numpy as np

from contactsense.kinematics.decorrelation import decorrelate
from contactsense.kinematics.model import Motion
from contactsense.kinematics.momenta import of_link_alone
from contactsense.kinematics.spatial import dot6
from contactsense.residuals.joint_friction import JointTorqueModel
from contactsense.residuals.momentum_observer import MomentumObserver, advance, start_step
from contactsense.robots.jit.declaration import Floats, Records, Sized, record
from contactsense.robots.jit.kernel import inlined_kernel, kernel

UPDATE_INTERVAL = 2.0
"""Time between two updates, in time constants of the observer."""
PAUSE_AFTER_CONTACT = 5.0
"""Time from the end of a contact to the next update, in time constants of the observer."""
FRICTION_TIME = 3600.0
"""Time within which friction may change as much as from day to day, an assumption: arms take about as long to
warm up [s]."""
BASE_BIASES, TORQUE_BIASES = 0, 6
"""First of the six biases of the base sensor and of the n biases of the torques among the estimates."""

_BASE_ORIGIN, _NO_NOISE = (0.0, 0.0, 0.0), (0.0, 0.0)


@kernel
def friction_factors(n: int) -> int:
    """First of the n friction factors among the estimates."""
    return TORQUE_BIASES + n


@kernel
def masses(n: int) -> int:
    """First of the n masses among the estimates: of the first link behind the base."""
    return TORQUE_BIASES + 2 * n


@kernel
def regressor_of(n: int, k: int) -> int:
    """First of the n + 6 residuals (joints, then base) that mass k adds, in `BiasFilter.mass_regressor`."""
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


class BiasFilter(NamedTuple):
    """State of the filter: 6 biases of the base sensor, n of the torques, n friction factors, n masses; the
    latter two relative to their estimates."""

    covariance: Annotated[Floats, "6 + 3 * joints, 6 + 3 * joints"]
    """Covariance of all of them."""
    bias: Annotated[Floats, "6"]
    """Bias of the base wrench in addition to the scene's, base axes, base origin [N, Nm]."""
    mass_regressor: Annotated[MomentumObserver, Sized(equations="(joints + 6) * joints")]
    """Columns of Phi for the masses: n + 6 equations (joints, then base) for each of n links."""
    friction_regressor: Annotated[Floats, "joints"]
    """Entry of Phi for each friction factor: friction by the model, low-passed as the joint's residual is
    [Nm]."""
    base_covariance: Annotated[Floats, "6, 6"]
    """Covariance of the base wrench due to biases and masses."""
    torque_variance: Annotated[Floats, "joints"]
    """Variance of each torque due to biases, friction factors and masses."""
    residual_mass_covariance: Annotated[Floats, "joints + 6, joints"]
    """Scratch: covariance of each residual with the masses."""
    measurement_row: Annotated[Floats, "6 + 3 * joints"]
    """Scratch: row of Phi for one residual."""
    cross_covariance: Annotated[Floats, "6 + 3 * joints"]
    """Scratch: covariance of all estimates with one residual, P times the row."""
    correction: Annotated[Floats, "6 + 3 * joints"]
    """Scratch: correction of all estimates in an update."""
    combination: Annotated[Floats, "6, 6"]
    """Scratch: combinations of the components of the base wrench whose noise is uncorrelated."""
    combination_variance: Annotated[Floats, "6"]
    """Scratch: variance of the noise of each of them, in units of the residual's variance ratio."""
    wrench_correction: Annotated[Floats, "2, 6"]
    """Scratch: correction of base wrench and momentum."""
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
    for array in (*bias_filter[:2], *bias_filter.mass_regressor, *bias_filter[3:]):
        np.asarray(array).fill(0)
    base_weight_error = inertia_error * base_weight
    bias_filter.covariance[:6, :6] = np.outer(base_weight_error, base_weight_error)
    variance = np.concatenate((friction_error**2, np.full(len(friction_error), inertia_error**2)))
    factors = np.arange(6 + len(friction_error), len(bias_filter.measurement_row))
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
def _advance_mass_regressor(
    bias_filter: BiasFilter, torque_model: JointTorqueModel, motion: Motion, dt: float, bandwidth: float
) -> None:
    """Columns of Phi for the masses; arguments as for `predict`."""
    n = bias_filter.torque_variance.shape[0]
    step = start_step(bias_filter.mass_regressor, dt, bandwidth)
    H, G = motion.momentum, motion.gravity
    for k in range(n):
        momentum, weight = of_link_alone(H, k + 1), of_link_alone(G, k + 1)
        # A joint carries the links distal to it only.
        for j in range(k + 1):
            s, v = motion.screw[j], motion.screw_rate[j]
            h = torque_model.inertia * dot6(s, momentum)
            drift = torque_model.inertia * dot6(v, momentum) + torque_model.gravity * dot6(s, weight)
            advance(bias_filter.mass_regressor, regressor_of(n, k) + j, h, drift, step)
        for i in range(6):
            advance(bias_filter.mass_regressor, regressor_of(n, k) + n + i, momentum[i], weight[i], step)


@kernel
def _bias_coefficient(n: int, equation: int) -> float:
    """Coefficient of a residual's own bias: 1 for a torque, -1 for the base wrench."""
    return 1.0 if equation < n else -1.0


@kernel
def _bias_index(n: int, equation: int) -> int:
    """Index of a residual's own bias in the filter's state. The joints' equations come first, then six of the
    base."""
    return TORQUE_BIASES + equation if equation < n else BASE_BIASES + equation - n


@kernel
def _add_mass_covariance(bias_filter: BiasFilter, n: int) -> None:
    """Add to `base_covariance` and `torque_variance`, the covariance due to biases, what the masses add.

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
    r, first = bias_filter.mass_regressor.residual, masses(n)
    for equation in range(n + 6):
        index, sign = _bias_index(n, equation), _bias_coefficient(n, equation)
        for k in range(n):
            total = sign * P[index, first + k]
            for i in range(n):
                total += P[first + k, first + i] * r[regressor_of(n, i) + equation]
            residual_mass_covariance[equation, k] = total
    for j in range(n):
        friction = bias_filter.friction_regressor[j]
        for k in range(n):
            other = P[TORQUE_BIASES + j, first + k] + 2.0 * friction * P[friction_factors(n) + j, first + k]
            torque_variance[j] += r[regressor_of(n, k) + j] * (other + residual_mass_covariance[j, k])
    for a in range(6):
        for b in range(a + 1):
            total = 0.0
            for k in range(n):
                of_base = regressor_of(n, k) + n
                total += (
                    r[of_base + a] * residual_mass_covariance[n + b, k] - P[a, first + k] * r[of_base + b]
                )
            base_covariance[a, b] += total
            base_covariance[b, a] = base_covariance[a, b]


@kernel
def mass_covariance(bias_filter: BiasFilter, first_body: int, covariance: np.ndarray) -> None:
    """Covariance that the masses add to the wrench on a link sensor.

    Args:
        bias_filter: After `predict` for this sample.
        first_body: First link that the sensor carries.
        covariance: Filled, base axes, about the base origin, shape (6, 6) [N^2, N Nm, Nm^2].
    """
    n = bias_filter.torque_variance.shape[0]
    P, r, first = bias_filter.covariance, bias_filter.mass_regressor.residual, masses(n)
    covariance[:] = 0.0
    for k in range(first_body - 1, n):
        one = regressor_of(n, k) + n
        for b in range(6):
            with_mass = 0.0
            for i in range(first_body - 1, n):
                with_mass += P[first + k, first + i] * r[regressor_of(n, i) + n + b]
            for a in range(6):
                covariance[a, b] += r[one + a] * with_mass


@inlined_kernel
def friction_above_scene(bias_filter: BiasFilter, torque_model: JointTorqueModel, j: int) -> float:
    """By how much the estimated factor raises the friction of joint j above the scene's, low-passed [Nm]."""
    return float(bias_filter.friction_regressor[j] * (1.0 - 1.0 / torque_model.friction_factor[j]))


@kernel
def update_by_torque(bias_filter: BiasFilter, j: int, residual: float, variance: float) -> None:
    """Kalman update with the residual of joint j; `correction` accumulates the correction of all estimates.

    Args:
        bias_filter: Changed in place.
        j: The joint.
        residual: Its residual before any correction [Nm].
        variance: Variance of the noise in it [Nm^2].
    """
    n, row = bias_filter.torque_variance.shape[0], bias_filter.measurement_row
    row[:] = 0.0
    row[TORQUE_BIASES + j] = _bias_coefficient(n, j)
    row[friction_factors(n) + j] = bias_filter.friction_regressor[j]
    for k in range(n):
        row[masses(n) + k] = bias_filter.mass_regressor.residual[regressor_of(n, k) + j]
    _update(bias_filter, residual, variance)


@kernel
def update_by_wrench(
    bias_filter: BiasFilter, wrench: np.ndarray, covariance: np.ndarray, factor: float
) -> None:
    """The same with the residual of the base wrench, by six combinations of its components whose noise is
    uncorrelated: about another point than its own, a sensor has forces and moments in its noise together.

    Args:
        bias_filter: Changed in place.
        wrench: The residual before any correction, base axes, base origin, shape (6,) [N, Nm].
        covariance: Covariance of the noise in it over `factor`, positive definite, shape (6, 6).
        factor: Variance of the residual over that of the noise of one sample.
    """
    n, row, combination = (
        bias_filter.torque_variance.shape[0],
        bias_filter.measurement_row,
        bias_filter.combination,
    )
    decorrelate(_BASE_ORIGIN, _NO_NOISE, covariance, combination, bias_filter.combination_variance)
    for c in range(6):
        row[:] = 0.0
        for i in range(6):
            row[BASE_BIASES + i] = _bias_coefficient(n, n + i) * combination[c, i]
        for k in range(n):
            of_base = regressor_of(n, k) + n
            row[masses(n) + k] = dot6(
                combination[c], bias_filter.mass_regressor.residual[of_base : of_base + 6]
            )
        _update(bias_filter, dot6(combination[c], wrench), factor * bias_filter.combination_variance[c])


@kernel
def _update(bias_filter: BiasFilter, residual: float, variance: float) -> None:
    """Kalman update with a residual whose row of Phi is `measurement_row`; `variance`: of its noise."""
    P, row, cross_covariance, correction = (
        bias_filter.covariance,
        bias_filter.measurement_row,
        bias_filter.cross_covariance,
        bias_filter.correction,
    )
    # What is not estimated has no covariance.
    n, status = bias_filter.torque_variance.shape[0], bias_filter.status[0]
    size = friction_factors(n)
    if status.estimates_masses:
        size = row.shape[0]
    elif status.estimates_friction:
        size = masses(n)
    innovation_variance, innovation = variance, residual
    cross_covariance[:] = 0.0
    # Where masses are not estimated, most entries are zero.
    for k in range(size):
        if row[k] != 0.0:
            innovation += row[k] * correction[k]
            for i in range(size):
                cross_covariance[i] += P[k, i] * row[k]
    for i in range(size):
        innovation_variance += cross_covariance[i] * row[i]
    precision = 1.0 / innovation_variance
    for i in range(size):
        gain = cross_covariance[i] * precision
        if gain != 0.0:
            correction[i] -= gain * innovation
            for k in range(size):
                P[i, k] -= gain * cross_covariance[k]
