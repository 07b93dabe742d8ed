"""Surfaces of the paper: each selects the kernel that solves it.

Every surface is described in its own frame; `Placed` moves it to another.
"""

from dataclasses import dataclass
from typing import Any

import numpy as np

from contactsense.solvers.bodies.surface import (
    EqualByFields,
    KernelSurface,
    Problem,
    Surface,
    around_axis,
    positive,
    tangential,
)
from contactsense.solvers.closed_form import cylinder, ellipsoid, plane, wrench_axis
from contactsense.solvers.general_convex import general
from contactsense.solvers.general_convex import gradient_descent as descent
from contactsense.solvers.general_convex.implicit_surfaces import ELLIPSOID
from contactsense.solvers.general_convex.level_set import SmoothBody

_SKEW = 1e-9
"""How far the axes of a pose may be from orthonormal."""


@dataclass(frozen=True)
class Sphere(KernelSurface):
    """A sphere about the origin (paper, section 5.1.1)."""

    kernels = ellipsoid.solve_sphere, wrench_axis.wrench_axis_ellipsoid

    radius: float
    """Radius [m]."""

    def line_problem(self) -> Problem:
        """That of the ellipsoid, as are the following."""
        return self._ellipsoid().line_problem()

    def newton_problem(self) -> Problem:
        """Newton's method, as for any smooth convex body."""
        return self._ellipsoid().newton_problem()

    def descent_problem(self) -> Problem:
        """Gradient descent (paper, section 6)."""
        return self._ellipsoid().descent_problem()

    def _ellipsoid(self) -> "Ellipsoid":
        return Ellipsoid(self.radius, self.radius, self.radius)

    def shape_operator(self, point: np.ndarray, normal: np.ndarray) -> np.ndarray:
        """The surface's shape operator there [1/m], shape (3, 3)."""
        return tangential(np.eye(3) / self.radius, normal)


@dataclass(frozen=True)
class Ellipsoid(KernelSurface):
    """An ellipsoid about the origin, its axes along those of the frame (paper, section 5)."""

    kernels = ellipsoid.solve_ellipsoid, wrench_axis.wrench_axis_ellipsoid

    a: float
    """Semi-axis along x [m]."""
    b: float
    """Semi-axis along y [m]."""
    c: float
    """Semi-axis along z [m]."""

    def newton_problem(self) -> Problem:
        """Newton's method, as for any smooth convex body."""
        a, b, c = self.arguments()
        size = (ELLIPSOID, 1.0 / a, 1.0 / b, 1.0 / c, 0.0, 0.0)
        return general.solve_smooth, (SmoothBody(size, (0.0, 0.0, 0.0), (a, b, c), True),)

    def descent_problem(self) -> Problem:
        """Gradient descent (paper, section 6)."""
        return descent.descent_ellipsoid, self.arguments()

    def shape_operator(self, point: np.ndarray, normal: np.ndarray) -> np.ndarray:
        """The surface's shape operator there [1/m], shape (3, 3)."""
        square = np.array((self.a, self.b, self.c)) ** 2
        return tangential(np.diag(1.0 / square), normal) / float(np.linalg.norm(point / square))


@dataclass(frozen=True)
class Cylinder(KernelSurface):
    """An infinite cylinder about z (paper, section 5.1.2)."""

    kernels = cylinder.solve_cylinder, wrench_axis.wrench_axis_cylinder

    radius: float
    """Radius [m]."""

    def shape_operator(self, point: np.ndarray, normal: np.ndarray) -> np.ndarray:
        """The surface's shape operator there [1/m], shape (3, 3)."""
        return around_axis(normal, 1.0 / self.radius)


@dataclass(frozen=True)
class Cone(KernelSurface):
    """An infinite cone about z, of radius `radius` - `taper` z, up to its apex."""

    kernels = cylinder.solve_cone, wrench_axis.wrench_axis_cone

    radius: float
    """Radius at z = 0 [m]."""
    taper: float
    """Tangent of the angle between its side and the axis; not zero."""

    def __post_init__(self) -> None:
        positive(self, radius=self.radius)
        if self.taper == 0.0 or not np.isfinite(self.taper):
            raise ValueError(f"Cone: taper must be finite and not zero, not {self.taper}; use Cylinder")

    def shape_operator(self, point: np.ndarray, normal: np.ndarray) -> np.ndarray:
        """The surface's shape operator there [1/m], shape (3, 3)."""
        rho = self.radius - self.taper * point[2]
        return around_axis(normal, 1.0 / (rho * float(np.sqrt(1.0 + self.taper**2))))


@dataclass(frozen=True)
class Plane(KernelSurface):
    """The plane normal . c = offset, with the body on the side opposite to the normal (paper, section
    5.1.3)."""

    kernels = plane.solve_plane, wrench_axis.wrench_axis_plane

    normal: tuple[float, float, float]
    """Outward normal, of any length but zero."""
    offset: float
    """Distance from the origin along the normal [m]."""

    def __post_init__(self) -> None:
        if np.shape(self.normal) != (3,) or not np.all(np.isfinite(self.normal)) or not np.any(self.normal):
            raise ValueError(f"Plane: normal must be three finite numbers, not all zero, not {self.normal}")
        if not np.isfinite(self.offset):
            raise ValueError(f"Plane: offset must be finite, not {self.offset}")

    def arguments(self) -> tuple[Any, ...]:
        """See `KernelSurface`."""
        direction = np.asarray(self.normal, dtype=float) / np.abs(self.normal).max()
        nx, ny, nz = (float(component) for component in direction / np.linalg.norm(direction))
        return (nx, ny, nz), float(self.offset)

    def shape_operator(self, point: np.ndarray, normal: np.ndarray) -> np.ndarray:
        """The surface's shape operator there [1/m], shape (3, 3)."""
        return np.zeros((3, 3))


@dataclass(frozen=True, eq=False)
class Placed(EqualByFields):
    """A surface at a given pose."""

    surface: Surface
    """The surface to place."""
    origin: np.ndarray
    """Origin of the surface's frame [m], shape (3,)."""
    rotation: np.ndarray
    """Axes of the surface's frame as columns, shape (3, 3): orthonormal and right-handed."""

    def __post_init__(self) -> None:
        origin, rotation = np.array(self.origin, dtype=float), np.array(self.rotation, dtype=float)
        if origin.shape != (3,) or not np.all(np.isfinite(origin)):
            raise ValueError(f"Placed: origin must be finite and of shape (3,), not {self.origin}")
        if rotation.shape != (3, 3) or not np.all(np.isfinite(rotation)):
            raise ValueError(f"Placed: rotation must be finite and of shape (3, 3), not {self.rotation}")
        skew = float(np.abs(rotation.T @ rotation - np.eye(3)).max())
        if skew > _SKEW or np.linalg.det(rotation) < 0.0:
            raise ValueError("Placed: rotation must be orthonormal and right-handed")
        object.__setattr__(self, "origin", origin)
        object.__setattr__(self, "rotation", rotation)

    def problem(self) -> Problem:
        """That of the surface, in its own frame."""
        return self.surface.problem()

    def line_problem(self) -> Problem:
        """That of the surface, in its own frame."""
        return self.surface.line_problem()

    def shape_operator(self, point: np.ndarray, normal: np.ndarray) -> np.ndarray:
        """The surface's shape operator there [1/m], shape (3, 3)."""
        local = self.rotation.T @ (point - self.origin)
        own = self.surface.shape_operator(local, self.rotation.T @ normal)
        return np.asarray(self.rotation @ own @ self.rotation.T)
