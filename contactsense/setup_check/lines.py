"""The lines of a scene that can be checked."""

from collections.abc import Iterable

from contactsense.calibration.free_motion import FreeMotion
from contactsense.scene import Scene
from contactsense.sensors.settings import CURRENTS
from contactsense.setup_check.setup import BASE

Line = str
"""A field of the scene by its path, or, with a colon, a property of the signals that no field states."""
ROBOT: Line = "robot"
ANGLE_UNIT: Line = "joint positions: unit"
ANGLE_ORDER: Line = "joint positions: order"
MOUNTING: Line = "mounting"
GRAVITY: Line = "gravity"
TOOL: Line = "tool"
TOOL_MASS: Line = "tool.mass"
TOOL_COM: Line = "tool.com"
VELOCITIES: Line = "joint velocities: agreement"
ZEROS: Line = "joint positions: zero"
TORQUE_SIGN: Line = "joint_torque.sign"
TORQUE_SIGNAL: Line = "joint_torque.signal"
TORQUE_MEANING: Line = "joint_torque.meaning"
TORQUE_ORDER: Line = "joint torques: order"
DELAYED_TORQUES: Line = "joint torques: delay"
FROZEN_TORQUES: Line = "joint torques: frozen values"
AXES_ORDER, VECTOR_ORDER, SCALE, FROZEN_VALUES = "order of axes", "force and moment", "scale", "frozen values"
"""Properties of a force/torque sensor's signals, see `signal_line`."""
_INERTIA = "inertia."
_ON_EARTH = 9.76, 9.84
"""Smallest and largest gravity [m/s^2]."""
_ARM: tuple[Line, ...] = (
    ROBOT, ANGLE_UNIT, ANGLE_ORDER, ZEROS, VELOCITIES, MOUNTING, TOOL,
    TOOL_MASS, TOOL_COM,
)  # fmt: skip


def lines(scene: Scene) -> tuple[Line, ...]:
    """All lines of a scene that can be checked, in the order in which they are reported."""
    sensors = [line for field in wrench_fields(scene) for line in sensor_lines(field)]
    loads = [inertia_line(scene, link) for link in loaded_links(len(scene.robot.links))]
    gravity = () if is_on_earth(scene.gravity) else (GRAVITY,)
    return (*_ARM, *gravity, *loads, *sensors, *torque_lines(scene))


def is_on_earth(gravity: float) -> bool:
    """Whether there is such a gravity [m/s^2] anywhere on Earth."""
    return _ON_EARTH[0] <= gravity <= _ON_EARTH[1]


def loaded_links(links: int) -> range:
    """Indices of the links on which a load is looked for: not the base, whose weight is a bias, nor the last
    one, whose load is the tool."""
    return range(1, links - 1)


def inertia_line(scene: Scene, link: int) -> Line:
    """The line that states the inertia of a link, by its index."""
    return f"{_INERTIA}{scene.robot.link_names[link]}"


def states_inertia(line: Line) -> bool:
    """Whether a line states the inertia of a link."""
    return line.startswith(_INERTIA)


def loaded_link(scene: Scene, line: Line) -> int | None:
    """Index of the link whose inertia a line states; None: it states none."""
    found = [k for k in loaded_links(len(scene.robot.links)) if inertia_line(scene, k) == line]
    return found[0] if found else None


def torque_lines(scene: Scene) -> tuple[Line, ...]:
    """Lines of the joint torques."""
    return (
        TORQUE_SIGN,
        TORQUE_SIGNAL,
        TORQUE_MEANING,
        torque_scale(scene),
        TORQUE_ORDER,
        DELAYED_TORQUES,
        FROZEN_TORQUES,
    )


def torque_scale(scene: Scene) -> Line:
    """The line that states the scale of the joint torques: that of currents is a field of the scene."""
    currents = scene.joint_torque is not None and scene.joint_torque.signal in CURRENTS
    return "joint_torque.torque_constants" if currents else "joint torques: scale"


def wrench_fields(scene: Scene) -> tuple[str, ...]:
    """Fields of the force/torque sensors of a scene, the base sensor first."""
    return (*(() if scene.base_wrench is None else (BASE,)), *scene.link_sensors)


def sensors_in(scene: Scene, part: FreeMotion) -> frozenset[str]:
    """Fields of the scene's sensors that a recording has."""
    torque = () if scene.joint_torque is None or part.torque is None else ("joint_torque",)
    return frozenset((*torque, *(field for field in wrench_fields(scene) if field in part.readings)))


def recorded_sensors(scene: Scene, recordings: Iterable[FreeMotion]) -> frozenset[str]:
    """Fields of the scene's sensors that any of the recordings has."""
    return frozenset[str]().union(*(sensors_in(scene, part) for part in recordings))


def sensor_lines(field: str) -> tuple[Line, ...]:
    """Lines of one force/torque sensor."""
    signals = (signal_line(field, name) for name in (AXES_ORDER, VECTOR_ORDER, SCALE, FROZEN_VALUES))
    stated = ["sign", "rpy", "translation", "delay"]
    if field.startswith("link_wrenches."):
        stated.insert(0, "link")
    # The weight of the base, which is not known well, is in the bias of the base sensor: `base_offset` of the
    # result says where it is off.
    own = ("range",) if field == BASE else ("bias", "range")
    return (*(f"{field}.{name}" for name in stated), *signals, *(f"{field}.{name}" for name in own))


def signal_line(field: str, name: str) -> Line:
    """The line of a property of a force/torque sensor's signals."""
    return f"{label(field)} wrench: {name}"


def label(field: str) -> str:
    """Name of a force/torque sensor in the lines that no field states."""
    return field.rpartition(".")[2].removesuffix("_wrench")


def sensor_of(scene: Scene, line: Line) -> str | None:
    """Field of the force/torque sensor that a line is about; None: it is about none."""
    found = [field for field in wrench_fields(scene) if line in sensor_lines(field)]
    return found[0] if found else None
