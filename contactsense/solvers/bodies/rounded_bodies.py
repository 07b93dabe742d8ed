"""Rounded convex bodies composed of patches: each selects the kernel that solves it."""

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from contactsense.robots.primitives import Primitive
from contactsense.robots.surface.convex_primitives import BOX, ELLIPSOID, REVOLVED, body
from contactsense.solvers.bodies.paper_surfaces import Ellipsoid, Placed, Sphere
from contactsense.solvers.bodies.surface import (
    KernelSurface,
    Surface,
    around_axis,
    not_negative,
    packed_shape,
    positive,
    tangential,
)
from contactsense.solvers.closed_form import box, capsule, fingertip, polytope, revolved, wrench_axis
from contactsense.solvers.closed_form.polytope import Hull, hull_of


@dataclass(frozen=True)
class Capsule(KernelSurface):
    """All points within `radius` of the segment from (0, 0, -half) to (0, 0, half)."""

    kernels = capsule.solve_tapered_capsule, wrench_axis.wrench_axis_tapered_capsule

    half: float
    """Half the length of the segment [m]."""
    radius: float
    """Radius [m]."""

    def arguments(self) -> tuple[Any, ...]:
        """See `KernelSurface`."""
        return float(self.half), float(self.radius), float(self.radius)

    def shape_operator(self, point: np.ndarray, normal: np.ndarray) -> np.ndarray:
        """The surface's shape operator there [1/m], shape (3, 3)."""
        return packed_shape(REVOLVED, (self.half, 0.0, 0.0, self.radius), point, normal)


@dataclass(frozen=True)
class TaperedCapsule(KernelSurface):
    """The convex hull of two balls about (0, 0, -half) and (0, 0, half)."""

    kernels = capsule.solve_tapered_capsule, wrench_axis.wrench_axis_tapered_capsule

    half: float
    """Half the distance between the centres [m]."""
    radius_a: float
    """Radius of the lower ball [m]."""
    radius_b: float
    """Radius of the upper ball [m]."""

    def __post_init__(self) -> None:
        positive(self, half=self.half, radius_a=self.radius_a, radius_b=self.radius_b)
        if abs(self.radius_a - self.radius_b) >= 2.0 * self.half:
            raise ValueError("TaperedCapsule: one ball holds the other; use Sphere")

    def shape_operator(self, point: np.ndarray, normal: np.ndarray) -> np.ndarray:
        """The surface's shape operator there [1/m], shape (3, 3)."""
        sin_beta = (self.radius_a - self.radius_b) / (2.0 * self.half)
        if abs(normal[2] - sin_beta) < 1e-9:
            rho = float(np.hypot(point[0], point[1]))
            return around_axis(normal, float(np.sqrt(1.0 - sin_beta**2)) / rho)
        return tangential(np.eye(3) / (self.radius_b if normal[2] > sin_beta else self.radius_a), normal)


@dataclass(frozen=True)
class Revolved(KernelSurface):
    """A truncated cone about z with flat caps, plus a ball: disc, cylinder and cone with rounded rims."""

    kernels = revolved.solve_revolved, wrench_axis.wrench_axis_revolved

    half: float
    """Half the height of the cone, without the ball [m]; may be zero."""
    lower: float
    """Radius of the cone at -half [m]; may be zero."""
    upper: float
    """Radius of the cone at half [m]; may be zero."""
    rounding: float
    """Radius of the ball [m]."""

    def __post_init__(self) -> None:
        positive(self, rounding=self.rounding)
        not_negative(self, half=self.half, lower=self.lower, upper=self.upper)

    def shape_operator(self, point: np.ndarray, normal: np.ndarray) -> np.ndarray:
        """The surface's shape operator there [1/m], shape (3, 3)."""
        return packed_shape(REVOLVED, self.arguments(), point, normal)


@dataclass(frozen=True)
class Box(KernelSurface):
    """A box about the origin, plus a ball."""

    kernels = box.solve_box, wrench_axis.wrench_axis_box

    bx: float
    """Half its length along x, without the ball [m]; may be zero, as may the others."""
    by: float
    """Half its length along y [m]."""
    bz: float
    """Half its length along z [m]."""
    rounding: float
    """Radius of the ball [m]; zero for a sharp box."""

    def __post_init__(self) -> None:
        not_negative(self, bx=self.bx, by=self.by, bz=self.bz, rounding=self.rounding)

    def arguments(self) -> tuple[Any, ...]:
        """See `KernelSurface`."""
        return (float(self.bx), float(self.by), float(self.bz)), float(self.rounding)

    def shape_operator(self, point: np.ndarray, normal: np.ndarray) -> np.ndarray:
        """The surface's shape operator there [1/m], shape (3, 3)."""
        return packed_shape(BOX, (self.bx, self.by, self.bz, self.rounding), point, normal)


@dataclass(frozen=True)
class Fingertip(KernelSurface):
    """A hemisphere about the origin on a cylinder of the same radius, open below (paper, figure 5)."""

    kernels = fingertip.solve_fingertip, fingertip.wrench_axis_fingertip

    radius: float
    """Radius [m]."""

    def shape_operator(self, point: np.ndarray, normal: np.ndarray) -> np.ndarray:
        """The surface's shape operator there [1/m], shape (3, 3)."""
        if point[2] <= 0.0:
            return around_axis(normal, 1.0 / self.radius)
        return tangential(np.eye(3) / self.radius, normal)


class Polytope(KernelSurface):
    """The convex hull of points, plus a ball: a mesh's hull with rounded edges and corners."""

    kernels = polytope.solve_polytope, polytope.wrench_axis_polytope

    def __init__(self, points: ArrayLike, rounding: float) -> None:
        """Compute the hull.

        Args:
            points: Points whose convex hull is used [m], shape (N, 3), not all in one plane.
            rounding: Radius of the ball [m]; zero for a sharp polytope.

        Raises:
            ValueError: The points have another shape, are not finite, or span no volume; or `rounding` is
                negative.
            TypeError: `rounding` is no number.
        """
        not_negative(self, rounding=rounding)
        self.hull: Hull = hull_of(points)
        self.rounding = float(rounding)

    def arguments(self) -> tuple[Any, ...]:
        """See `KernelSurface`."""
        return self.hull, self.rounding

    def shape_operator(self, point: np.ndarray, normal: np.ndarray) -> np.ndarray:
        """The surface's shape operator there [1/m], shape (3, 3)."""
        if self.rounding == 0.0:
            return np.zeros((3, 3))
        core = (point - self.rounding * normal) / self.hull.unit - self.hull.middle
        touching = self.hull.normal[
            np.abs(self.hull.normal @ core - self.hull.offset) < 1e-9 * self.hull.reach
        ]
        if len(touching) < 2:
            return np.zeros((3, 3))
        bend = tangential(np.eye(3) / self.rounding, normal)
        if len(touching) == 2:
            along = np.cross(touching[0], touching[1])
            along /= np.linalg.norm(along)
            bend -= np.outer(along, along) / self.rounding
        return bend


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
