"""Schema of a robot's YAML files, validated field by field, and the `Robot` built from them.

Two files per arm: `<name>.yaml` with kinematics, inertia and limits, and `<name>.surface.yaml` with the
convex primitives of each link, which `contactsense decompose` writes.
"""

from collections import Counter
from dataclasses import replace
from math import hypot, inf, radians
from pathlib import Path
from typing import Annotated, Any, TypeVar

import numpy as np
from pydantic import (
    AfterValidator,
    BaseModel,
    Field,
    ValidationError,
    field_validator,
    model_validator,
)

from contactsense.robots.errors import RobotError, SurfaceFileError
from contactsense.robots.files import yaml_fields
from contactsense.robots.files.field_errors import joined, reasons
from contactsense.robots.files.file_model import FileModel
from contactsense.robots.inertial_fields import LARGEST_MASS, Tensor
from contactsense.robots.primitives import Primitive, Vector
from contactsense.robots.principal_moments import check_principal_moments
from contactsense.robots.robot import Inertia, Joint, Link, Robot
from contactsense.robots.rotations import rotation_from_rpy, symmetric
from contactsense.robots.surface.deviation_table import read_cells
from contactsense.robots.surface.primitive_extent import beyond
from contactsense.robots.units import FURTHEST, in_metres, within_one_turn

Place = Annotated[Vector, AfterValidator(in_metres)]
Angles = Annotated[Vector, AfterValidator(within_one_turn)]
Entry = TypeVar("Entry", bound=BaseModel)
# As in a scene: squares of huge numbers overflow.
Rotor = Annotated[float, Field(ge=0.0, le=1e6)]
TorqueConstant = Annotated[float, Field(gt=0.0, le=1e4)]
# A limit that is not known, or that a joint does not have, is infinite; no other number of a joint is.
PositionLimit = Annotated[float, Field(allow_inf_nan=True)]
PositiveLimit = Annotated[float, Field(gt=0.0, allow_inf_nan=True)]


class LinkEntry(FileModel):
    """One link: `tensor` as ixx, ixy, ixz, iyy, iyz, izz about the com, in axes rotated by `rpy`."""

    name: str
    mass: Annotated[float, Field(gt=0.0, le=LARGEST_MASS)]
    com: Place
    rpy: Angles = (0.0, 0.0, 0.0)
    tensor: Tensor

    @field_validator("tensor")
    @classmethod
    def _is_of_a_body(cls, tensor: Tensor) -> Tensor:
        check_principal_moments(symmetric(tensor))
        return tensor

    def inertia(self) -> Inertia:
        """Mass distribution in the link frame."""
        turn = rotation_from_rpy(self.rpy)
        return Inertia(self.mass, np.array(self.com), turn @ symmetric(self.tensor) @ turn.T)


class JointEntry(FileModel):
    """One revolute joint: its frame in its parent link; limits in degrees, degrees per second and Nm."""

    name: str
    xyz: Place
    rpy: Angles
    axis: Vector = (0.0, 0.0, 1.0)
    position_limits: tuple[PositionLimit, PositionLimit] = (-inf, inf)
    velocity_limit: PositiveLimit
    torque_limit: PositiveLimit
    rotor_inertia: Rotor | None = None
    torque_constant: TorqueConstant | None = None

    @model_validator(mode="after")
    def _has_range_and_axis(self) -> "JointEntry":
        low, high = self.position_limits
        if not low < high:
            raise ValueError(f"position_limits: expected the lower first, got {low}, {high}")
        if not 0.0 < hypot(*self.axis) < inf:
            raise ValueError(f"axis: expected a direction, got {list(self.axis)}")
        return self

    def joint(self) -> Joint:
        """The joint, in SI units."""
        low, high = self.position_limits
        return Joint(
            name=self.name,
            rotation=rotation_from_rpy(self.rpy),
            translation=np.array(self.xyz),
            axis=np.array(self.axis) / np.linalg.norm(self.axis),
            position_limits=(radians(low), radians(high)),
            velocity_limit=radians(self.velocity_limit),
            torque_limit=self.torque_limit,
            rotor_inertia=self.rotor_inertia or 0.0,
            torque_constant=self.torque_constant,
        )


class FrameEntry(FileModel):
    """A frame in another: origin and roll, pitch, yaw about fixed axes."""

    xyz: Place = (0.0, 0.0, 0.0)
    rpy: Angles = (0.0, 0.0, 0.0)


class RobotEntry(FileModel):
    """`<name>.yaml`: links from the base outward, and the joints between them."""

    name: str
    maker: str = ""
    links: tuple[LinkEntry, ...] = Field(min_length=2)
    joints: tuple[JointEntry, ...]
    flange: FrameEntry = FrameEntry()

    @model_validator(mode="after")
    def _is_a_chain(self) -> "RobotEntry":
        if len(self.links) != len(self.joints) + 1:
            raise ValueError(f"{len(self.joints)} joints need one link more, got {len(self.links)}")
        for entries in (self.links, self.joints):
            name, times = Counter(entry.name for entry in entries).most_common(1)[0]
            if times > 1:
                raise ValueError(f"{name}: the name is given {times} times")
        return self


class LinkSurface(FileModel):
    """The surface of one link at two levels of detail."""

    fine: tuple[Primitive, ...] = Field(min_length=1)
    coarse: tuple[Primitive, ...] = Field(min_length=1)
    fine_deviation: str = ""
    """How far the real surface is from the fine primitives, see
    `contactsense.robots.surface.deviation_table`."""
    coarse_deviation: str = ""
    """The same for the coarse primitives, with the mean motion of the surface."""

    @model_validator(mode="after")
    def _is_in_metres(self) -> "LinkSurface":
        for name, level in (("fine", self.fine), ("coarse", self.coarse)):
            for index, text in beyond(level, FURTHEST):
                raise ValueError(f"{name}[{index}]: {text}")
        return self

    @model_validator(mode="after")
    def _deviations_are_of_primitives(self) -> "LinkSurface":
        for name, level in (("fine_deviation", self.fine), ("coarse_deviation", self.coarse)):
            try:
                read_cells(getattr(self, name), len(level))
            except ValueError as error:
                raise ValueError(f"{name}: {error}") from None
        return self


class SurfaceEntry(FileModel):
    """`<name>.surface.yaml`: primitives by link."""

    robot: str
    tip: str | None = None
    """Last link of the arm in its URDF, if it was named."""
    fit_seconds: float = 0.0
    """Duration of the fit on the machine that ran it [s]."""
    links: dict[str, LinkSurface]


def read_yaml(path: Path, what: str) -> Any:
    """Content of a YAML file.

    Raises:
        RobotError: the file cannot be read, is not YAML, or has a key twice.
    """
    try:
        return yaml_fields.read_yaml(path, what)
    except ValueError as error:
        raise RobotError(str(error)) from None


def check(entry: type[Entry], content: Any, path: Path) -> Entry:
    """Read `content` of the file at `path` as `entry`.

    Raises:
        RobotError: a field is wrong; the message names the first one and the file.
    """
    try:
        return entry.model_validate(content)
    except ValidationError as error:
        found = reasons(error.errors(), entry)
        place, text = next(iter(found.items()))
        more = f" (and {len(found) - 1} more)" if len(found) > 1 else ""
        raise RobotError(f"{path}: {joined(place) or 'file'}: {text}{more}") from error


def robot(path: Path) -> Robot:
    """Read a robot from `<name>.yaml`, with its surface if `<name>.surface.yaml` exists in the same folder.

    Raises:
        RobotError: a file is missing or wrong.
    """
    entry = check(RobotEntry, read_yaml(path, "the robot"), path)
    bare = Robot(
        name=entry.name,
        links=tuple(Link(link.name, link.inertia()) for link in entry.links),
        joints=tuple(joint.joint() for joint in entry.joints),
        flange_rotation=rotation_from_rpy(entry.flange.rpy),
        flange_translation=np.array(entry.flange.xyz),
        file=path,
    )
    beside = path.with_suffix(".surface.yaml")
    return with_surface(bare, beside) if beside.exists() else bare


def with_surface(bare: Robot, path: Path) -> Robot:
    """A robot with the primitives of a `.surface.yaml`; links that are not in the file get none.

    Raises:
        SurfaceFileError: the file is missing or wrong, or names a link that the robot does not have.
    """
    surface = read_surface(path).links
    for name in surface:
        if name not in bare.link_names:
            raise SurfaceFileError(f"{path}: links.{name}: {bare.name} has no such link")
    links = (
        _with_primitives(link, surface[link.name]) if link.name in surface else link for link in bare.links
    )
    return replace(bare, links=tuple(links))


def _with_primitives(link: Link, surface: LinkSurface) -> Link:
    return replace(
        link,
        primitives=surface.fine,
        coarse=surface.coarse,
        deviation=read_cells(surface.fine_deviation, len(surface.fine)),
        coarse_deviation=read_cells(surface.coarse_deviation, len(surface.coarse)),
    )


def read_surface(path: Path) -> SurfaceEntry:
    """Content of a `.surface.yaml`.

    Raises:
        SurfaceFileError: the file is missing or wrong.
    """
    try:
        return check(SurfaceEntry, read_yaml(path, "the surface"), path)
    except RobotError as error:
        raise SurfaceFileError(str(error)) from error.__cause__
