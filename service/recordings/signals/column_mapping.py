"""Mapping from columns or topics of a recording to signals, with their units."""

from collections.abc import Sequence
from typing import Annotated, Any, Literal

import numpy as np
from pydantic import BaseModel, BeforeValidator, ConfigDict, ValidationError

from contactsense.robots.files.yaml_fields import read_fields
from contactsense.scene import describe
from contactsense.sensors.link_values import column_of


class MappingError(ValueError):
    """A column mapping that cannot be used: the message names the field, the expected value and the actual
    one."""


def _as_names(value: Any) -> Any:
    if isinstance(value, str):
        return (value,)
    if value == []:
        raise ValueError("expected a prefix or the names of columns, got none")
    return tuple(value) if isinstance(value, list) else value


Names = Annotated[tuple[str, ...], BeforeValidator(_as_names)]
"""One prefix (`actual_q` stands for `actual_q_0`, `actual_q_1`, ...) or one column name per value."""

SHORTEST_STEP = 0.0005
"""Shortest time between two samples that a recording is expected to have [s]."""
_TIME = {"s": 1.0, "ms": 1e-3, "us": 1e-6, "ns": 1e-9}
_ANGLE = {"rad": 1.0, "deg": np.pi / 180.0}


class ColumnMapping(BaseModel):
    """Names of columns (tables) and topics (MCAP, rosbag2), and their units.

    The defaults are the names that RTDE clients write. Without `joint_torque`, `joint_torque_*` is used where
    it exists, and otherwise the columns of the scene's torque signal.
    """

    model_config = ConfigDict(frozen=True, extra="forbid")

    timestamp: str = "timestamp"
    """Column of the time."""
    q: Names = ("actual_q",)
    """Joint positions."""
    qd: Names = ("actual_qd",)
    """Joint velocities."""
    joint_torque: Names | None = None
    """Joint torques [Nm], positive as applied by the actuator. Columns of motor currents with other names go
    into `joint_torque.fields` of the scene."""
    base_wrench: Names = ("base_wrench",)
    """Reading of the sensor under the base, in the sensor's own frame and sign [N, Nm]."""
    wrist_wrench: Names = ("wrist_wrench",)
    """Reading of the sensor at the wrist, in its own frame and sign [N, Nm]."""
    link_wrenches: dict[str, Names] = {}
    """The same of a further sensor within the arm, by its name in the scene; by default, `NAME_wrench`."""
    time_unit: Literal["s", "ms", "us", "ns"] = "s"
    angle_unit: Literal["rad", "deg"] = "rad"
    joint_states: str = "/joint_states"
    """Topic of sensor_msgs/JointState: positions, velocities, efforts (joint torques)."""
    base_wrench_topic: str = "/base_wrench"
    """Topic of geometry_msgs/WrenchStamped of the sensor under the base."""
    wrist_wrench_topic: str = "/wrist_wrench"
    """Topic of geometry_msgs/WrenchStamped of the sensor at the wrist. That of a further sensor within the
    arm is `/NAME_wrench`."""
    joint_names: tuple[str, ...] | None = None
    """Joint names of JointState in the order of the arm; by default the arm's own, also with a prefix, or,
    in a message with other names and as many joints as the arm has, its order."""

    def of_link_sensor(self, field: str) -> Names:
        """Columns of one of `Scene.link_sensors`."""
        if field == "wrist_wrench":
            return self.wrist_wrench
        return self.link_wrenches.get(field.removeprefix("link_wrenches."), (column_of(field),))

    def states(self, field: str) -> bool:
        """Whether the columns of the base sensor, or of one of `Scene.link_sensors`, are not the defaults."""
        group, _, member = field.partition(".")
        return member in self.link_wrenches if member else group in self.model_fields_set

    @property
    def seconds(self) -> float:
        """Seconds per unit of the time column."""
        return _TIME[self.time_unit]

    @property
    def radians(self) -> float:
        """Radians per unit of the position columns; velocities use the same unit per second."""
        return _ANGLE[self.angle_unit]

    @classmethod
    def parse(cls, text: str | None) -> "ColumnMapping":
        """Parse the path of a YAML file, or text such as `q=joint,qd=speed,time_unit=ms`; None: the
        defaults.

        Raises:
            MappingError: A field is unknown or has a wrong value, or the file cannot be read.
        """
        if text is None:
            return cls()
        fields: Any
        if "=" in text:
            fields = {}
            for part in text.split(","):
                name, equals, value = part.partition("=")
                if not equals:
                    raise MappingError(f"--columns: expected NAME=VALUE pairs, got {part!r}")
                group, _, member = name.strip().partition(".")
                there = fields.setdefault(group, {}) if member else fields
                if not isinstance(there, dict) or (member or group) in there:
                    raise MappingError(f"--columns: expected {name.strip()} once, got it twice")
                there[member or group] = value.strip()
        else:
            try:
                fields = read_fields(text, "the column mapping", "q: joint")
            except ValueError as error:
                raise MappingError(str(error)) from None
        try:
            return cls.model_validate(fields)
        except ValidationError as error:
            raise MappingError(f"column mapping: {describe(error, cls)}") from None


def unit_hint(step: float, longest: float) -> str:
    """A question about the unit of the time, if another one makes the time between two samples plausible.

    Args:
        step: The time between two samples as read [s].
        longest: Longest plausible one [s].
    """
    plausible = (unit for unit, scale in _TIME.items() if SHORTEST_STEP <= step * scale <= longest)
    unit = next(plausible, None)
    return "" if unit is None else f"; is another unit meant (--columns time_unit={unit})?"


def expand(names: Sequence[str], count: int, available: Sequence[str]) -> list[str]:
    """Column names of one group of `count` values: a prefix is numbered, a full list is used unchanged."""
    if len(names) == count and (count > 1 or names[0] in available):
        return list(names)
    return [f"{names[0]}_{i}" for i in range(count)]
