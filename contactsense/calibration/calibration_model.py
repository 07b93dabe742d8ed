"""The parameters that calibration may change, as arrays built from a scene."""

from dataclasses import dataclass, replace
from typing import Any, Self

import numpy as np
from scipy.spatial.transform import Rotation

from contactsense.kinematics.model import Model
from contactsense.kinematics.regressor import bodies_of, parameters_of
from contactsense.kinematics.wrench_transform import wrench_transform
from contactsense.residuals.joint_friction import JointTorqueModel, joint_torque_model
from contactsense.scene import Scene
from contactsense.scene_model.arm_model import model_with_tool
from contactsense.sensors.settings import JointTorqueSensor, WrenchSensor, per_joint

MIN_TOOL_MASS = 0.02
"""The centre of mass of a lighter tool is undefined [kg]."""


@dataclass(frozen=True)
class CalibrationModel:
    """Arm, joint torques and base sensor as the observer's equations use them. n joints."""

    scene: Scene
    """The scene from which all other values are taken."""
    gain: np.ndarray
    """Factor on the torque constants, shape (n,)."""
    rotor: np.ndarray
    """Rotor inertia [kg m^2], shape (n,)."""
    bias: np.ndarray
    """Bias of the joint torques [Nm], shape (n,)."""
    coulomb: np.ndarray
    load: np.ndarray
    viscous: np.ndarray
    lubricant: np.ndarray
    """Friction as in `contactsense.sensors.settings.Friction`, shape (n,)."""
    velocity: float
    """Width of Coulomb friction's smooth sign [rad/s]."""
    lubricant_velocity: float
    """Velocity at which the lubricant's friction saturates [rad/s]."""
    links: np.ndarray
    """Inertial parameters of every link without the tool (`contactsense.kinematics.regressor`), shape (n + 1,
    10)."""
    payload: np.ndarray
    """Mass, and mass times centre of mass in the flange's frame, of the tool, shape (4,) [kg, kg m]."""
    tilt: np.ndarray
    """Rotation vector of gravity relative to the scene's, base axes, shape (3,) [rad]."""
    wrench_bias: np.ndarray
    """Reading of the base sensor without load, its own frame and sign, shape (6,) [N, Nm]."""
    turn: np.ndarray
    """Rotation vector of the base sensor relative to the scene's orientation, base axes, shape (3,) [rad]."""
    shift: np.ndarray
    """Displacement of the base sensor from the scene's position, shape (3,) [m]."""
    delay: float
    """Delay of the base sensor's readings [s]."""
    link_bias: np.ndarray
    """Readings of the S sensors of `Scene.link_sensors` without load, own frame and sign, shape (S, 6) [N,
    Nm]."""
    link_turn: np.ndarray
    """Their rotation vectors relative to the scene's orientations, in the axes of the frame in which the
    scene gives them, shape (S, 3) [rad]."""
    link_shift: np.ndarray
    """Their displacements from the scene's positions, in the same frames, shape (S, 3) [m]."""
    link_delay: np.ndarray
    """Delays of their readings, shape (S,) [s]."""

    @classmethod
    def of(cls, scene: Scene) -> Self:
        """The values of the scene."""
        joints = len(scene.robot.joints)
        sensor = scene.joint_torque or JointTorqueSensor()
        f = sensor.friction
        tool = scene.tool_inertia
        base, sensors = scene.base_wrench or WrenchSensor(), list(scene.link_sensors.values())
        return cls(
            scene=scene,
            gain=np.ones(joints),
            rotor=model_with_tool(scene).rotor_inertia,
            bias=per_joint(sensor.bias, joints),
            coulomb=per_joint(f.coulomb, joints),
            load=per_joint(f.load, joints),
            viscous=per_joint(f.viscous, joints),
            lubricant=per_joint(f.lubricant, joints),
            velocity=f.velocity,
            lubricant_velocity=f.lubricant_velocity,
            links=np.array([parameters_of(body) for body in scene.link_inertia]),
            payload=np.array([tool.mass, *(tool.mass * tool.com)]),
            tilt=np.zeros(3),
            wrench_bias=np.array(base.bias),
            turn=np.zeros(3),
            shift=np.zeros(3),
            delay=base.delay,
            link_bias=np.array([sensor.bias for sensor in sensors]).reshape(-1, 6),
            link_turn=np.zeros((len(sensors), 3)),
            link_shift=np.zeros((len(sensors), 3)),
            link_delay=np.array([sensor.delay for sensor in sensors]),
        )

    @property
    def model(self) -> Model:
        """Kinematics and inertia, tool included."""
        rows = self.links.copy()
        rows[-1] += self._payload_in_last_link()
        mass, com, inertia = bodies_of(rows)
        return model_with_tool(self.scene)._replace(
            mass=mass, com=com, inertia=inertia, rotor_inertia=self.rotor
        )

    def _payload_in_last_link(self) -> np.ndarray:
        """Inertial parameters of the tool in the last link's frame, shape (10,). Its mass may be negative
        during the iterations."""
        robot = self.scene.robot
        mass, first = float(self.payload[0]), robot.flange_rotation @ self.payload[1:]
        first = first + mass * robot.flange_translation
        tensor = robot.flange_rotation @ self.scene.tool_inertia.tensor @ robot.flange_rotation.T
        if abs(mass) > MIN_TOOL_MASS:
            c = first / mass
            tensor = tensor + mass * ((c @ c) * np.eye(3) - np.outer(c, c))
        (xx, xy, xz), (_, yy, yz), (_, _, zz) = tensor
        return np.array([mass, *first, xx, xy, yy, xz, yz, zz])

    @property
    def torque_model(self) -> JointTorqueModel:
        """Friction and bias for the kernels."""
        sensor = self.scene.joint_torque or JointTorqueSensor()
        return joint_torque_model(sensor, len(self.gain))._replace(
            bias=self.bias,
            coulomb=self.coulomb,
            load=self.load,
            viscous=self.viscous,
            lubricant=self.lubricant,
            velocity=self.velocity,
            lubricant_velocity=self.lubricant_velocity,
        )

    @property
    def gravity(self) -> np.ndarray:
        """In base axes, shape (3,) [m/s^2]."""
        return np.asarray(Rotation.from_rotvec(self.tilt).apply(self.scene.gravity_base))

    def base_wrench(self, t: np.ndarray, reading: np.ndarray) -> np.ndarray:
        """Wrench of the arm on the base sensor at times t, base axes and origin, shape (N, 6) [N, Nm]."""
        sensor = self.scene.base_wrench or WrenchSensor()
        reading = on_time(t, reading, self.delay)
        rotation = Rotation.from_rotvec(self.turn).as_matrix() @ sensor.rotation
        transfer = wrench_transform(rotation, np.array(sensor.translation) + self.shift)
        return np.asarray(sensor.sign_factor * (reading - self.wrench_bias) @ transfer.T)

    @property
    def to_base_sensor(self) -> np.ndarray:
        """Matrix that moves a wrench in base axes from the base origin to the base sensor, shape (6, 6)."""
        sensor = self.scene.base_wrench or WrenchSensor()
        return wrench_transform(np.eye(3), -(np.array(sensor.translation) + self.shift))

    def with_values(self, **changes: Any) -> Self:
        """A copy with some fields changed."""
        return replace(self, **changes)


def on_time(t: np.ndarray, reading: np.ndarray, delay: float) -> np.ndarray:
    """Readings, shape (N, 6), at the times t, shape (N,) [s], that arrive `delay` [s] later."""
    if delay == 0.0:
        return reading
    return np.array([np.interp(t + delay, t, column) for column in reading.T]).T
