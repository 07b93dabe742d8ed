"""Bodies of the cell that do not move with the joints: pedestals, tables, fences, in the base frame."""

from collections.abc import Iterable
from typing import Annotated, Literal

import numpy as np
from pydantic import ConfigDict, Field

from contactsense.robots.files.file_model import FileModel
from contactsense.robots.primitives import Primitive, Vector
from contactsense.robots.robot import NO_MASS, Link
from contactsense.robots.rotations import rotation_from_rpy
from contactsense.robots.surface.convex_primitives import Surfaces, pack
from contactsense.robots.surface.deviation_table import DeviationTable

Role = Literal["obstacle", "cover", "pedestal"]


class Body(FileModel):
    """A rigid body of the cell, fixed in the base frame.

    Raises:
        FieldError: A field is wrong; the message names it, what was expected and what was given.
    """

    model_config = ConfigDict(use_attribute_docstrings=True)

    name: Annotated[str, Field(min_length=1)]
    """Name in estimates."""
    role: Role = "obstacle"
    """`obstacle`: the arm may run into it, and a contact within its reach is named after it. `cover`: the arm
    stands in or against it; a place without free height below it (`clearance`) cannot be touched. `pedestal`:
    it stands on the base sensor and carries the arm; it covers the base link and can itself be touched, which
    loads the base sensor alone. Its weight belongs to that sensor's `bias`."""
    translation: Vector = (0.0, 0.0, 0.0)
    """Origin of the body's frame in the base frame [m]."""
    rpy: Vector = (0.0, 0.0, 0.0)
    """Orientation of the body's frame in the base frame: roll, pitch, yaw about fixed x, y, z [rad]."""
    tolerance: Annotated[float, Field(gt=0.0, le=1.0)] = 0.01
    """Largest distance between an obstacle and the touching arm that errors of both places explain [m]."""
    primitives: Annotated[tuple[Primitive, ...], Field(min_length=1)]
    """Shape as a union of primitives, body's frame; docs/geometry.md lists the kinds [m]."""
    deviation: DeviationTable = ""
    """How far a pedestal's real surface is from the primitives, place by place: lines as `contactsense
    decompose --as-body` writes them. Empty: the same everywhere, see `surface_error`."""


def pack_bodies(bodies: Iterable[Body]) -> Surfaces:
    """Primitives of bodies in the base frame, body after body, all as one link."""
    bodies = tuple(bodies)
    shapes = tuple(shape for body in bodies for shape in body.primitives)
    surfaces = pack([Link("", NO_MASS, shapes)])
    first = 0
    for body in bodies:
        own = slice(first, first := first + len(body.primitives))
        R = rotation_from_rpy(body.rpy)
        surfaces.rotation[own] = R @ surfaces.rotation[own]
        surfaces.origin[own] = surfaces.origin[own] @ R.T + np.array(body.translation)
    return surfaces
