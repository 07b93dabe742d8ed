"""The value of a line of the scene, as it would be written there."""

from collections.abc import Callable, Iterable
from dataclasses import replace
from math import ceil, log10

import numpy as np
from scipy.spatial.transform import Rotation

from contactsense.kinematics.regressor import bodies_of
from contactsense.robots.rotations import rpy_from_rotation
from contactsense.scene import Scene, WrenchSensor
from contactsense.sensors.settings import COMPONENTS
from contactsense.setup_check.hypotheses.all_hypotheses import (
    meant_signal,
    mounting_mistakes,
    reads_other_signal,
    signed_permutations,
    torque_constants,
)
from contactsense.setup_check.hypotheses.scale_hypotheses import torque_remark, unit_remark
from contactsense.setup_check.lines import (
    ANGLE_ORDER,
    ANGLE_UNIT,
    AXES_ORDER,
    DELAYED_TORQUES,
    FROZEN_TORQUES,
    FROZEN_VALUES,
    GRAVITY,
    MOUNTING,
    ROBOT,
    SCALE,
    TOOL,
    TOOL_COM,
    TOOL_MASS,
    TORQUE_MEANING,
    TORQUE_ORDER,
    TORQUE_SIGN,
    TORQUE_SIGNAL,
    VECTOR_ORDER,
    ZEROS,
    Line,
    loaded_link,
    sensor_of,
    torque_scale,
)
from contactsense.setup_check.setup import Order, SensorSetup, Setup

_SNAP = np.radians(3.0)
"""An orientation this close to a usual one is taken for it."""
_NAMED = {"table": (0.0, 0.0, -1.0), "ceiling": (0.0, 0.0, 1.0), "wall": (1.0, 0.0, 0.0)}


def line_value(line: Line, setup: Setup, scene: Scene) -> tuple[str, str]:
    """The line's value in a setup, and a remark on how it differs from the scene's (may be empty)."""
    link = loaded_link(scene, line)
    if link is not None:
        return _inertia(link, setup)
    field = sensor_of(scene, line)
    if field is not None:
        return _of_sensor(line, field, setup, scene)
    if line == torque_scale(scene):
        return _torque_scale(setup, scene)
    return _VALUES[line](setup, scene)


def _angle_unit(setup: Setup, scene: Scene) -> tuple[str, str]:
    if setup.angle_unit == 1.0:
        return "rad", ""
    return ("deg", "they are in degrees") if setup.angle_unit < 1.0 else ("rad", "converted twice")


def _torque_sign(setup: Setup, scene: Scene) -> tuple[str, str]:
    own = not (setup.gain < 0.0).any()
    sign = scene.joint_torque.sign if scene.joint_torque is not None else "by_actuator"
    return sign if own else {"by_actuator": "on_arm", "on_arm": "by_actuator"}[sign], ""


def _torque_signal(setup: Setup, scene: Scene) -> tuple[str, str]:
    stated = scene.joint_torque.signal if scene.joint_torque is not None else ""
    return meant_signal(scene) if reads_other_signal(setup, scene) else (stated, "")


def _torque_delay(setup: Setup, scene: Scene) -> tuple[str, str]:
    late = round(1e3 * setup.torque_delay)
    return "none" if late == 0 else f"{abs(late)} ms {'late' if late > 0 else 'early'}", ""


def _frozen_torques(setup: Setup, scene: Scene) -> tuple[str, str]:
    still = zip(scene.robot.joints, setup.gain, strict=True)
    return ", ".join(joint.name for joint, gain in still if gain == 0.0) or "none", ""


def _of_sensor(line: Line, field: str, setup: Setup, scene: Scene) -> tuple[str, str]:
    """Value and remark of a line of the force/torque sensor `field`."""
    sensor = setup.sensors[field]
    if line.endswith(".rpy"):
        frame, given = Setup.of(scene).sensors[field], scene.link_sensors.get(field, scene.base_wrench)
        if given is not None and np.array_equal(sensor.rotation, frame.rotation):
            return _vector(np.array(given.rpy), 4), ""  # of the angles that say the same, those stated
        return _frame(sensor, frame)
    if line.endswith(".link"):
        return scene.robot.link_names[sensor.body], ""
    if line.endswith(".bias"):
        return _bias(sensor.bias, scene.link_sensors[field]), ""
    return _sensor(line, sensor), unit_remark(*_sizes(sensor.order)) if line.endswith(SCALE) else ""


def as_sign_and_turn(line: Line, setup: Setup, scene: Scene) -> str:
    """What a scene can state in place of mirrored axes of a sensor; empty: the line is not about such."""
    field = sensor_of(scene, line)
    sensor = setup.sensors[field].without_mirror() if field and line.endswith(AXES_ORDER) else None
    if field is None or sensor is None:
        return ""
    same = replace(setup, sensors={**setup.sensors, field: sensor})
    sign, rpy = (line_value(f"{field}.{name}", same, scene)[0] for name in ("sign", "rpy"))
    return f"the same as {field}.sign: {sign} with {field}.rpy: {rpy} rad"


def _sensor(line: Line, setup: SensorSetup) -> str:
    if line.endswith(".sign"):
        return "arm_on_sensor" if setup.sign > 0.0 else "sensor_on_arm"
    if line.endswith(".translation"):
        return _vector(setup.translation, 3)
    if line.endswith(".delay"):
        return f"{round(setup.delay, 4) + 0.0:.4f}"
    if line.endswith(FROZEN_VALUES):
        return "none"
    if line.endswith(SCALE):
        force, moment = _sizes(setup.order)
        return f"{force:.3g} per N, {moment:.3g} per Nm"
    parts = [
        ("-" if row.sum() < 0.0 else "") + COMPONENTS[int(np.argmax(np.abs(row)))] for row in setup.order
    ]
    if line.endswith(VECTOR_ORDER):
        return "force first" if "f" in parts[0] else "moment first"
    force_first = "f" in parts[0]
    forces, moments = (parts[:3], parts[3:]) if force_first else (parts[3:], parts[:3])
    axes = " ".join(forces).replace("f", "")
    turned = " ".join(moments).replace("m", "")
    return axes if axes == turned else f"forces {axes}, moments {turned}"


def _bias(bias: np.ndarray, sensor: WrenchSensor) -> str:
    """The bias of a sensor within the arm, in hundredths: finer where its noise is below one."""
    noise = (sensor.force_noise,) * 3 + (sensor.moment_noise,) * 3
    digits = [max(2, ceil(-log10(value))) for value in noise]
    return _list(f"{round(float(x), n) + 0.0:g}" for x, n in zip(bias, digits, strict=True))


def _places(order: Order) -> str:
    """Which value as read is that of each joint."""
    return " ".join(str(place) for place in order)


def _zeros(setup: Setup, scene: Scene) -> str:
    """The joints with another zero, and what must be added to their positions as read."""
    degrees = [round(float(np.degrees(angle)), 1) for angle in setup.angle_zero]
    changed = zip(scene.robot.joints, degrees, strict=True)
    parts = [f"{joint.name} {angle:+g} degrees" for joint, angle in changed if angle != 0.0]
    return ", ".join(parts) or "as read"


def _inertia(link: int, setup: Setup) -> tuple[str, str]:
    """The inertia of a link with its load as a scene states it, and the load."""
    masses, coms, tensors = bodies_of(setup.loaded_links)
    tensor = ", ".join(f"{x + 0.0:.3g}" for x in tensors[link][np.triu_indices(3)])
    text = f"{{mass: {masses[link]:.3g}, com: {_vector(coms[link], 3)}, tensor: [{tensor}]}}"
    load = setup.loads[link]
    remark = (
        f"a load of about {load:.2g} kg at {_vector(setup.places[link], 2)} m in the link's frame, which "
        "neither scene nor robot states"
    )
    return text, remark if load > 0.0 else ""


def _torque_scale(setup: Setup, scene: Scene) -> tuple[str, str]:
    """The torque constants that a setup means, or values per newton metre."""
    factors = np.abs(np.where(setup.gain == 0.0, 1.0, setup.gain))
    if torque_scale(scene) == "joint_torque.torque_constants":
        return _vector(torque_constants(scene) / factors, 3), ""
    if np.ptp(factors) > 0.0:
        return f"{_vector(factors, 3)} per Nm", ""
    return f"{factors[0]:.3g} per Nm", torque_remark(float(factors[0]))


def _sizes(order: np.ndarray) -> tuple[float, float]:
    """Scales of forces and moments."""
    sizes = np.abs(order).sum(axis=0)
    return float(sizes[0]), float(sizes[3])


def _vector(values: np.ndarray, digits: int) -> str:
    return _list(f"{round(float(x), digits) + 0.0:g}" for x in values)


def _list(numbers: Iterable[str]) -> str:
    return f"[{', '.join(numbers)}]"


def roll_and_pitch(gravity: np.ndarray) -> tuple[float, float]:
    """Roll and pitch of a base in which gravity has this direction; yaw does not matter [rad]."""
    x, y, z = gravity / np.linalg.norm(gravity)
    return float(np.arctan2(-y, -z)), float(np.arcsin(np.clip(x, -1.0, 1.0)))


def _mounting(setup: Setup, scene: Scene) -> tuple[str, str]:
    down = setup.gravity / np.linalg.norm(setup.gravity)
    stated = scene.mounting
    if _angle(down, scene.gravity_base) < 1e-9:
        return (stated if isinstance(stated, str) else _vector(np.array(stated), 4)), ""
    for name, axis in _NAMED.items():
        if _angle(down, np.array(axis)) < _SNAP:
            return name, ""
    yaw = 0.0
    if not isinstance(stated, str):
        yaw = stated[2]
        for text, rpy in mounting_mistakes(stated):
            if _angle(down, Rotation.from_euler("xyz", rpy).inv().apply([0.0, 0.0, -1.0])) < _SNAP:
                return _vector(np.array(rpy), 4), text
    return _vector(np.array([*roll_and_pitch(down), yaw]), 4), ""


def _angle(a: np.ndarray, b: np.ndarray) -> float:
    return float(np.arctan2(np.linalg.norm(np.cross(a, b)), a @ b))


def _frame(setup: SensorSetup, scene: SensorSetup) -> tuple[str, str]:
    stated = scene.rotation
    rotation, remark = setup.rotation, ""
    for turn in signed_permutations():
        if np.linalg.det(turn) > 0.0:
            apart = Rotation.from_matrix(turn.T @ stated.T @ setup.rotation).magnitude()
            if apart < _SNAP:
                rotation = stated @ turn
                vector = Rotation.from_matrix(turn).as_rotvec()
                degrees = float(np.degrees(np.linalg.norm(vector)))
                if degrees > 1.0:
                    axis = np.round(vector / np.abs(vector).max())
                    remark = f"turned by {degrees:.0f} degrees about {_axis(axis)}"
                break
    return _vector(np.array(rpy_from_rotation(rotation)), 4), remark


def _axis(axis: np.ndarray) -> str:
    """A direction of whole numbers; those of the frame by their letters."""
    letters = zip("xyz", axis, strict=True)
    named = [f"-{letter}" if x < 0.0 else letter for letter, x in letters if x != 0.0]
    return named[0] if len(named) == 1 else _vector(axis, 0)


_VALUES: dict[Line, Callable[[Setup, Scene], tuple[str, str]]] = {
    ROBOT: lambda setup, _: (setup.robot, ""),
    ANGLE_UNIT: _angle_unit,
    ANGLE_ORDER: lambda setup, _: (_places(setup.angle_order), ""),
    ZEROS: lambda setup, scene: (_zeros(setup, scene), ""),
    MOUNTING: _mounting,
    GRAVITY: lambda setup, _: (f"{round(float(np.linalg.norm(setup.gravity)), 4):g}", ""),
    TOOL: lambda setup, _: (f"mass {setup.mass:.3g}, com {_vector(setup.com, 3)}", ""),
    TOOL_MASS: lambda setup, _: (f"{setup.mass:.3g}", ""),
    TOOL_COM: lambda setup, _: (_vector(setup.com, 3), ""),
    TORQUE_SIGN: _torque_sign,
    TORQUE_SIGNAL: _torque_signal,
    TORQUE_MEANING: lambda setup, _: (setup.meaning, ""),
    TORQUE_ORDER: lambda setup, _: (_places(setup.torque_order), ""),
    DELAYED_TORQUES: _torque_delay,
    FROZEN_TORQUES: _frozen_torques,
}
"""Value and remark of the lines that are the same in every scene."""
