"""Rounded convex bodies composed of patches: each selects the kernel that solves it."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from contactsense.robots.primitives import Primitive
from contactsense.robots.surface.convex_primitives import BOX, ELLIPSOID, REVOLVED, body
from contactsense.solvers import box, capsule, fingertip, polytope, revolved, wrench_axis
from contactsense.solvers.paper_surfaces import Ellipsoid, Placed, Sphere
from contactsense.solvers.polytope import Hull, hull_of
from contactsense.solvers.surface import (
    Problem,
    Surface,
    around_axis,
    not_negative,
    packed_shape,
    positive,
    tangential,
)


@dataclass(frozen=True)
class Capsule:
    """All points within `radius` of the segment from (0, 0, -half) to (0, 0, half)."""

    half: float
    """Half the length of the segment [m]."""
    radius: float
    """Radius [m]."""

    def __post_init__(self) -> None:
        positive(self, half=self.half, radius=self.radius)

    def problem(self) -> Problem:
        """Closed forms of its patches."""
        return capsule.solve_capsule, (float(self.half), float(self.radius))

    def line_problem(self) -> Problem:
        """Its wrench axis."""
        return wrench_axis.wrench_axis_capsule, self.problem()[1]

    def shape_operator(self, point: np.ndarray, normal: np.ndarray) -> np.ndarray:
        """The surface's shape operator there [1/m], shape (3, 3)."""
        return packed_shape(REVOLVED, (self.half, 0.0, 0.0, self.radius), point, normal)


@dataclass(frozen=True)
class TaperedCapsule:
    """The convex hull of two balls about (0, 0, -half) and (0, 0, half)."""

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

    def problem(self) -> Problem:
        """Closed forms of its patches."""
        return capsule.solve_tapered_capsule, (float(self.half), float(self.radius_a), float(self.radius_b))

    def line_problem(self) -> Problem:
        """Its wrench axis."""
        return wrench_axis.wrench_axis_tapered_capsule, self.problem()[1]

    def shape_operator(self, point: np.ndarray, normal: np.ndarray) -> np.ndarray:
        """The surface's shape operator there [1/m], shape (3, 3)."""
        sin_beta = (self.radius_a - self.radius_b) / (2.0 * self.half)
        if abs(normal[2] - sin_beta) < 1e-9:
            rho = float(np.hypot(point[0], point[1]))
            return around_axis(normal, float(np.sqrt(1.0 - sin_beta**2)) / rho)
        return tangential(np.eye(3) / (self.radius_b if normal[2] > sin_beta else self.radius_a), normal)


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
        positive(self, rounding=self.rounding)
        not_negative(self, half=self.half, lower=self.lower, upper=self.upper)

    def problem(self) -> Problem:
        """Closed forms of caps and side; rims by Newton's method."""
        size = (float(self.half), float(self.lower), float(self.upper), float(self.rounding))
        return revolved.solve_revolved, size

    def line_problem(self) -> Problem:
        """Its wrench axis."""
        return wrench_axis.wrench_axis_revolved, self.problem()[1]

    def shape_operator(self, point: np.ndarray, normal: np.ndarray) -> np.ndarray:
        """The surface's shape operator there [1/m], shape (3, 3)."""
        size = (self.half, self.lower, self.upper, self.rounding)
        return packed_shape(REVOLVED, size, point, normal)


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
        not_negative(self, bx=self.bx, by=self.by, bz=self.bz, rounding=self.rounding)

    def problem(self) -> Problem:
        """Closed forms of its patches."""
        return box.solve_box, ((float(self.bx), float(self.by), float(self.bz)), float(self.rounding))

    def line_problem(self) -> Problem:
        """Its wrench axis."""
        return wrench_axis.wrench_axis_box, self.problem()[1]

    def shape_operator(self, point: np.ndarray, normal: np.ndarray) -> np.ndarray:
        """The surface's shape operator there [1/m], shape (3, 3)."""
        return packed_shape(BOX, (self.bx, self.by, self.bz, self.rounding), point, normal)


@dataclass(frozen=True)
class Fingertip:
    """A hemisphere about the origin on a cylinder of the same radius, open below (paper, figure 5)."""

    radius: float
    """Radius [m]."""

    def __post_init__(self) -> None:
        positive(self, radius=self.radius)

    def problem(self) -> Problem:
        """Closed forms of both patches."""
        return fingertip.solve_fingertip, (float(self.radius),)

    def line_problem(self) -> Problem:
        """Its wrench axis."""
        return fingertip.wrench_axis_fingertip, self.problem()[1]

    def shape_operator(self, point: np.ndarray, normal: np.ndarray) -> np.ndarray:
        """The surface's shape operator there [1/m], shape (3, 3)."""
        if point[2] <= 0.0:
            return around_axis(normal, 1.0 / self.radius)
        return tangential(np.eye(3) / self.radius, normal)


class Polytope:
    """The convex hull of points, plus a ball: a mesh's hull with rounded edges and corners."""

    def __init__(self, points: ArrayLike, rounding: float) -> None:
        """Compute the hull.

        Args:
            points: Points whose convex hull is used [m], shape (N, 3).
            rounding: Radius of the ball [m]; zero for a sharp polytope.
        """
        not_negative(self, rounding=rounding)
        self.hull: Hull = hull_of(points)
        self.rounding = float(rounding)

    def problem(self) -> Problem:
        """Closed forms of its patches."""
        return polytope.solve_polytope, (self.hull, self.rounding)

    def line_problem(self) -> Problem:
        """Its wrench axis."""
        return polytope.wrench_axis_polytope, self.problem()[1]

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
