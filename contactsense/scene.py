"""The scene: arm, mounting, tool, sensors and their noise."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal, Self, get_args

import numpy as np
from pydantic import (
    BeforeValidator,
    ConfigDict,
    Field,
    InstanceOf,
    PlainSerializer,
    TypeAdapter,
    ValidationError,
    field_validator,
    model_validator,
)

from contactsense import robots
from contactsense.robots import Robot
from contactsense.robots.arm_checks import check_arm
from contactsense.robots.attribute_docs import with_attributes
from contactsense.robots.file_references import located
from contactsense.robots.files.field_errors import Place, describe
from contactsense.robots.files.file_model import FieldError, FileModel, in_words
from contactsense.robots.files.yaml_fields import read_fields
from contactsense.robots.library import in_library, is_library_file
from contactsense.robots.primitives import Vector
from contactsense.robots.robot import NO_MASS, Inertia
from contactsense.robots.rotations import rotation_from_rpy
from contactsense.robots.surroundings import Body
from contactsense.robots.tool import Tool
from contactsense.robots.units import within_one_turn
from contactsense.scene_checks import (
    are_among,
    are_between_links,
    fit_the_cell,
    has_surface,
    has_weights,
)
from contactsense.sensors.arm_limits import in_this_arm, within_the_joints
from contactsense.sensors.field_checks import carried_by, has_no_former_field, has_one_per_joint
from contactsense.sensors.settings import JointTorqueSensor, LinkInertia, LinkWrenchSensor, WrenchSensor

if TYPE_CHECKING:
    from scipy.spatial.transform import Rotation

__all__ = [
    "FieldError",
    "JointTorqueSensor",
    "LinkWrenchSensor",
    "Scene",
    "SceneError",
    "WrenchSensor",
    "check_scene",
    "describe",
]

MAX_LINK_WRENCHES = 8
"""Largest number of force/torque sensors between links: as many have flags of their own
(`contactsense.sensors.stream_state.MAX_SENSORS`)."""
_MOUNTINGS: dict[str, Vector] = {
    "table": (0.0, 0.0, 0.0),
    "ceiling": (np.pi, 0.0, 0.0),
    "wall": (0.0, np.pi / 2, 0.0),
}
LinkPrior = Literal["area", "equal"]
SURFACE_ERROR = {"coarse": 0.004, "fine": 0.0005, "skin": 0.0005}
"""Level of detail -> standard deviation of the primitives' distance from the real surface [m]: a Gaussian
with the same 90 % quantile as measured (`contactsense bench geometry --json`: 6.5 and 0.8 mm). In most places
the surface is much nearer; at ribs, steps and screw heads it is further away."""


class SceneError(ValueError):
    """An invalid scene. The message names the file, the field, the expected value and the given one."""

    def __init__(self, message: str, reasons: dict[Place, str] | None = None) -> None:
        super().__init__(message)
        self.reasons = reasons or {}
        """Field -> what was expected and what was given; empty where a file cannot be read."""


def _as_robot(value: object) -> object:
    if not isinstance(value, str | Path | Robot):
        what = "a name that `contactsense robots` lists, or the path of a URDF or YAML file"
        raise ValueError(f"expected {what}, got {value!r:.60}")
    if not isinstance(value, Robot):
        return robots.load(value)
    check_arm(value)
    return value


def _reference(robot: Robot) -> str:
    """What loads the robot again. Without a file nothing does: its name could be that of another arm. Nor
    does the library's file where something of its arm was changed."""
    if in_library(robot):
        return robot.name
    if robot.file is None or is_library_file(robot.file):
        return f"{robot.name} (built in Python)"
    return str(robot.file.absolute())


@with_attributes
class Scene(FileModel):
    """One arm and its surroundings. Immutable; a `Localizer` is created from it.

    From Python: `Scene(robot="ur5e", mounting="ceiling")`; from a file: `Scene.load("scene.yaml")`.

    Raises:
        SceneError: a field is invalid; the message names it, what was expected and what was given.
    """

    model_config = ConfigDict(use_attribute_docstrings=True)

    robot: Annotated[
        InstanceOf[Robot],
        BeforeValidator(_as_robot),
        PlainSerializer(_reference, return_type=str),
    ]
    """The arm: a name listed by `contactsense robots`, or the path of a URDF or YAML file, relative to the
    scene file; in Python also a `robots.Robot`."""
    kinematics: Path | None = None
    """Kinematic calibration of the real arm, the YAML file exported by UR's driver; None: nominal values."""
    mounting: Literal["table", "wall", "ceiling"] | Vector = "table"
    """Orientation of the base in the world, whose z points up: `table`, `ceiling` (upside down), `wall` (base
    x points down), or roll, pitch, yaw of the base frame about fixed world axes [rad]."""
    gravity: Annotated[float, Field(gt=0.0, le=30.0)] = 9.81
    """Acceleration of gravity [m/s^2]."""
    inertia: dict[str, LinkInertia] | None = None
    """Inertia of links by name, where calibration has changed it. None: the robot's data."""
    inertia_error: Annotated[float, Field(ge=0.0, le=10.0)] = 0.0
    """Relative standard deviation of the mass of each link. A stream estimates the masses in free motion.
    What remains uncertain, in a single measurement all of it, is not mistaken for a contact."""
    tool: Tool | None = None
    """The tool or payload mounted on the tool flange; None: there is none."""
    bodies: tuple[Body, ...] = ()
    """Bodies of the cell that cover the arm or that it may touch: pedestals, tables, fences."""
    base_wrench: WrenchSensor | None = WrenchSensor()
    """Force/torque sensor under the base; None: there is none."""
    joint_torque: JointTorqueSensor | None = JointTorqueSensor()
    """Signal of the joint torques; None: there is none."""
    wrist_wrench: WrenchSensor | None = None
    """Force/torque sensor between tool flange and tool; None: there is none. Its frame is given in the
    flange's frame."""
    link_wrenches: Annotated[tuple[LinkWrenchSensor, ...], Field(max_length=MAX_LINK_WRENCHES)] = ()
    """Further force/torque sensors between links of the arm, such as one below the forearm, at most 8."""
    touchable: tuple[str, ...] | None = None
    """Names of the links on which contacts are searched; None: all. A touch on another link remains possible
    and is reported as "none of these". Give a link that cannot be touched the weight 0 in `link_prior`."""
    link_prior: LinkPrior | dict[str, Annotated[float, Field(ge=0.0, le=1e9)]] = "area"
    """How probable a contact on each link is before any measurement. `area`: in proportion to its surface;
    `equal`: the same for each link; or weights of all touchable links by name, such as how often each is
    touched. A link of weight 0 cannot be touched. On a link, all places are equally probable. A tool counts
    as a link, a pedestal as part of the base link."""
    detail: Literal["coarse", "fine", "skin"] = "fine"
    """Level of detail of the surface. `coarse`: one or two bodies per link; `fine`: the fitted union of
    primitives; `skin`: the same, then the contact is moved onto the links' meshes."""
    meshes: Path | None = None
    """Folder of visual meshes for `detail: skin`, LINK.ply in each link's frame [m]. Those of UR3e and UR5e
    are part of the package airo-models and need no folder."""
    friction: Annotated[float, Field(gt=0.0, le=10.0)] = 0.5
    """Coefficient of friction between the arm and what touches it: contact forces are rarely inclined further
    from the normal."""
    force: Annotated[float, Field(ge=1e-3, le=5000.0)] = 20.0
    """Usual normal force of contacts [N]: a third and three times as much are common, a tenth and ten times
    are rare. It matters only if the sensors do not determine the magnitude of the force."""
    torsion: Annotated[float, Field(gt=0.0, le=1.0)] = 0.0025
    """Torsional moment per normal force, standard deviation [m]: about friction times the radius of the
    contact patch."""
    contacts: Annotated[int, Field(ge=1, le=3)] = 1
    """Largest number of simultaneous contacts in a stream; a further one is distinguished from those already
    tracked."""
    clearance: Annotated[float, Field(ge=0.0, le=1.0)] = 0.005
    """Free space that other links and bodies must leave above a point that is touched, at least a fingertip
    [m]: faces in the gap of a joint cannot be touched."""
    surface_error: Annotated[float, Field(gt=0.0, le=0.1)] | None = None
    """Standard deviation of the primitives' distance from the real surface [m], the same everywhere. None:
    that of each place in the arm's surface file; where it has none, 0.0005, with `coarse` 0.004. A
    number also keeps coarse primitives where they are."""
    bandwidth: Annotated[float, Field(ge=1e-3, le=1e4)] = 10.0
    """Cut-off frequency of the momentum observer [Hz]: lower is less noisy, higher is faster."""
    bias_time: Annotated[float, Field(ge=0.1, le=1e9)] | None = 10.0
    """Averaging time of the biases of base sensor and joint torques in free motion [s]: they may drift that
    slowly. None: the scene's biases are constant, as those of sensors within the arm are always."""
    picks_up: bool = False
    """Whether the arm picks up payloads: a steady load along gravity at the flange is then a payload, not a
    contact. Needs base sensor and joint torques."""
    false_alarms_per_hour: Annotated[float, Field(gt=0.0, le=1e6)] = 0.01
    """False-alarm rate of a stream: how often noise alone may appear as a contact [1/h]."""
    clear: Annotated[float, Field(gt=0.5, lt=1.0)] = 0.95
    """A candidate less probable than this is reported as `ambiguous`."""

    def __init__(self, /, **fields: Any) -> None:
        try:
            super().__init__(**fields)
        except ValidationError as error:
            told = in_words(error, type(self))
            raise SceneError(str(told), told.reasons) from None

    @field_validator("mounting", mode="before")
    @classmethod
    def _is_mounting(cls, mounting: Any) -> Any:
        if isinstance(mounting, str) and mounting in _MOUNTINGS:
            return mounting
        try:
            return within_one_turn(TypeAdapter(Vector).validate_python(mounting))
        except ValidationError:
            raise ValueError(
                f"expected {', '.join(_MOUNTINGS)} or roll, pitch, yaw in rad, got {mounting!r}"
            ) from None

    @field_validator("link_prior", mode="before")
    @classmethod
    def _is_link_prior(cls, prior: Any) -> Any:
        if isinstance(prior, dict) or prior in get_args(LinkPrior):
            return prior
        raise ValueError(f"expected area, equal or a weight of each link by name, got {prior!r}")

    @field_validator("meshes", mode="before")
    @classmethod
    def _is_path(cls, path: Any) -> Any:
        if path == "":  # which would be the folder itself
            raise ValueError("expected a path, or null for none, got ''")
        return path

    @field_validator("bodies", "link_wrenches", mode="before")
    @classmethod
    def _is_list(cls, parts: Any) -> Any:
        if isinstance(parts, FileModel):  # a list of pairs, to Python
            raise ValueError(f"expected a list, got {parts!r:.60}")
        return parts

    @model_validator(mode="before")
    @classmethod
    def _is_current(cls, fields: Any) -> Any:
        if isinstance(fields, dict):
            has_no_former_field(fields)
        return fields

    @model_validator(mode="before")
    @classmethod
    def _calibrate(cls, fields: Any) -> Any:
        # A value of another type is left to the check of the field.
        if isinstance(fields, dict) and isinstance(fields.get("kinematics"), str | Path):
            robot = _as_robot(fields.get("robot"))
            if isinstance(robot, Robot):
                try:
                    return {**fields, "robot": robots.calibrated(robot, fields["kinematics"])}
                except robots.RobotError as error:
                    raise ValueError(f"kinematics: {error}") from None
        return fields

    @model_validator(mode="after")
    def _is_consistent(self) -> Self:
        robot, names, torque = self.robot, self.link_names, self.joint_torque
        if self.base_wrench is None and torque is None:
            raise ValueError("base_wrench, joint_torque: expected at least one of the two sensors, got none")
        if self.tool is not None:
            if self.tool.primitives and self.tool.name in robot.link_names:
                raise ValueError(f"tool.name: expected a name that no link has, got {self.tool.name!r}")
            carried_by(robot.mass, self.tool)
        are_among("touchable", self.touchable or (), names)
        has_surface(robot, names, self.touchable)
        if isinstance(self.link_prior, dict):
            has_weights(robot, self.touchable or names, self.bodies, self.link_prior)
        are_among("inertia", self.inertia or (), robot.link_names)
        for name, inertia in (self.inertia or {}).items():
            in_this_arm(robot, name, inertia)
        if torque is not None:
            joints = len(robot.joints)
            has_one_per_joint("joint_torque", torque, joints)
            has_one_per_joint("joint_torque.friction", torque.friction, joints)
            within_the_joints(robot, torque)
            if torque.signal == "external_torque" and torque.fields is None:
                raise ValueError(
                    f"joint_torque.fields: expected the {joints} fields that carry external_torque, got none"
                )
        fit_the_cell(self.bodies, names, self.base_wrench is not None)
        if self.picks_up and (self.base_wrench is None or torque is None or self.wrist_wrench):
            raise ValueError("picks_up: expected base_wrench and joint_torque, and no wrist_wrench")
        are_between_links(self.link_wrenches, robot.link_names)
        if self.picks_up and self.link_wrenches:
            raise ValueError("picks_up: expected base_wrench and joint_torque, and no link_wrenches")
        if self.wrist_wrench is not None and self.tool is None:
            raise ValueError("wrist_wrench: expected a tool beyond the wrist sensor, got none")
        return self

    @classmethod
    def load(cls, path: str | Path) -> Self:
        """Read a scene from a YAML file. Relative paths in it are relative to its folder.

        Raises:
            SceneError: the file is missing or not YAML, or a field is invalid; the message names it.
        """
        try:
            content = read_fields(path, "the scene", "robot: ur5e")
        except ValueError as error:
            raise SceneError(str(error)) from None
        try:
            return cls(**located(content, Path(path).parent))
        except SceneError as error:
            raise SceneError(f"{path}: {error}") from None

    @property
    def surface_deviation(self) -> float:
        """`surface_error`, or the default of this level of detail [m]."""
        return SURFACE_ERROR[self.detail] if self.surface_error is None else self.surface_error

    @property
    def link_sensors(self) -> dict[str, WrenchSensor]:
        """Force/torque sensors within the arm by field: `link_wrenches.NAME`, and `wrist_wrench` last."""
        found: dict[str, WrenchSensor] = {f"link_wrenches.{s.name}": s for s in self.link_wrenches}
        if self.wrist_wrench is not None:
            found["wrist_wrench"] = self.wrist_wrench
        return found

    @property
    def link_inertia(self) -> list[Inertia]:
        """Inertia of each link without the tool, in the link's frame: as in `inertia`, or the robot's."""
        own = self.inertia or {}
        return [own[link.name].inertia if link.name in own else link.inertia for link in self.robot.links]

    @property
    def tool_inertia(self) -> Inertia:
        """Inertia of the tool in the flange's frame; zero without a tool."""
        return NO_MASS if self.tool is None else self.tool.inertia

    @property
    def link_names(self) -> tuple[str, ...]:
        """Names of all links: the arm's, base first, then the tool if it has a surface."""
        tool = (self.tool.name,) if self.tool is not None and self.tool.primitives else ()
        return self.robot.link_names + tool

    @property
    def touchable_links(self) -> tuple[str, ...]:
        """Names of the links that can be touched: those of `touchable` with a weight that is not 0."""
        weights = {} if isinstance(self.link_prior, str) else self.link_prior
        names = self.link_names if self.touchable is None else self.touchable
        return tuple(name for name in names if weights.get(name, 1.0) > 0.0)

    @property
    def gravity_base(self) -> np.ndarray:
        """Gravity in base axes [m/s^2], shape (3,)."""
        return rotation_from_rpy(self.mounting_rpy).T @ [0.0, 0.0, -self.gravity]

    @property
    def orientation(self) -> "Rotation":
        """Orientation of the base in the world."""
        from scipy.spatial.transform import Rotation  # not needed to start a localizer

        return Rotation.from_euler("xyz", self.mounting_rpy)

    @property
    def mounting_rpy(self) -> Vector:
        """Roll, pitch, yaw of the base about fixed world axes [rad]: what `mounting` stands for."""
        return _MOUNTINGS[self.mounting] if isinstance(self.mounting, str) else self.mounting


def check_scene(scene: object) -> None:
    """Raise a TypeError if an argument `scene` is none, such as a name or the path of a file."""
    if not isinstance(scene, Scene):
        raise TypeError(
            "scene: expected a Scene, as in Scene(robot='ur5e') or Scene.load('scene.yaml'), got "
            f"{scene!r:.60}"
        )
