"""Sensitivity of the contact centroid to the wrench, and its covariance, in closed form."""

from dataclasses import dataclass
from math import frexp, ldexp

import numpy as np
from scipy.special import ndtr

from contactsense.robots.rotations import cross_matrix
from contactsense.robots.vectors import tangents
from contactsense.sensors.validation import as_floats
from contactsense.solvers.bodies.surface import Surface
from contactsense.solvers.solve_wrench import Solution, solve_wrench


@dataclass(frozen=True, slots=True, eq=False)
class Sensitivity:
    """Derivatives of a contact centroid, in its tangent plane."""

    tangents: np.ndarray
    """Two unit vectors that span the tangent plane, as columns, shape (3, 2)."""
    by_force: np.ndarray
    """Derivative of the shift along them with respect to the force [m/N], shape (2, 3)."""
    by_moment: np.ndarray
    """Derivative of the shift along them with respect to the moment [m/Nm], shape (2, 3)."""
    twin: np.ndarray | None
    """From the contact to its twin [m], shape (3,): the contact if f.m had the other sign, where the force's
    line misses the body. None where the line enters, so that the contact moves continuously."""
    invariant: float
    """f.m [N^2 m], infinite beyond the range of floats; the contact is where its twin is now as soon as it
    changes its sign."""
    by_wrench: np.ndarray
    """Derivative of f.m with respect to force and moment, shape (6,)."""

    def covariance(self, wrench: np.ndarray) -> np.ndarray:
        """Covariance of the centroid [m^2], shape (3, 3), from that of the wrench, force first, shape (6, 6).

        It is the mean square about the centroid: with the probability that noise turns the sign of f.m, the
        error is the distance to the twin.

        Raises:
            ValueError: The covariance has another shape, or is not finite.
        """
        wrench = as_floats("wrench", wrench)
        if wrench.shape != (6, 6) or not np.isfinite(wrench).all():
            raise ValueError(f"wrench: expected a finite covariance of shape (6, 6), not {wrench!r:.60}")
        shift = self.tangents @ np.hstack((self.by_force, self.by_moment))
        covariance = np.asarray(shift @ wrench @ shift.T)
        if self.twin is None:
            return covariance
        # Of large or small wrenches, products of four numbers would leave the range of floats.
        size = float(np.abs(self.by_wrench).max())
        direction = self.by_wrench / size
        deviation = float(np.sqrt(max(direction @ wrench @ direction, 0.0)))
        turned = float(ndtr(-abs(self.invariant) / size / deviation)) if deviation > 0.0 else 0.0
        return covariance + turned * np.outer(self.twin, self.twin)


def sensitivity(surface: Surface, solution: Solution) -> Sensitivity:
    """Derivatives of a contact centroid with respect to force and moment.

    With M = fn J - xi W as in the Newton step, M dv = T^T (c x df - dm). Without torsion (method
    `wrench_axis`) m is
    first freed of its part along the force, p f with the pitch p = f.m / |f|^2, so that dm becomes
    dm - p df - dp f.

    Args:
        surface: The touched surface.
        solution: A contact on it, status `OK`.

    Raises:
        ValueError: The solution is not a contact, so it has no derivatives.
        TypeError: `solution` is none of an exact wrench. The most probable contact of a noisy one has a
            covariance of its own.
    """
    if not isinstance(solution, Solution):
        raise TypeError(
            f"solution: expected one of `solve` without a covariance, got {type(solution).__name__}"
        )
    if not solution.ok:
        raise ValueError(f"no derivatives of a solution that is {solution.status.name}")
    c, n = solution.centroid, solution.normal
    # In a unit of force in which the force is of order one: its square may be beyond the range of floats.
    unit = ldexp(1.0, frexp(float(np.abs(solution.force).max()))[1] - 1)
    f, m, xi = solution.force / unit, solution.moment / unit, solution.torsion / unit
    T = np.array(tangents((float(n[0]), float(n[1]), float(n[2])))).reshape(2, 3).T
    push = float(f @ n)
    J = np.array(((0.0, -1.0), (1.0, 0.0)))
    cross = cross_matrix(c)
    size = float(np.linalg.norm(f))
    u = f / size
    t = float(f @ m)
    if solution.method == "wrench_axis":
        pitch = float(u @ m) / size
        by_force = cross + pitch * np.eye(3) + np.outer(u, m / size - 2.0 * pitch * u)
        by_moment = np.outer(u, u) - np.eye(3)
        M = push * J
        twin = None
    else:
        by_force, by_moment = cross, -np.eye(3)
        M = push * J - xi * (T.T @ surface.shape_operator(c, n) @ T)
        twin = _twin(surface, solution)
    return Sensitivity(
        T,
        np.linalg.solve(M, T.T @ by_force) / unit,
        np.linalg.solve(M, T.T @ by_moment) / unit,
        twin,
        unit * (unit * t),
        np.concatenate((solution.moment, solution.force)),
    )


def _twin(surface: Surface, solution: Solution) -> np.ndarray | None:
    """From a contact to its twin, shape (3,), if the force's line misses the body."""
    f, m = solution.force, solution.moment
    u = f / np.abs(f).max()
    along = float(u @ m) / float(u @ u) * u
    if solve_wrench(surface, f, m, "wrench_axis").ok:
        return None
    other = solve_wrench(surface, f, m - 2.0 * along, solution.method)
    return other.centroid - solution.centroid if other.ok else None
