"""Covariances due to errors of the masses that are not learnt.

A stream learns the masses in free motion (`contactsense.residuals.bias_filter`). One measurement of an arm at
rest, from which the weight of the model is subtracted, cannot.
"""

import numpy as np

from contactsense.kinematics.momenta import of_link_alone
from contactsense.kinematics.spatial import add_outer, dot6
from contactsense.robots.jit.kernel import kernel


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
        add_outer(covariance, of_link_alone(weight, k), error * error)


@kernel
def mass_torque_variance(weight: np.ndarray, error: float, screw: np.ndarray, j: int) -> float:
    """Variance of the torque of joint j, whose screw is `screw`, because of the masses beyond it [Nm^2].
    Other arguments as for `add_mass_covariance`."""
    variance = 0.0
    for k in range(j + 1, weight.shape[0]):
        torque = error * dot6(screw, of_link_alone(weight, k))
        variance += torque * torque
    return variance
