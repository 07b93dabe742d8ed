"""Kalman update of the filter of `contactsense.residuals.bias_filter` with the residuals of free motion."""

import numpy as np

from contactsense.kinematics.decorrelation import decorrelate
from contactsense.kinematics.spatial import dot6
from contactsense.residuals.bias_filter import (
    BASE_BIASES,
    TORQUE_BIASES,
    BiasFilter,
    bias_coefficient,
    estimated_columns,
    friction_factors,
    masses,
    regressor_of,
    square_variance,
)
from contactsense.robots.jit.kernel import kernel

_BASE_ORIGIN, _NO_NOISE = (0.0, 0.0, 0.0), (0.0, 0.0)


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
    row[TORQUE_BIASES + j] = bias_coefficient(n, j)
    row[friction_factors(n) + j] = bias_filter.friction_regressor[j]
    for k in range(estimated_columns(bias_filter)):
        row[masses(n) + k] = bias_filter.mass_regressor.residual[regressor_of(n, k) + j]
    of_square = bias_filter.height_regressor.residual[j]
    _update(bias_filter, residual, variance + square_variance(bias_filter) * of_square * of_square)


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
    square, of_square = square_variance(bias_filter) / factor, bias_filter.height_regressor.residual
    for a in range(6):
        for b in range(6):
            bias_filter.wrench_noise[a, b] = covariance[a, b] + square * of_square[n + a] * of_square[n + b]
    decorrelate(
        _BASE_ORIGIN, _NO_NOISE, bias_filter.wrench_noise, combination, bias_filter.combination_variance
    )
    for c in range(6):
        row[:] = 0.0
        for i in range(6):
            row[BASE_BIASES + i] = bias_coefficient(n, n + i) * combination[c, i]
        for k in range(estimated_columns(bias_filter)):
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
        size = masses(n) + estimated_columns(bias_filter)
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
    # The last link without its payload is not corrected, but what is known of the rest changes.
    bare, with_bare = bias_filter.bare_covariance, 0.0
    if status.payload_mass > 0.0:
        for k in range(size):
            with_bare += row[k] * bare[k]
    for i in range(size):
        gain = cross_covariance[i] * precision
        if gain != 0.0:
            correction[i] -= gain * innovation
            bare[i] -= gain * with_bare
            for k in range(size):
                P[i, k] -= gain * cross_covariance[k]
