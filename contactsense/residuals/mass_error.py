"""Covariances due to errors of the masses that are not learnt.

A stream learns the masses in free motion (`contactsense.residuals.bias_filter`). One measurement of an arm at
rest, from which the weight of the model is subtracted, cannot.
"""

import numpy as np

from contactsense.kinematics.spatial import dot6
from contactsense.robots.jit.kernel import kernel


@kernel
def of_link_alone(total: np.ndarray, k: int, i: int) -> float:
    """Component i of the momentum or gravity wrench of link k alone; `total`: of each link together with all
    distal ones, shape (n + 1, 6)."""
    return float(total[k, i] - (total[k + 1, i] if k + 1 < total.shape[0] else 0.0))


@kernel
def add_mass_covariance(weight: np.ndarray, error: float, first: int, covariance: np.ndarray) -> None:
    """Add the covariance of the wrench of links `first` and beyond.

    Args:
        weight: Gravity wrench of each link together with all distal ones, base axes, about the base origin,
            shape (n + 1, 6) [N, Nm].
        error: Relative standard deviation of each link's mass; the errors are independent.
        first: First link that the sensor carries, 0 for the base.
        covariance: Changed in place, base axes, about the base origin, shape (6, 6) [N^2, N Nm, Nm^2].
    """
    for k in range(first, weight.shape[0]):
        for a in range(6):
            of_a = error * error * of_link_alone(weight, k, a)
            for b in range(6):
                covariance[a, b] += of_a * of_link_alone(weight, k, b)


@kernel
def add_load_covariance(wrench: np.ndarray, error: float, covariance: np.ndarray) -> None:
    """Add the covariance of the wrench of a body whose mass has this relative error. Shapes (6,) [N, Nm] and
    (6, 6)."""
    for a in range(6):
        for b in range(6):
            covariance[a, b] += error * error * wrench[a] * wrench[b]


@kernel
def mass_torque_variance(weight: np.ndarray, error: float, screw: np.ndarray, j: int) -> float:
    """Variance of the torque of joint j, whose screw is `screw`, because of the masses beyond it [Nm^2].
    Other arguments as for `add_mass_covariance`."""
    variance = 0.0
    for k in range(j + 1, weight.shape[0]):
        torque = dot6(screw, weight[k])
        if k + 1 < weight.shape[0]:
            torque -= dot6(screw, weight[k + 1])
        variance += error * error * torque * torque
    return variance
