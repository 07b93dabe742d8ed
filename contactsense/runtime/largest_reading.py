"""The largest reading of a force/torque sensor that the arm's own weight and motion cause in its reach."""

from collections.abc import Callable
from typing import Literal

import numpy as np
from scipy.optimize import Bounds, minimize

from contactsense.kinematics.inverse_dynamics import inverse_dynamics
from contactsense.kinematics.model import Model, build_model, empty_motion
from contactsense.robots import Inertia, Link, Robot
from contactsense.runtime.constants import model_with_tool, tool_in_last_link
from contactsense.runtime.weight import ArmWeight, reading_from_base_wrench
from contactsense.runtime.wrist_frame import WristFrame
from contactsense.scene import Scene
from contactsense.sensors.settings import WrenchSensor

RAMP_TIME = 0.5
"""Every joint may get from rest to its largest speed, or stop, in this time [s]: the robots' data state no
accelerations, and a brisk program takes about as long."""
_POSTURES = 300
_Reading = Callable[[np.ndarray, np.ndarray], np.ndarray]


def largest_reading_at_rest(scene: Scene, sensor: WrenchSensor) -> np.ndarray:
    """Largest magnitude of each component that a sensor under the base reads of an arm at rest.

    The largest moments of random postures within the joints' limits, each improved to the nearest local
    maximum: the true ones may be slightly larger.

    Args:
        scene: The arm, its tool and its mounting.
        sensor: Pose and bias of the sensor.

    Returns:
        Shape (6,), sensor axes, about its origin [N, Nm].
    """
    weight = ArmWeight(scene)
    low, high = _reach(scene)
    postures = np.random.default_rng(0).uniform(low, high, (_POSTURES, len(low)))
    readings = np.array([reading_from_base_wrench(sensor, weight.wrench(q)) for q in postures])
    largest = np.abs(readings).max(axis=0)
    for component in (3, 4, 5):  # the force is the same in all postures
        start = int(np.abs(readings[:, component]).argmax())
        sign = float(np.sign(readings[start, component]))

        def opposite(q: np.ndarray, component: int = component, sign: float = sign) -> float:
            return -sign * float(reading_from_base_wrench(sensor, weight.wrench(q))[component])

        best = minimize(opposite, postures[start], method="L-BFGS-B", bounds=Bounds(low, high))
        largest[component] = max(largest[component], -best.fun)
    return np.asarray(largest)


def largest_reading_in_motion(scene: Scene, field: Literal["base_wrench", "wrist_wrench"]) -> np.ndarray:
    """Largest magnitude of each component that a sensor reads of an arm in motion that touches nothing.

    In random postures within the joints' limits, every joint has its largest speed, either way, or rests, and
    the acceleration, up to that of `RAMP_TIME`, that is the worst for the component: the true ones may be
    slightly larger.

    Args:
        scene: The arm, its tool and its mounting; it has the sensor.
        field: The sensor.

    Returns:
        Shape (6,), sensor axes, about its origin [N, Nm].
    """
    model, reading = _base(scene) if field == "base_wrench" else _wrist(scene)
    joints = scene.robot.joints
    n = len(joints)
    motion, torque, wrench = empty_motion(n), np.zeros(n), np.zeros(6)
    speed = np.array([joint.velocity_limit for joint in joints])
    low, high = _reach(scene)
    chance, still, weightless = np.random.default_rng(0), np.zeros(n), np.zeros(3)

    def load(q: np.ndarray, qd: np.ndarray, qdd: np.ndarray, gravity: np.ndarray) -> np.ndarray:
        inverse_dynamics(model, q, qd, qdd, gravity, motion, torque, wrench)
        return wrench.copy()

    largest = np.zeros(6)
    for q in chance.uniform(low, high, (_POSTURES, n)):
        fast = speed * chance.choice([-1.0, 1.0], n)
        loads = [np.zeros(6), *(load(q, qd, still, scene.gravity_base) for qd in (still, fast))]
        loads += [load(q, still, ramp, weightless) for ramp in np.diag(speed / RAMP_TIME)]
        readings = reading(q, np.array(loads))
        worst = np.abs(readings[3:] - readings[0]).sum(axis=0)
        largest = np.maximum(largest, np.abs(readings[1:3]).max(axis=0) + worst)
    return largest


def _reach(scene: Scene) -> tuple[np.ndarray, np.ndarray]:
    """Lowest and highest joint positions, each shape (n,) [rad]; postures repeat beyond half a turn."""
    low, high = np.clip([joint.position_limits for joint in scene.robot.joints], -np.pi, np.pi).T
    return low, high


def _base(scene: Scene) -> tuple[Model, _Reading]:
    sensor = scene.base_wrench
    assert sensor is not None
    return model_with_tool(scene), lambda _, wrench: reading_from_base_wrench(sensor, wrench)


def _wrist(scene: Scene) -> tuple[Model, _Reading]:
    """The tool alone, carried by an arm without mass."""
    robot, sensor = scene.robot, scene.wrist_wrench
    assert sensor is not None
    nothing = Inertia(0.0, np.zeros(3), np.zeros((3, 3)))
    bodies = [nothing] * (len(robot.links) - 1) + [tool_in_last_link(scene)]
    links = tuple(Link(link.name, body) for link, body in zip(robot.links, bodies, strict=True))
    return build_model(Robot(robot.name, links, robot.joints)), WristFrame(sensor, robot).reading
