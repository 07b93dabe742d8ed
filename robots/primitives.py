"""Convex primitives that make up the surface of a link.

Each primitive is a plain, frozen description in its link's frame (metres), as in a robot's YAML file. All are
convex, and their edges are rounded: the surface has a normal everywhere except on seams of measure zero, as
the contact solvers require. `contactsense.robots.surface.convex_primitives` holds the compiled geometry of
the same shapes.
"""

from math import dist, sqrt
from typing import Annotated, Any, Literal

from pydantic import (
    AfterValidator,
    Field,
    SerializerFunctionWrapHandler,
    model_serializer,
    model_validator,
)

from contactsense.robots.files.file_model import FileModel
from contactsense.robots.units import within_one_turn

Vector = tuple[float, float, float]
LEAST_SIZE = 1e-9
"""Smallest size of a primitive [m]: squares of tiny numbers are zero in floating point."""
_Length = Annotated[float, Field(ge=LEAST_SIZE)]
_Lengths = tuple[_Length, _Length, _Length]


class _Shape(FileModel):
    """What all primitives have."""

    kind: str

    @model_serializer(mode="wrap")
    def _with_kind(self, handler: SerializerFunctionWrapHandler) -> dict[str, Any]:
        # Without it, a file from which defaults are left out could not be read.
        return {"kind": self.kind, **handler(self)}


class Sphere(_Shape):
    """A ball."""

    kind: Literal["sphere"] = "sphere"
    center: Vector
    """Centre, link frame [m]."""
    radius: _Length
    """Radius [m]."""


class Capsule(_Shape):
    """All points within `radius` of the segment from `a` to `b`."""

    kind: Literal["capsule"] = "capsule"
    a: Vector
    """One end of the core segment, link frame [m]."""
    b: Vector
    """Other end of the core segment, link frame [m]."""
    radius: _Length
    """Radius [m]."""

    @model_validator(mode="after")
    def _has_length(self) -> "Capsule":
        if dist(self.a, self.b) < LEAST_SIZE:
            raise ValueError("a and b are the same point; use kind: sphere")
        return self


class Cylinder(_Shape):
    """A cylinder or truncated cone with flat caps and rounded rims.

    The caps lie in the planes through `a` and `b`, perpendicular to the axis a-b. `radius_a` and `radius_b`
    are those of the unrounded cone at its caps; the rims are rounded off inside it. Formally: the truncated
    cone, shrunk by `rounding` on every side, plus a ball of radius `rounding`.
    """

    kind: Literal["cylinder"] = "cylinder"
    a: Vector
    """Centre of one cap, link frame [m]."""
    b: Vector
    """Centre of the other cap, link frame [m]."""
    radius_a: _Length
    """Radius of the sharp cone at cap a [m]."""
    radius_b: _Length
    """Radius of the sharp cone at cap b [m]."""
    rounding: _Length
    """Radius of the rims [m]; at most what fits into the cone."""

    def core(self) -> tuple[float, float, float]:
        """Half length and both radii of the cone after shrinking it by `rounding` on every side [m]."""
        half, radius_a, radius_b = self._shrunk()
        return max(half, 0.0), max(radius_a, 0.0), max(radius_b, 0.0)

    def _shrunk(self) -> tuple[float, float, float]:
        length = dist(self.a, self.b)
        slope = (self.radius_b - self.radius_a) / length
        off = self.rounding * sqrt(1.0 + slope * slope)
        return (
            length / 2.0 - self.rounding,
            self.radius_a + slope * self.rounding - off,
            self.radius_b - slope * self.rounding - off,
        )

    @model_validator(mode="after")
    def _fits(self) -> "Cylinder":
        if dist(self.a, self.b) < LEAST_SIZE:
            raise ValueError("a and b are the same point: a cylinder needs a length")
        if min(self._shrunk()) < -1e-9:
            raise ValueError(
                f"rounding {self.rounding} does not fit into the cone; at least one side vanishes"
            )
        return self


class Ellipsoid(_Shape):
    """An ellipsoid with semi-axes `radii` along its own axes."""

    kind: Literal["ellipsoid"] = "ellipsoid"
    center: Vector
    """Centre, link frame [m]."""
    rpy: Annotated[Vector, AfterValidator(within_one_turn)] = (0.0, 0.0, 0.0)
    """Orientation in the link frame: roll, pitch, yaw about fixed x, y, z [rad]."""
    radii: _Lengths
    """Semi-axes [m]."""


class Box(_Shape):
    """A box with rounded edges and corners."""

    kind: Literal["box"] = "box"
    center: Vector
    """Centre, link frame [m]."""
    rpy: Annotated[Vector, AfterValidator(within_one_turn)] = (0.0, 0.0, 0.0)
    """Orientation in the link frame: roll, pitch, yaw about fixed x, y, z [rad]."""
    half: _Lengths
    """Half edge lengths, rounding included [m]."""
    rounding: _Length
    """Radius of edges and corners [m]; at most the smallest of `half`."""

    @model_validator(mode="after")
    def _fits(self) -> "Box":
        if self.rounding > min(self.half):
            raise ValueError(f"rounding {self.rounding} is larger than the smallest of half {self.half}")
        return self


Primitive = Annotated[Sphere | Capsule | Cylinder | Ellipsoid | Box, Field(discriminator="kind")]
