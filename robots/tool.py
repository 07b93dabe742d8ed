"""A tool or payload at the flange: its inertia and its surface, in the tool flange's frame."""

from typing import Annotated

import numpy as np
from pydantic import ConfigDict, Field, field_validator

from contactsense.robots.files.file_model import FileModel
from contactsense.robots.inertial_fields import Mass, Tensor
from contactsense.robots.primitives import Primitive, Vector
from contactsense.robots.principal_moments import check_principal_moments
from contactsense.robots.robot import Inertia
from contactsense.robots.rotations import symmetric
from contactsense.robots.surface.deviation_table import DeviationTable


class Tool(FileModel):
    """Something rigidly mounted on the tool flange; without primitives it only has weight and cannot be
    touched.

    Raises:
        FieldError: A field is wrong; the message names it, what was expected and what was given.
    """

    model_config = ConfigDict(use_attribute_docstrings=True)

    name: Annotated[str, Field(min_length=1)] = "tool"
    """Name of the link in estimates."""
    mass: Mass = 0.0
    """Mass [kg]."""
    com: Vector = (0.0, 0.0, 0.0)
    """Centre of mass, flange frame [m]."""
    tensor: Tensor = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
    """Inertia about the centre of mass, flange axes, as ixx, ixy, ixz, iyy, iyz, izz [kg m^2]."""
    primitives: tuple[Primitive, ...] = Field(default=())
    """Surface, flange frame [m]; without, the tool cannot be touched. docs/geometry.md lists the kinds."""
    deviation: DeviationTable = ""
    """How far the real surface is from the primitives, place by place: lines as `contactsense decompose
    --as-tool` writes them. Empty: the same everywhere, see `surface_error`."""

    @field_validator("tensor")
    @classmethod
    def _is_of_a_body(cls, tensor: Tensor) -> Tensor:
        check_principal_moments(symmetric(tensor))
        return tensor

    @property
    def inertia(self) -> Inertia:
        """Inertia in the flange frame."""
        return Inertia(self.mass, np.array(self.com), symmetric(self.tensor))


def move_inertia(inertia: Inertia, rotation: np.ndarray, translation: np.ndarray) -> Inertia:
    """The same inertia expressed in a frame in which the body's own frame has `rotation` (3, 3) and
    `translation` (3,) [m]."""
    return Inertia(inertia.mass, rotation @ inertia.com + translation, rotation @ inertia.tensor @ rotation.T)


def join_inertia(a: Inertia, b: Inertia) -> Inertia:
    """Inertia of two rigidly joined bodies, both given in one frame (parallel-axis theorem)."""
    mass = a.mass + b.mass
    if mass == 0.0:
        return a
    com = (a.mass * a.com + b.mass * b.com) / mass
    tensor = np.zeros((3, 3))
    for body in (a, b):
        r = body.com - com
        tensor += body.tensor + body.mass * ((r @ r) * np.eye(3) - np.outer(r, r))
    return Inertia(mass, com, tensor)
