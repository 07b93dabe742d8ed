"""Readings of an arm with a force/torque sensor below the forearm, by Pinocchio, apart from our dynamics."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
import pinocchio as pin

from contactsense import JointTorqueSensor, LinkWrenchSensor, Sample, Scene, WrenchSensor
from contactsense.robots import Robot
from tests.oracles.pinocchio_arm import PinocchioArm
from tests.plain_arm import plain_ur5e

ARM = plain_ur5e()
FOREARM = 3
SENSOR = LinkWrenchSensor(
    name="forearm", link="forearm", translation=(-0.02, 0.01, 0.03), rpy=(0.3, -0.5, 0.8), force_noise=0.3,
    moment_noise=0.02,
)  # fmt: skip
BASE = WrenchSensor(force_noise=0.3, moment_noise=0.06)
TORQUE = JointTorqueSensor(noise=1.0)
STEP = 0.002
Load = tuple[int, np.ndarray, np.ndarray]
"""Link, force on it and moment about its origin, in its axes."""


class Instant(NamedTuple):
    """Noiseless readings; wrenches in base axes, about the base origin."""

    torque: np.ndarray
    base: np.ndarray
    forearm: np.ndarray


class Oracle:
    """Readings of one arm by Pinocchio."""

    def __init__(self, robot: Robot = ARM, gravity: Sequence[float] = (0.0, 0.0, -9.81)) -> None:
        self._arm = PinocchioArm(robot, gravity)

    def at(self, q: np.ndarray, qd: np.ndarray, qdd: np.ndarray, loads: Sequence[Load] = ()) -> Instant:
        """Readings in one state of motion, while these loads act on links other than the base."""
        arm = self._arm
        torque, base = arm.inverse_dynamics(q, qd, qdd, loads)
        # What the parent of the forearm exerts on it, in the forearm's axes about its origin.
        held = pin.Force(arm.data.f[FOREARM])
        pin.forwardKinematics(arm.model, arm.data, q)
        return Instant(torque, base, -arm.data.oMi[FOREARM].act(held).vector)

    def pose(self, q: np.ndarray, link: int) -> tuple[np.ndarray, np.ndarray]:
        """Orientation and origin of a link in the base frame."""
        pin.forwardKinematics(self._arm.model, self._arm.data, q)
        pose = self._arm.data.oMi[link]
        return pose.rotation.copy(), pose.translation.copy()


def motion(t: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Positions, velocities and accelerations of a brisk motion of all joints."""
    centre = np.array([0.2, -1.2, 1.4, -0.9, -1.3, 0.4])
    width, rate = np.array([0.5, 0.3, 0.4, 0.5, 0.6, 0.7]), np.array([1.6, 2.1, 1.8, 2.6, 2.2, 3.0])
    return (
        centre + width * np.sin(rate * t),
        width * rate * np.cos(rate * t),
        -width * rate**2 * np.sin(rate * t),
    )


def noisy(instant: Instant, scene: Scene, origin: np.ndarray, chance: np.random.Generator) -> Instant:
    """The readings with the scene's noise; that of the forearm's sensor is about its `origin`, base frame."""
    base, sensor = scene.base_wrench or BASE, scene.link_wrenches[0]
    force, moment = chance.standard_normal((2, 3)) * [[sensor.force_noise], [sensor.moment_noise]]
    return Instant(
        instant.torque + chance.standard_normal(6),
        instant.base + np.repeat([base.force_noise, base.moment_noise], 3) * chance.standard_normal(6),
        instant.forearm + np.concatenate((force, moment + np.cross(origin, force))),
    )


def stream(
    scene: Scene,
    seconds: float,
    loads: Sequence[Load] = (),
    start: float = 1.0,
    seed: int = 0,
    robot: Robot = ARM,
    velocity_noise: float = 0.0,
) -> list[Sample]:
    """Samples of `motion` with the scene's noise, and that of the velocities [rad/s]; the loads act from
    `start` on [s]."""
    oracle, chance, samples = Oracle(robot, scene.gravity_base), np.random.default_rng(seed), []
    sensor = scene.link_wrenches[0]
    for i in range(round(seconds / STEP)):
        t = i * STEP
        q, qd, qdd = motion(t)
        exact = oracle.at(q, qd, qdd, loads if t >= start else ())
        rotation, place = oracle.pose(q, FOREARM)
        read = noisy(exact, scene, place + rotation @ np.array(sensor.translation), chance)
        samples.append(
            Sample(
                t, q, qd + velocity_noise * chance.standard_normal(len(qd)),
                None if scene.joint_torque is None else read.torque,
                None if scene.base_wrench is None else read.base,
                link_wrenches={sensor.name: read.forearm},
            )
        )  # fmt: skip
    return samples
