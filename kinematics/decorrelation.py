"""Uncorrelated combinations of the components of a wrench that has a sensor's noise and model errors."""

import numpy as np

from contactsense.kinematics.spatial import component_about, dot6, product6
from contactsense.robots.jit.kernel import kernel
from contactsense.robots.vectors import Vector


@kernel
def decorrelate(
    origin: np.ndarray | Vector,
    noise_variance: tuple[float, float],
    error_covariance: np.ndarray,
    rows: np.ndarray,
    variances: np.ndarray,
) -> None:
    """Find six combinations of the components of a wrench whose errors are uncorrelated.

    The first is the first component about the sensor's origin; each further one is the next component less
    what those before it tell of its error. So with the covariance C = L D L^T of the components, L lower
    triangular with a diagonal of ones, the combinations are L^-1 times the components, and their variances D.

    Args:
        origin: Where the sensor's noise is independent from component to component, base frame, shape (3,)
            [m].
        noise_variance: Of each component of the force and of the moment about `origin` [N^2, Nm^2]; positive,
            or zero where `error_covariance` is positive definite.
        error_covariance: Covariance of all other errors of the wrench, base axes, about the base origin,
            shape (6, 6) [N^2, N Nm, Nm^2].
        rows: Filled: the combinations are `rows` @ wrench, base axes, about the base origin, shape (6, 6).
        variances: Filled: their variances, shape (6,).
    """
    for i in range(6):
        rows[i, 0], rows[i, 1], rows[i, 2], rows[i, 3], rows[i, 4], rows[i, 5] = component_about(origin, i)
    for k in range(6):
        noise = noise_variance[k // 3]
        # The covariance of combination k with any error of the wrench; with component k it is also its own
        # variance, as it is uncorrelated to those before it.
        covariance = product6(error_covariance, rows[k])
        variances[k] = noise + max(dot6(component_about(origin, k), covariance), 0.0)
        for i in range(k + 1, 6):
            share = dot6(component_about(origin, i), covariance) / variances[k]
            for c in range(6):
                rows[i, c] -= share * rows[k, c]
