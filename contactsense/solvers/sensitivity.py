"""Sensitivity of the contact centroid to the wrench (theory, section 4), and its covariance, in closed
form."""

from dataclasses import dataclass

import numpy as np

from contactsense.solvers.level_set import tangents
from contactsense.solvers.solve import Solution
from contactsense.solvers.surface import Surface


@dataclass(frozen=True, slots=True)
class Sensitivity:
    """Derivatives of a contact centroid, in its tangent plane."""

    tangents: np.ndarray
    """Two unit vectors that span the tangent plane, as columns, shape (3, 2)."""
    by_force: np.ndarray
    """Derivative of the shift along them with respect to the force [m/N], shape (2, 3)."""
    by_moment: np.ndarray
    """Derivative of the shift along them with respect to the moment [m/Nm], shape (2, 3)."""

    def covariance(self, wrench: np.ndarray) -> np.ndarray:
        """Covariance of the centroid [m^2], shape (3, 3), from that of the wrench, force first, shape (6,
        6)."""
        shift = self.tangents @ np.hstack((self.by_force, self.by_moment))
        return np.asarray(shift @ wrench @ shift.T)


def sensitivity(surface: Surface, solution: Solution) -> Sensitivity:
    """Derivatives of a contact centroid with respect to force and moment.

    With M = fn J - xi W as in the Newton step, M dv = T^T (c x df - dm).

    Args:
        surface: The touched surface.
        solution: A contact on it, status `OK`.

    Raises:
        ValueError: The solution is not a contact, so it has no derivatives.
    """
    if not solution.ok:
        raise ValueError(f"no derivatives of a solution that is {solution.status.name}")
    c, n, f, xi = solution.centroid, solution.normal, solution.force, solution.torsion
    T = np.array(tangents(float(n[0]), float(n[1]), float(n[2]))).reshape(2, 3).T
    W = T.T @ surface.shape_operator(c, n) @ T
    push = float(f @ n)
    M = push * np.array(((0.0, -1.0), (1.0, 0.0))) - xi * W
    cross = np.array(((0.0, -c[2], c[1]), (c[2], 0.0, -c[0]), (-c[1], c[0], 0.0)))
    return Sensitivity(T, np.linalg.solve(M, T.T @ cross), -np.linalg.solve(M, T.T))
