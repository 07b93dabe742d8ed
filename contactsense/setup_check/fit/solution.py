"""The solution of the equations of a setup by weighted least squares."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from scipy.linalg import lu_solve


@dataclass(frozen=True)
class Solution:
    """Values of P unknowns: the free parameters, then the nuisances."""

    cost: float
    """Twice the negative log posterior of the nuisances."""
    penalty: float
    """The part of it that their priors have."""
    variance: np.ndarray
    """Of each measured channel's residual, shape (C',) [Nm^2, or N^2 and Nm^2]."""
    values: np.ndarray
    """Shape (P,); the nuisances in units of their priors."""
    factor: tuple[np.ndarray, np.ndarray]
    """Of the precision of all values in units of their priors (`scipy.linalg.lu_factor`)."""
    residual: np.ndarray
    """Of each row, shape (M, C) [Nm, or N and Nm]; NaN where it is not measured."""
    biases: Mapping[str, int]
    """First of the six values of each force/torque sensor's bias."""

    @property
    def spread(self) -> np.ndarray:
        """Standard deviations of the values, in units of their priors, shape (P,)."""
        variance = np.diag(lu_solve(self.factor, np.eye(len(self.values)), check_finite=False))
        prior = np.ones(len(variance))
        for first in self.biases.values():
            prior[first : first + 6] = 0.5 * (1.0 + self.values[first : first + 6] ** 2)
        # Rounding loses what the motion hardly tells, as that of an arm at rest: only the prior is known.
        return np.asarray(np.sqrt(np.where(variance > 0.0, variance, prior)))
