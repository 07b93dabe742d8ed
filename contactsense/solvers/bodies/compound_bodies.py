"""Convex bodies composed of parts, solved by `contactsense.solvers.closed_form.compound`."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Self

import numpy as np

from contactsense.solvers.bodies.paper_surfaces import Cone, Cylinder, Ellipsoid, Placed, Plane, Sphere
from contactsense.solvers.bodies.surface import KernelSurface, positive
from contactsense.solvers.closed_form import compound
from contactsense.solvers.solution import PATCH_TOLERANCE

Simple = Sphere | Ellipsoid | Cylinder | Cone | Plane | Placed
"""A surface with a closed form, or one of these placed."""


@dataclass(frozen=True)
class Part:
    """Part of a surface that is bounded by other surfaces."""

    surface: Simple
    """The complete surface."""
    behind: tuple[Simple, ...]
    """The surfaces at which the part ends; it lies on the body's side of all of them."""


class Compound(KernelSurface):
    """A convex body whose surface is composed of parts (paper, section 7), with or without edges."""

    kernels = compound.solve_compound, compound.wrench_axis_compound

    def __init__(self, parts: Sequence[Part], reach: float) -> None:
        """Compose a body.

        Args:
            parts: Parts that bound a convex body, each with its outward normal, and together leave no gap.
                This is not checked.
            reach: Size of the body [m]; due to rounding, a contact may lie 1e-9 of it outside its part.

        Raises:
            ValueError: There is no part, a surface has no closed form, or `reach` is not positive.
            TypeError: What is given is no part.
        """
        positive(self, reach=reach)
        self.parts = tuple(parts)
        if not self.parts:
            raise ValueError("Compound: parts must not be empty")
        for part in self.parts:
            if not isinstance(part, Part):
                raise TypeError(f"Compound: expected parts such as Part(Sphere(0.01), ()), got {part!r:.60}")
        self.reach = float(reach)
        surfaces: list[Simple] = [part.surface for part in self.parts]
        border = np.full((len(self.parts), max(1, *(len(part.behind) for part in self.parts))), -1)
        for row, part in enumerate(self.parts):
            for column, other in enumerate(part.behind):
                border[row, column] = len(surfaces)
                surfaces.append(other)
        packed = [_packed(surface) for surface in surfaces]
        self._packed = compound.Parts(
            kind=np.array([kind for kind, _, _, _ in packed]),
            size=np.array([size for _, size, _, _ in packed]),
            rotation=np.array([rotation for _, _, rotation, _ in packed]),
            origin=np.array([origin for _, _, _, origin in packed]),
            border=border,
            reach=self.reach,
        )

    @classmethod
    def common(cls, surfaces: Sequence[Simple], reach: float) -> Self:
        """Intersection of convex bodies, with edges where their surfaces meet.

        Args:
            surfaces: Surfaces of the bodies.
            reach: Size of the body [m].
        """
        parts = [
            Part(surface, tuple(other for other in surfaces if other is not surface)) for surface in surfaces
        ]
        return cls(parts, reach)

    def arguments(self) -> tuple[Any, ...]:
        """See `KernelSurface`."""
        return (self._packed,)

    def shape_operator(self, point: np.ndarray, normal: np.ndarray) -> np.ndarray:
        """The surface's shape operator there [1/m], shape (3, 3): that of the part that contains the
        point, at an edge of the one with this normal."""
        x, y, z = (float(component) for component in point)
        distances = []
        for row in range(len(self.parts)):
            ends = [row, *(k for k in self._packed.border[row] if k >= 0)]
            outside = [compound.outside_distance(self._packed, k, (x, y, z)) for k in ends]
            distances.append(max(abs(outside[0]), *outside[1:]) if len(outside) > 1 else abs(outside[0]))
        seam = min(distances) + PATCH_TOLERANCE * self.reach
        near = [part.surface for part, away in zip(self.parts, distances, strict=True) if away <= seam]
        there = max(near, key=lambda surface: float(_normal(surface, point) @ normal))
        return there.shape_operator(point, normal)


_KINDS = {
    Plane: compound.PLANE, Sphere: compound.ELLIPSOID, Ellipsoid: compound.ELLIPSOID,
    Cylinder: compound.CYLINDER, Cone: compound.CONE,
}  # fmt: skip


def _normal(surface: Simple, point: np.ndarray) -> np.ndarray:
    """Outward unit normal of a surface at one of its points, shapes (3,)."""
    if isinstance(surface, Placed):
        local = surface.rotation.T @ (point - surface.origin)
        return np.asarray(surface.rotation @ _normal(surface.surface, local))  # type: ignore[arg-type]
    if isinstance(surface, Plane):
        return np.array(surface.arguments()[0])
    if isinstance(surface, Sphere | Ellipsoid):
        found = point / np.square(surface.line_problem()[1])
    else:
        rise = surface.taper * np.hypot(point[0], point[1]) if isinstance(surface, Cone) else 0.0
        found = np.array((point[0], point[1], rise))
    length = float(np.linalg.norm(found))
    return np.asarray(found / length if length > 0.0 else found)


def _packed(surface: Simple) -> tuple[int, np.ndarray, np.ndarray, np.ndarray]:
    """Kind, size, axes and origin of a surface."""
    if isinstance(surface, Placed):
        kind, size, rotation, origin = _packed(surface.surface)  # type: ignore[arg-type]
        return kind, size, surface.rotation @ rotation, surface.origin + surface.rotation @ origin
    if type(surface) not in _KINDS:
        raise ValueError(f"Compound: {type(surface).__name__} has no closed form of one surface")
    # As for the wrench axis, for which a sphere is an ellipsoid.
    numbers = np.hstack(surface.line_problem()[1])
    return _KINDS[type(surface)], np.pad(numbers, (0, 4 - len(numbers))), np.eye(3), np.zeros(3)
