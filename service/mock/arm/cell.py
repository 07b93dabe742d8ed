"""The simulated cell: the arm with its tool and mounting, and the properties of its sensors."""

from dataclasses import dataclass, field, replace

import numpy as np

from contactsense import robots
from contactsense.residuals.joint_friction import JointTorqueModel, friction_torque, joint_torque_model
from contactsense.robots import Robot
from contactsense.robots.jit.kernel import kernel
from contactsense.robots.tool import Tool
from contactsense.scene import JointTorqueSensor, Scene, WrenchSensor
from contactsense.scene_model.wrench_map import WrenchMap
from contactsense.sensors.settings import per_joint
from contactsense.service.mock.arm.script import Noise, Script, ScriptError
from contactsense.service.mock.urscript.functions import REGISTERS
from contactsense.service.sensors.clients.robot_stream import SensorError
from contactsense.service.sensors.signal_mapping import torque_constants

TORQUE_CONSTANTS = (10.0, 10.70, 8.46, 9.00, 9.48, 10.12)
"""Joint torque per motor current of a UR10e [Nm/A], as published with the recordings of S. Mamedov and
S. Mikhel, "Practical Aspects of Model-Based Collision Detection", Frontiers in Robotics and AI, 2020."""


@dataclass(frozen=True)
class CellLinkSensor:
    """A force/torque sensor between two links of the arm."""

    name: str
    link: int
    """Number of the link that it carries."""
    map: WrenchMap
    """From the frame of that link to the sensor's."""
    noise: np.ndarray
    """Standard deviations of its reading, shape (6,) [N, Nm]."""
    fields: tuple[str, ...]
    """RTDE fields in which the controller sends its reading."""
    delay: float = 0.0
    """Delay of its readings; a negative one is not simulated [s]."""


@dataclass(frozen=True)
class Cell:
    """One arm in its cell, with its sensors."""

    robot: Robot
    """The arm."""
    tool: Tool | None
    """Tool at the flange; None if there is none."""
    gravity: tuple[float, float, float]
    """Acceleration of free fall, base axes [m/s^2]."""
    base: WrenchMap
    """The sensor under the base."""
    base_noise: np.ndarray
    """Standard deviations of its reading, shape (6,) [N, Nm]."""
    wrist: WrenchMap
    """The sensor at the flange."""
    wrist_noise: np.ndarray
    """Standard deviations of its reading, shape (6,) [N, Nm]."""
    torque_noise: np.ndarray
    """Standard deviations of the joint torques, shape (n,) [Nm]."""
    torque_constants: np.ndarray
    """Joint torque per motor current, shape (n,) [Nm/A]."""
    drive: JointTorqueModel
    """Components of the torque signal in addition to the arm's dynamics."""
    torque_sign: float
    """1 if the signal is the torque of the actuator, -1 if it is that of the load."""
    torque_fields: tuple[str, ...] | None = None
    """RTDE fields with the external torques, if they are not the usual ones."""
    by_difference: bool = False
    """Whether the torques are computed from the actual minus the target current."""
    base_delay: float = 0.0
    """Delay of the readings of the sensor under the base [s]."""
    wrist_delay: float = 0.0
    """Delay of those of the sensor at the flange; a negative one is not simulated [s]."""
    links: tuple[CellLinkSensor, ...] = ()
    """Further force/torque sensors within the arm."""
    link_names: tuple[str, ...] = field(default=())
    """Names of all links; the tool is the last."""

    @classmethod
    def of_script(cls, script: Script) -> "Cell":
        """Create a cell with an arm of the library on a table, with ideal sensors and the script's noise.

        Raises:
            ScriptError: There is no such robot.
        """
        try:
            robot = robots.load(script.robot)
        except robots.RobotError as error:
            raise ScriptError(f"robot: {error}") from None
        noise, joints = script.noise, len(robot.joints)
        return cls(
            robot=robot,
            tool=None,
            gravity=script.gravity,
            base=WrenchMap.make(np.eye(3), np.zeros(3)),
            base_noise=_noise(noise),
            wrist=WrenchMap.make(np.eye(3), np.zeros(3)),
            wrist_noise=np.zeros(6),
            torque_noise=np.full(joints, noise.joint_torque),
            torque_constants=_constants(robot),
            drive=joint_torque_model(JointTorqueSensor(), joints),
            torque_sign=1.0,
            link_names=robot.link_names,
        )

    @classmethod
    def of_scene(cls, scene: Scene) -> "Cell":
        """Create a user's own cell: arm, mounting, tool, and sensors with frame, sign, bias, friction and
        noise.

        Raises:
            ScriptError: The scene cannot be simulated: it has motor currents without torque constants, or
                more sensors in the arm than registers for them.
        """
        joints = len(scene.robot.joints)
        base, wrist = scene.base_wrench or WrenchSensor(), scene.wrist_wrench
        torque = scene.joint_torque or JointTorqueSensor()
        try:
            named = torque.signal.startswith("actual_current") and torque.signal != "actual_current_as_torque"
            constants = torque_constants(scene) if named else _constants(scene.robot)
        except SensorError as error:
            raise ScriptError(f"scene: {error}") from None
        robot = _with_scene_inertia(scene)
        carried = () if scene.tool is None else (scene.tool.name,)
        return cls(
            robot=robot,
            tool=scene.tool,
            gravity=tuple(scene.gravity_base.tolist()),
            base=WrenchMap.of(base),
            base_noise=np.repeat([base.force_noise, base.moment_noise], 3),
            wrist=WrenchMap.make(np.eye(3), np.zeros(3)) if wrist is None else WrenchMap.of(wrist),
            wrist_noise=np.zeros(6)
            if wrist is None
            else np.repeat([wrist.force_noise, wrist.moment_noise], 3),
            torque_noise=per_joint(torque.noise, joints),
            torque_constants=constants,
            drive=joint_torque_model(torque, joints),
            torque_sign=1.0 if torque.sign == "by_actuator" else -1.0,
            torque_fields=torque.fields,
            by_difference=torque.signal == "actual_current_minus_target",
            base_delay=base.delay,
            wrist_delay=0.0 if wrist is None else wrist.delay,
            links=_link_sensors(scene),
            link_names=(*robot.link_names, *carried),
        )

    def friction(self, qd: np.ndarray, gravity_torque: np.ndarray) -> np.ndarray:
        """Friction torque of the drives, shape (n,) [Nm].

        Args:
            qd: Joint velocities, shape (n,) [rad/s].
            gravity_torque: Torques that hold the arm against gravity, shape (n,) [Nm].
        """
        found = np.empty(len(qd))
        _friction_torques(self.drive, qd, gravity_torque, found)
        return found


@kernel
def _friction_torques(
    drive: JointTorqueModel, qd: np.ndarray, gravity_torque: np.ndarray, found: np.ndarray
) -> None:
    for j in range(found.shape[0]):
        found[j] = friction_torque(drive, j, qd[j], gravity_torque[j])


def _link_wrench_fields(scene: Scene) -> list[tuple[str, ...]]:
    """RTDE fields in which the mock sends the readings of `Scene.link_wrenches`: six registers each, in
    order, without those in which it sends the joint torques.

    Raises:
        ScriptError: There are not enough registers.
    """
    torque = scene.joint_torque
    taken = set((torque.fields if torque is not None else None) or ())
    blocks = [tuple(f"output_double_register_{6 * b + i}" for i in range(6)) for b in range(REGISTERS // 6)]
    free = [block for block in blocks if not taken.intersection(block)]
    if len(free) < len(scene.link_wrenches):
        raise ScriptError(
            f"scene: link_wrenches: the mock sends each in six of the {REGISTERS} output_double_register, of "
            f"which joint_torque.fields leave room for {len(free)}, got {len(scene.link_wrenches)}"
        )
    return free[: len(scene.link_wrenches)]


def _link_sensors(scene: Scene) -> tuple[CellLinkSensor, ...]:
    return tuple(
        CellLinkSensor(
            sensor.name,
            scene.robot.link_names.index(sensor.link),
            WrenchMap.of(sensor),
            np.repeat([sensor.force_noise, sensor.moment_noise], 3),
            fields,
            sensor.delay,
        )
        for sensor, fields in zip(scene.link_wrenches, _link_wrench_fields(scene), strict=True)
    )


def _noise(noise: Noise) -> np.ndarray:
    return np.repeat([noise.base_force, noise.base_moment], 3)


def _constants(robot: Robot) -> np.ndarray:
    own = [joint.torque_constant for joint in robot.joints]
    usual = (*TORQUE_CONSTANTS, *[10.0] * len(own))
    return np.array([given or usual[j] for j, given in enumerate(own)])


def _with_scene_inertia(scene: Scene) -> Robot:
    """Return the scene's arm with the masses and rotor inertias that the scene specifies."""
    known = scene.inertia or {}
    links = tuple(
        replace(link, inertia=known[link.name].inertia) if link.name in known else link
        for link in scene.robot.links
    )
    rotors = scene.joint_torque.rotor_inertia if scene.joint_torque is not None else None
    joints = scene.robot.joints
    if rotors is not None:
        joints = tuple(
            replace(joint, rotor_inertia=inertia) for joint, inertia in zip(joints, rotors, strict=True)
        )
    return replace(scene.robot, links=links, joints=joints)
