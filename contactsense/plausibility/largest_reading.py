"""The largest readings that the arm's own weight and motion cause in its reach."""

from collections.abc import Callable
from functools import partial
from math import isfinite

import numpy as np
from scipy.optimize import Bounds, minimize

from contactsense.kinematics.inverse_dynamics import inverse_dynamics
from contactsense.kinematics.model import Model, empty_motion
from contactsense.robots import Robot
from contactsense.scene import Scene
from contactsense.scene_model.arm_model import model_with_tool
from contactsense.scene_model.arm_weight import ArmWeight
from contactsense.scene_model.link_sensor_frame import LinkSensorFrame
from contactsense.scene_model.link_sensors import mounts
from contactsense.scene_model.load_weight import LoadWeight
from contactsense.scene_model.wrench_map import WrenchMap

RAMP_TIME = 0.5
"""Every joint may get from rest to its largest speed, or stop, in this time [s]: the robots' data state no
accelerations, and a brisk program takes about as long."""
_POSTURES = 300
_STARTS = 3
"""Number of the random motions from which the largest of each component is sought: the best one alone may end
at a maximum that is a quarter lower."""
_MIN_GAIN = 1e-3
"""Relative gain below which the search from one start ends."""
_Reading = Callable[[np.ndarray, np.ndarray], np.ndarray]


def largest_reading_at_rest(scene: Scene, field: str) -> np.ndarray:
    """Largest magnitude of each component that a sensor reads of an arm at rest that touches nothing.

    The largest of random postures within the joints' limits, each improved to the nearest local maximum: the
    true ones may be slightly larger.

    Args:
        scene: The arm, its tool and its mounting; it has the sensor.
        field: The sensor: `base_wrench`, or a key of `Scene.link_sensors`.

    Returns:
        Shape (6,), sensor axes, about its origin [N, Nm].
    """
    read = _weight_on_base(scene) if field == "base_wrench" else _weight_within(scene, field)
    low, high = _reach(scene)
    postures = np.random.default_rng(0).uniform(low, high, (_POSTURES, len(low)))
    readings = np.array([read(q) for q in postures])
    largest = np.abs(readings).max(axis=0)

    def size(q: np.ndarray, component: int, sign: float) -> float:
        return sign * float(read(q)[component])

    # The force on the base is the same in all postures.
    for component in range(3 if field == "base_wrench" else 0, 6):
        start = int(np.abs(readings[:, component]).argmax())
        sign = float(np.sign(readings[start, component]))
        best = _local_maximum(partial(size, component=component, sign=sign), postures[start], low, high)[1]
        largest[component] = max(largest[component], best)
    return np.asarray(largest)


def largest_reading_in_motion(scene: Scene, field: str) -> np.ndarray | None:
    """Largest magnitude of each component that a sensor reads of an arm in motion that touches nothing.

    Every joint has its largest speed, either way, or rests, and the acceleration, up to that of `RAMP_TIME`,
    that is the worst for the component. Posture and directions are the worst that a search from random ones
    finds: the true ones may be some percent larger.

    Args:
        scene: The arm, its tool and its mounting; it has the sensor.
        field: The sensor: `base_wrench`, or a key of `Scene.link_sensors`.

    Returns:
        Shape (6,), sensor axes, about its origin [N, Nm]; None if the largest speed of a joint is not
        known.
    """
    if joints_of_unknown_speed(scene.robot):
        return None
    model, reading = _base(scene) if field == "base_wrench" else _within(scene, field)
    joints = scene.robot.joints
    n = len(joints)
    motion, torque, wrench = empty_motion(n), np.zeros(n), np.zeros(6)
    speed = np.array([joint.velocity_limit for joint in joints])
    ramps = np.diag(speed / RAMP_TIME)
    low, high = _reach(scene)
    chance, still = np.random.default_rng(0), np.zeros(n)
    gravity, weightless = scene.gravity_base, np.zeros(3)

    def load(q: np.ndarray, qd: np.ndarray, qdd: np.ndarray, gravity: np.ndarray) -> np.ndarray:
        inverse_dynamics(model, q, qd, qdd, gravity, motion, torque, wrench)
        return wrench.copy()

    def size(q: np.ndarray, way: np.ndarray) -> np.ndarray:
        """Largest magnitude of each component in this posture, with speeds in these directions."""
        loads = [np.zeros(6), *(load(q, qd, still, gravity) for qd in (still, way * speed))]
        loads += [load(q, still, ramp, weightless) for ramp in ramps]
        readings = reading(q, np.array(loads))
        worst = np.abs(readings[3:] - readings[0]).sum(axis=0)
        return np.asarray(np.abs(readings[1:3]).max(axis=0) + worst)

    def one(q: np.ndarray, way: np.ndarray, component: int) -> float:
        return float(size(q, way)[component])

    postures = chance.uniform(low, high, (_POSTURES, n))
    ways = chance.choice([-1.0, 1.0], postures.shape)
    sizes = np.array([size(q, way) for q, way in zip(postures, ways, strict=True)])
    largest = sizes.max(axis=0)
    for component in range(6):
        for start in np.argsort(-sizes[:, component])[:_STARTS]:
            of_component = partial(one, component=component)
            found = _fastest_maximum(of_component, postures[start], ways[start], low, high)
            largest[component] = max(largest[component], found)
    return np.asarray(largest)


def _fastest_maximum(
    size: Callable[..., float],
    q: np.ndarray,
    way: np.ndarray,
    low: np.ndarray,
    high: np.ndarray,
) -> float:
    """Local maximum of `size(q, way)` by posture and by the direction of each joint's speed, from those
    given."""
    largest = size(q, way)
    while True:
        before = largest
        q, largest = _local_maximum(partial(size, way=way), q, low, high)
        for joint in range(len(way)):
            for direction in (-1.0, 0.0, 1.0):
                other = way.copy()
                other[joint] = direction
                if (found := size(q, other)) > largest:
                    way, largest = other, found
        if not largest > (1.0 + _MIN_GAIN) * before:
            return largest


def _local_maximum(
    size: Callable[[np.ndarray], float], q: np.ndarray, low: np.ndarray, high: np.ndarray
) -> tuple[np.ndarray, float]:
    """The nearest local maximum of `size` within these limits of the posture, and its value."""

    def opposite(x: np.ndarray) -> float:
        return -size(x)

    best = minimize(opposite, q, method="L-BFGS-B", bounds=Bounds(low, high))
    return np.asarray(best.x), -float(best.fun)


def joints_of_unknown_speed(robot: Robot) -> tuple[str, ...]:
    """Names of the joints whose largest speed is not known."""
    return tuple(joint.name for joint in robot.joints if not isfinite(joint.velocity_limit))


def largest_torque_at_rest(scene: Scene) -> np.ndarray:
    """Largest magnitude of the torque with which each joint holds arm and tool: the largest of random
    postures within the joints' limits, improved to the nearest local maximum; shape (n,) [Nm]."""
    model, (low, high) = model_with_tool(scene), _reach(scene)
    n = len(low)
    still, torque, motion, wrench = np.zeros(n), np.zeros(n), empty_motion(n), np.zeros(6)
    gravity = scene.gravity_base

    def sizes(q: np.ndarray) -> np.ndarray:
        inverse_dynamics(model, q, still, still, gravity, motion, torque, wrench)
        return np.abs(torque)

    def size(q: np.ndarray, joint: int) -> float:
        return float(sizes(q)[joint])

    postures = np.random.default_rng(0).uniform(low, high, (_POSTURES, n))
    starts = postures[np.array([sizes(q) for q in postures]).argmax(axis=0)]
    return np.array([_local_maximum(partial(size, joint=j), starts[j], low, high)[1] for j in range(n)])


def _reach(scene: Scene) -> tuple[np.ndarray, np.ndarray]:
    """Lowest and highest joint positions of all postures, each shape (n,) [rad]."""
    low, high = np.array([joint.range_within_turn for joint in scene.robot.joints]).T
    return low, high


def _weight_on_base(scene: Scene) -> Callable[[np.ndarray], np.ndarray]:
    """What the base sensor reads at rest, by posture."""
    weight, (_, reading) = ArmWeight(scene), _base(scene)
    return lambda q: reading(q, weight.wrench(q))


def _weight_within(scene: Scene, field: str) -> Callable[[np.ndarray], np.ndarray]:
    """What a link sensor reads at rest, by posture."""
    weight, frame = LoadWeight(scene, field), LinkSensorFrame(scene, field)
    return lambda q: frame.reading(q, weight.wrench(q))


def _base(scene: Scene) -> tuple[Model, _Reading]:
    fixed = WrenchMap.of(scene.base_wrench)
    return model_with_tool(scene), lambda _, wrench: fixed.reading(wrench)


def _within(scene: Scene, field: str) -> tuple[Model, _Reading]:
    """What a link sensor carries, on an arm without other masses."""
    model, mount = model_with_tool(scene), mounts(scene)[field]
    for values in (model.mass, model.com, model.inertia):
        values[: mount.first_body] = 0.0
    if mount.load.mass > 0.0:
        model.mass[mount.body], model.com[mount.body] = mount.load.mass, mount.load.com
        model.inertia[mount.body] = mount.load.tensor
    return model, LinkSensorFrame(scene, field).reading
