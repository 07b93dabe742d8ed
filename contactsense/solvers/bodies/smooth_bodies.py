"""Smooth convex bodies other than the ellipsoid, most of them solved by Newton's method."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from contactsense.solvers.bodies.surface import KernelSurface, Problem, level_shape, positive
from contactsense.solvers.closed_form import paraboloid
from contactsense.solvers.general_convex import general
from contactsense.solvers.general_convex import implicit_surfaces as implicit
from contactsense.solvers.general_convex.level_set import SmoothBody


@dataclass(frozen=True)
class Superquadric(KernelSurface):
    """((|x|/a)^p + (|y|/b)^p)^(q/p) + (|z|/c)^q = 1: from ellipsoid (p = q = 2) towards box."""

    kernels = general.solve_smooth, general.wrench_axis_smooth

    a: float
    """Semi-axis along x [m]."""
    b: float
    """Semi-axis along y [m]."""
    c: float
    """Semi-axis along z [m]."""
    p: float = 4.0
    """Exponent perpendicular to z, at least 2."""
    q: float = 4.0
    """Exponent along z, at least 2."""

    def __post_init__(self) -> None:
        positive(self, a=self.a, b=self.b, c=self.c)
        if not (2.0 <= self.p < np.inf and 2.0 <= self.q < np.inf):
            raise ValueError(f"Superquadric: exponents must be at least 2, not {self.p} and {self.q}")

    def arguments(self) -> tuple[Any, ...]:
        """See `KernelSurface`."""
        axes = (float(self.a), float(self.b), float(self.c))
        size = (implicit.SUPERQUADRIC, *(1.0 / axis for axis in axes), float(self.p), float(self.q))
        return (SmoothBody(size, (0.0, 0.0, 0.0), axes, True),)

    def newton_problem(self) -> Problem:
        """The same: there is no closed form."""
        return self.problem()

    def shape_operator(self, point: np.ndarray, normal: np.ndarray) -> np.ndarray:
        """The surface's shape operator there [1/m], shape (3, 3)."""
        return level_shape(implicit.evaluate(self.arguments()[0].size, *point), normal)


@dataclass(frozen=True)
class Paraboloid(KernelSurface):
    """z = -(k1 x^2 + k2 y^2) / 2, the body below."""

    kernels = paraboloid.solve_paraboloid, paraboloid.wrench_axis_paraboloid

    k1: float
    """Curvature along x at the top [1/m]."""
    k2: float
    """Curvature along y at the top [1/m]."""
    depth: float
    """Approximate depth below the top up to which it is touched [m]; only used by Newton's method."""

    def arguments(self) -> tuple[Any, ...]:
        """See `KernelSurface`."""
        return float(self.k1), float(self.k2)

    def newton_problem(self) -> Problem:
        """Newton's method, as for any smooth convex body."""
        size = (implicit.PARABOLOID, float(self.k1), float(self.k2), 0.0, 0.0, 0.0)
        half = 0.5 * float(self.depth)
        extent = (float(np.sqrt(self.depth / self.k1)), float(np.sqrt(self.depth / self.k2)), half)
        return general.solve_smooth, (SmoothBody(size, (0.0, 0.0, -half), extent, False),)

    def shape_operator(self, point: np.ndarray, normal: np.ndarray) -> np.ndarray:
        """The surface's shape operator there [1/m], shape (3, 3)."""
        return level_shape(implicit.evaluate(self.newton_problem()[1][0].size, *point), normal)


@dataclass(frozen=True)
class Convex:
    """Any smooth convex body, given by a function that is zero on its surface and negative inside.

    The function is compiled with numba and takes (size, x, y, z); it returns value, gradient (x, y, z) and
    Hessian (xx, yy, zz, xy, xz, yz), ten floats. It should be convex, not only the body.
    """

    function: Callable[..., Any]
    """The compiled function."""
    size: tuple[float, ...]
    """Its arguments before the point."""
    extent: tuple[float, float, float]
    """Approximate half size of the body along each axis [m]."""
    inner: tuple[float, float, float] = (0.0, 0.0, 0.0)
    """A point well inside [m]."""

    def __post_init__(self) -> None:
        if not self.function(self.size, *self.inner)[0] < 0.0:
            raise ValueError(f"Convex: the function is not negative at the inner point {self.inner}")

    def problem(self) -> Problem:
        """Newton's method."""
        (x, y, z), (a, b, c) = self.inner, self.extent
        inner, extent = (float(x), float(y), float(z)), (float(a), float(b), float(c))
        return general.solvers_for(self.function)[0], (SmoothBody(self.size, inner, extent, False),)

    def newton_problem(self) -> Problem:
        """The same: there is no closed form."""
        return self.problem()

    def line_problem(self) -> Problem:
        """Its wrench axis."""
        return general.solvers_for(self.function)[1], self.problem()[1]

    def shape_operator(self, point: np.ndarray, normal: np.ndarray) -> np.ndarray:
        """The surface's shape operator there [1/m], shape (3, 3)."""
        return level_shape(self.function(self.size, *point), normal)
