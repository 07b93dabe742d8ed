"""The surfaces that can be touched, in plain words: each knows the kernel that solves it.

Every surface is described in a frame of its own; `Placed` puts one elsewhere.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np

from contactsense.solvers import box, capsule, cylinder, ellipsoid, plane, revolved, wrench_axis
from contactsense.solvers.answer import Answer
from robots.primitives import Primitive
from robots.surface import ELLIPSOID, REVOLVED, body

Kernel = Callable[..., Answer]
Problem = tuple[Kernel, tuple[Any, ...]]
"""A compiled solver and what it takes after the wrench."""


class Surface(Protocol):
    """Anything that can be solved: a surface with an outward normal, bounding a convex body."""

    def problem(self) -> Problem:
        """The kernel of the exact solution, and the surface's size as that takes it."""
        ...

    def line_problem(self) -> Problem:
        """The same for the wrench axis alone."""
        ...


def _positive(surface: object, **lengths: float) -> None:
    for name, value in lengths.items():
        if not 0.0 < value < np.inf:
            raise ValueError(f"{type(surface).__name__}: {name} must be positive and finite, not {value}")


def _not_negative(surface: object, **lengths: float) -> None:
    for name, value in lengths.items():
        if not 0.0 <= value < np.inf:
            raise ValueError(f"{type(surface).__name__}: {name} must not be negative, not {value}")


@dataclass(frozen=True)
class Sphere:
    """A sphere about the origin (paper, section 5.1.1)."""

    radius: float
    """Radius [m]."""

    def __post_init__(self) -> None:
        _positive(self, radius=self.radius)

    def problem(self) -> Problem:
        """Closed form."""
        return ellipsoid.solve_sphere, (float(self.radius),)

    def line_problem(self) -> Problem:
        """Its wrench axis."""
        return wrench_axis.wrench_axis_sphere, self.problem()[1]


@dataclass(frozen=True)
class Ellipsoid:
    """An ellipsoid about the origin, its axes along those of the frame (paper, section 5)."""

    a: float
    """Semi-axis along x [m]."""
    b: float
    """Semi-axis along y [m]."""
    c: float
    """Semi-axis along z [m]."""

    def __post_init__(self) -> None:
        _positive(self, a=self.a, b=self.b, c=self.c)

    def problem(self) -> Problem:
        """Closed form."""
        return ellipsoid.solve_ellipsoid, (float(self.a), float(self.b), float(self.c))

    def line_problem(self) -> Problem:
        """Its wrench axis."""
        return wrench_axis.wrench_axis_ellipsoid, self.problem()[1]


@dataclass(frozen=True)
class Cylinder:
    """An infinite cylinder about z (paper, section 5.1.2)."""

    radius: float
    """Radius [m]."""

    def __post_init__(self) -> None:
        _positive(self, radius=self.radius)

    def problem(self) -> Problem:
        """Closed form."""
        return cylinder.solve_cylinder, (float(self.radius),)

    def line_problem(self) -> Problem:
        """Its wrench axis."""
        return wrench_axis.wrench_axis_cylinder, self.problem()[1]


@dataclass(frozen=True)
class Cone:
    """An endless cone about z, of radius `radius` - `taper` z, up to its apex."""

    radius: float
    """Radius at z = 0 [m]."""
    taper: float
    """Tangent of the angle between its side and the axis; not zero."""

    def __post_init__(self) -> None:
        _positive(self, radius=self.radius)
        if self.taper == 0.0 or not np.isfinite(self.taper):
            raise ValueError(f"Cone: taper must be finite and not zero, not {self.taper}; use Cylinder")

    def problem(self) -> Problem:
        """Closed form."""
        return cylinder.solve_cone, (float(self.radius), float(self.taper))

    def line_problem(self) -> Problem:
        """Its wrench axis."""
        return wrench_axis.wrench_axis_cone, self.problem()[1]


@dataclass(frozen=True)
class Plane:
    """The plane normal . c = offset, with the body behind it (paper, section 5.1.3)."""

    normal: tuple[float, float, float]
    """Outward normal, of any length but zero."""
    offset: float
    """Distance from the origin along the normal [m]."""

    def problem(self) -> Problem:
        """Closed form."""
        size = float(np.linalg.norm(self.normal))
        if not 0.0 < size < np.inf:
            raise ValueError(f"Plane: normal must not be zero, not {self.normal}")
        nx, ny, nz = (float(component) / size for component in self.normal)
        return plane.solve_plane, (nx, ny, nz, float(self.offset))

    def line_problem(self) -> Problem:
        """Its wrench axis."""
        return wrench_axis.wrench_axis_plane, self.problem()[1]


@dataclass(frozen=True)
class Capsule:
    """All points within `radius` of the segment from (0, 0, -half) to (0, 0, half)."""

    half: float
    """Half the length of the segment [m]."""
    radius: float
    """Radius [m]."""

    def __post_init__(self) -> None:
        _positive(self, half=self.half, radius=self.radius)

    def problem(self) -> Problem:
        """Closed forms of its patches."""
        return capsule.solve_capsule, (float(self.half), float(self.radius))

    def line_problem(self) -> Problem:
        """Its wrench axis."""
        return wrench_axis.wrench_axis_capsule, self.problem()[1]


@dataclass(frozen=True)
class TaperedCapsule:
    """The convex hull of two balls about (0, 0, -half) and (0, 0, half)."""

    half: float
    """Half the distance of the centres [m]."""
    radius_a: float
    """Radius of the lower ball [m]."""
    radius_b: float
    """Radius of the upper ball [m]."""

    def __post_init__(self) -> None:
        _positive(self, half=self.half, radius_a=self.radius_a, radius_b=self.radius_b)
        if abs(self.radius_a - self.radius_b) >= 2.0 * self.half:
            raise ValueError("TaperedCapsule: one ball holds the other; use Sphere")

    def problem(self) -> Problem:
        """Closed forms of its patches."""
        return capsule.solve_tapered_capsule, (float(self.half), float(self.radius_a), float(self.radius_b))

    def line_problem(self) -> Problem:
        """Its wrench axis."""
        return wrench_axis.wrench_axis_tapered_capsule, self.problem()[1]


@dataclass(frozen=True)
class Revolved:
    """A truncated cone about z with flat caps, plus a ball: disc, cylinder and cone with rounded rims."""

    half: float
    """Half the height of the cone, without the ball [m]; may be zero."""
    lower: float
    """Radius of the cone at -half [m]; may be zero."""
    upper: float
    """Radius of the cone at half [m]; may be zero."""
    rounding: float
    """Radius of the ball [m]."""

    def __post_init__(self) -> None:
        _positive(self, rounding=self.rounding)
        _not_negative(self, half=self.half, lower=self.lower, upper=self.upper)

    def problem(self) -> Problem:
        """Closed forms of caps and side; rims by Newton's method."""
        size = (float(self.half), float(self.lower), float(self.upper), float(self.rounding))
        return revolved.solve_revolved, size

    def line_problem(self) -> Problem:
        """Its wrench axis."""
        return wrench_axis.wrench_axis_revolved, self.problem()[1]


@dataclass(frozen=True)
class Box:
    """A box about the origin, plus a ball."""

    bx: float
    """Half its length along x, without the ball [m]; may be zero, as may the others."""
    by: float
    """Half its length along y [m]."""
    bz: float
    """Half its length along z [m]."""
    rounding: float
    """Radius of the ball [m]; zero for a sharp box."""

    def __post_init__(self) -> None:
        _not_negative(self, bx=self.bx, by=self.by, bz=self.bz, rounding=self.rounding)

    def problem(self) -> Problem:
        """Closed forms of its patches."""
        return box.solve_box, (float(self.bx), float(self.by), float(self.bz), float(self.rounding))

    def line_problem(self) -> Problem:
        """Its wrench axis."""
        return wrench_axis.wrench_axis_box, self.problem()[1]


@dataclass(frozen=True)
class Placed:
    """A surface whose own frame stands somewhere else."""

    surface: Surface
    """What is placed."""
    origin: np.ndarray
    """Origin of the surface's frame [m], shape (3,)."""
    rotation: np.ndarray
    """Axes of the surface's frame as columns, shape (3, 3)."""

    def problem(self) -> Problem:
        """That of the surface, in its own frame."""
        return self.surface.problem()

    def line_problem(self) -> Problem:
        """That of the surface, in its own frame."""
        return self.surface.line_problem()


def place(primitive: Primitive) -> Placed:
    """A primitive of a robot as a surface in its link's frame."""
    kind, rotation, origin, size = body(primitive)
    surface: Surface
    if kind == ELLIPSOID:
        surface = Ellipsoid(*size)
    elif kind == REVOLVED:
        surface = Revolved(*size) if max(size[:3]) > 0.0 else Sphere(size[3])
    else:
        surface = Box(*size)
    return Placed(surface, origin, rotation)
