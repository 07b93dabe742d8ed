"""Scripts of the simulated arm in YAML: its motion, the contacts on it, and its sensors' noise."""

from math import hypot
from pathlib import Path
from typing import Annotated, Any, Self

from pydantic import (
    AfterValidator,
    Field,
    NonNegativeFloat,
    NonNegativeInt,
    PositiveFloat,
    ValidationError,
    model_validator,
)

from contactsense.robots.files.field_errors import describe
from contactsense.robots.files.file_model import FileModel
from contactsense.robots.files.yaml_fields import fields_in, read_fields
from contactsense.service.mock.arm.obstacles import Obstacle
from contactsense.service.mock.urscript.functions import WatchdogAction, input_field

Vector = tuple[float, float, float]
Posture = Annotated[tuple[float, ...], Field(min_length=1)]
# Far more than anybody simulates: squares of huge numbers overflow.
_LONGEST = 1e6
_Pause = Annotated[float, Field(ge=0.0, le=_LONGEST)]
_STRONGEST = 1e5
_Force = Annotated[float, Field(ge=-_STRONGEST, le=_STRONGEST)]
_Forces = tuple[_Force, _Force, _Force]
_Noise = Annotated[float, Field(ge=0.0, le=1e4)]

LARGEST_GRAVITY = 30.0
"""As for a scene [m/s^2]."""
SCRIPTS = Path(__file__).parents[1] / "scripts"
"""Folder of the scripts in the package."""


class ScriptError(ValueError):
    """A script cannot be read, or requests something that its robot cannot do."""


class Noise(FileModel):
    """Standard deviations of the white noise of sensors and of the controller's joint velocities."""

    base_force: _Noise = 0.0
    """Base sensor's force, each axis [N]."""
    base_moment: _Noise = 0.0
    """Base sensor's moment about the base origin, each axis [Nm]."""
    joint_torque: _Noise = 0.0
    """Joint torques [Nm]."""
    joint_velocity: _Noise = 0.0
    """Velocities of joints that move [rad/s]."""
    seed: NonNegativeInt = 0
    """Seed of the random generator; the same seed gives the same noise."""


class Move(FileModel):
    """One segment of the trajectory: a smooth move, then a dwell."""

    to: Posture
    """Joint positions at the end of the move [rad]."""
    duration: Annotated[float, Field(ge=1e-3, le=_LONGEST)]
    """Duration of the move [s]; a quintic, at rest at both ends."""
    dwell: _Pause = 0.0
    """Time at rest after the move [s]."""


class Trajectory(FileModel):
    """Joint motion: starts at rest, passes through postures, and ends at rest."""

    start: Posture
    """Joint positions at the beginning [rad]."""
    dwell: _Pause = 1.0
    """Time at rest before the first move [s]."""
    moves: tuple[Move, ...] = ()
    """The moves, in order."""

    @property
    def end(self) -> Posture:
        """Joint positions at the end [rad]."""
        return self.moves[-1].to if self.moves else self.start

    @property
    def duration(self) -> float:
        """Duration of the whole trajectory [s]."""
        return self.dwell + sum(move.duration + move.dwell for move in self.moves)


class Contact(FileModel):
    """One scripted touch. Its force is given in one of three ways: `push`, `force_link` or `force_base`."""

    link: str
    """Name of the touched link."""
    point: Vector
    """Contact point, link frame [m]; moves with the link."""
    start: NonNegativeFloat
    """Onset of the force, from the beginning of the script [s]."""
    duration: PositiveFloat
    """Duration of the force, ramps included [s]."""
    ramp: NonNegativeFloat = 0.05
    """Duration of the rise and of the fall of the force, raised cosine [s]."""
    normal: Vector | None = None
    """Outward normal of the surface at the point, link axes; any length. Needed for `push` and `torsion`."""
    push: Annotated[float, Field(gt=0.0, le=_STRONGEST)] | None = None
    """Force in the direction opposite to the outward normal [N]."""
    force_link: _Forces | None = None
    """Force on the robot, link axes [N]."""
    force_base: _Forces | None = None
    """Force on the robot, base axes [N]."""
    torsion: _Force = 0.0
    """Moment on the robot about the outward normal [Nm]."""

    @model_validator(mode="after")
    def _consistent(self) -> Self:
        given = [name for name in ("push", "force_link", "force_base") if getattr(self, name) is not None]
        if len(given) != 1:
            raise ValueError(f"expected exactly one of push, force_link, force_base, got {given or 'none'}")
        if self.normal is None and (self.push is not None or self.torsion != 0.0):
            raise ValueError("normal: expected an outward normal, since push or torsion is given, got none")
        if self.normal is not None and sum(x * x for x in self.normal) < 1e-12:
            raise ValueError(f"normal: expected a vector of some length, got {list(self.normal)}")
        if 2.0 * self.ramp > self.duration:
            raise ValueError(f"ramp: expected at most half of duration {self.duration} s, got {self.ramp} s")
        return self


class Watchdog(FileModel):
    """Parameters of `rtde_set_watchdog` of URScript."""

    variable: Annotated[str, AfterValidator(input_field)]
    """RTDE input that must be written."""
    min_frequency: PositiveFloat = 10.0
    """Lowest frequency of the writes [Hz]."""
    action: WatchdogAction = "pause"
    """What the controller does with the program if the input is not written."""


class SafetySettings(FileModel):
    """Conditions under which the simulated controller stops by itself."""

    force_limit: PositiveFloat | None = None
    """External force that causes a protective stop [N]; None: no limit."""
    force_delay: NonNegativeFloat = 0.1
    """Time for which the force must exceed the limit [s]."""
    deceleration: PositiveFloat = 8.0
    """Deceleration of the fastest joint in a protective stop [rad/s^2]."""
    position_deviation: PositiveFloat = 0.02
    """Deviation of a joint from its target that causes a protective stop [rad]."""


def _plausible_gravity(gravity: Vector) -> Vector:
    if hypot(*gravity) > LARGEST_GRAVITY:
        raise ValueError(f"expected at most {LARGEST_GRAVITY:g} m/s^2, got {list(gravity)}")
    return gravity


class Script(FileModel):
    """A simulated arm's robot, motion, contacts, obstacles and noise."""

    robot: str
    """Name of the robot, as `contactsense robots` lists them."""
    rate: Annotated[float, Field(gt=0.0, le=10_000.0)] = 500.0
    """Samples per second [Hz]."""
    gravity: Annotated[Vector, AfterValidator(_plausible_gravity)] = (0.0, 0.0, -9.81)
    """Acceleration of free fall, base axes [m/s^2]."""
    noise: Noise = Noise()
    """Noise of the sensors."""
    trajectory: Trajectory
    """Joint motion."""
    contacts: tuple[Contact, ...] = ()
    """Touches, in any order; they may overlap in time."""
    obstacles: tuple[Obstacle, ...] = ()
    """Obstacles in the cell."""
    safety: SafetySettings = SafetySettings()
    """Conditions under which the controller stops by itself."""
    watchdog: Watchdog | None = None
    """Watchdog on an input that clients must write regularly."""

    @property
    def duration(self) -> float:
        """Duration of the script [s]."""
        return self.trajectory.duration

    @model_validator(mode="after")
    def _consistent(self) -> Self:
        n = len(self.trajectory.start)
        for index, move in enumerate(self.trajectory.moves):
            if len(move.to) != n:
                raise ValueError(
                    f"trajectory.moves[{index}].to: expected {n} joint positions, as in trajectory.start, "
                    f"got {len(move.to)}"
                )
        for index, contact in enumerate(self.contacts):
            end = contact.start + contact.duration
            if end > self.duration + 1e-9:
                raise ValueError(
                    f"contacts[{index}]: expected an end within the {self.duration:g} s of the trajectory, "
                    f"got {end:g} s"
                )
        return self

    @classmethod
    def parse(cls, text: str, name: str = "script") -> "Script":
        """Create a script from YAML text.

        Raises:
            ScriptError: The text is not a valid script; the message gives the field and what was expected.
                `name` identifies the script in messages.
        """
        try:
            return cls._of_fields(fields_in(text, name, "robot: ur5e"), name)
        except ValueError as error:
            raise ScriptError(str(error)) from None

    @classmethod
    def _of_fields(cls, fields: dict[str, Any], name: str) -> "Script":
        try:
            return cls.model_validate(fields)
        except ValidationError as error:
            raise ScriptError(f"{name}: {describe(error, cls)}") from None

    @classmethod
    def load(cls, path: str | Path) -> "Script":
        """Read a script from a YAML file.

        Raises:
            ScriptError: The file cannot be read or its content is wrong.
        """
        try:
            return cls._of_fields(read_fields(path, "the script", "robot: ur5e"), str(path))
        except ValueError as error:
            raise ScriptError(str(error)) from None

    @classmethod
    def demo(cls) -> "Script":
        """The script of the demonstration: a UR5e, eight contacts on five links."""
        return cls.load(SCRIPTS / "demo.yaml")
