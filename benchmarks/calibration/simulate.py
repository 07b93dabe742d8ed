"""Simulated recordings of an exactly known scene: its sensors, friction and payload.

The dynamics are the mock's, which share no code with the estimator's; friction and sensors are implemented
here in NumPy, from the same formulas.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Protocol

import numpy as np

from contactsense import Scene
from contactsense.calibration import FreeMotion
from contactsense.robots import Inertia, Link, Robot
from contactsense.robots.tool import join_inertia, move_inertia
from contactsense.service.mock.newton_euler import LinkLoad, inverse_dynamics, link_poses
from contactsense.service.sensors.signal_mapping import WrenchMap


class Motion(Protocol):
    """A motion from rest to rest, such as a `FourierTrajectory`."""

    @property
    def period(self) -> float:
        """Duration [s]."""

    def at(self, t: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Positions [rad], velocities [rad/s] and accelerations [rad/s^2] at times t, shape (N, n) each."""


@dataclass(frozen=True)
class Push:
    """A force that rises, holds and falls, constant in base axes."""

    link: int
    """Number of the link (base: 0)."""
    point: tuple[float, float, float]
    """In the link's frame [m]."""
    force: tuple[float, float, float]
    """On the arm, base axes [N]."""
    start: float
    stop: float
    """[s]"""
    rise: float = 0.15
    """Time to rise and to fall, at most half of the push [s]."""

    def load(self, arm: Robot, t: np.ndarray, q: np.ndarray) -> LinkLoad:
        """The push at times t [s], shape (N,), and postures q [rad], shape (N, n)."""
        rise = min(self.rise, 0.5 * (self.stop - self.start))
        level = np.clip(np.minimum(t - self.start, self.stop - t) / rise, 0.0, 1.0)
        orientation = link_poses(arm, q)[0][self.link]
        force = level[:, None] * (np.swapaxes(orientation, 1, 2) @ np.array(self.force))
        return LinkLoad(self.link, force, np.cross(np.array(self.point), force))


def arm_of(scene: Scene) -> Robot:
    """The scene's robot with its own rotors, links' inertia and tool."""
    robot = scene.robot
    bodies = {link.name: link.inertia for link in robot.links}
    bodies.update({name: body.inertia for name, body in (scene.inertia or {}).items()})
    if scene.tool is not None:
        tool = move_inertia(scene.tool.inertia, robot.flange_rotation, robot.flange_translation)
        bodies[robot.links[-1].name] = join_inertia(bodies[robot.links[-1].name], tool)
    joints = robot.joints
    if scene.joint_torque is not None and scene.joint_torque.rotor_inertia is not None:
        rotors = scene.joint_torque.rotor_inertia
        joints = tuple(replace(j, rotor_inertia=r) for j, r in zip(joints, rotors, strict=True))
    links = tuple(Link(link.name, bodies[link.name]) for link in robot.links)
    return replace(robot, links=links, joints=joints)


def simulate(
    scene: Scene,
    motion: Motion,
    seed: int,
    rate: float = 500.0,
    gain: np.ndarray | None = None,
    pushes: Sequence[Push] = (),
) -> FreeMotion:
    """Readings of the sensors of `scene` during a motion.

    Args:
        scene: The truth, with its sensors' noise; model errors are not simulated.
        motion: Motion of the arm.
        seed: Seed of the noise.
        rate: Sample rate [Hz].
        gain: True over stated torque constants, shape (n,); None: they are correct.
        pushes: What touches the arm, and when.
    """
    rng = np.random.default_rng(seed)
    t = np.arange(0.0, motion.period, 1.0 / rate)
    q, qd, qdd = motion.at(t)
    arm, gravity = arm_of(scene), tuple(float(x) for x in scene.gravity_base)
    loads = [push.load(arm, t, q) for push in pushes]
    torque, wrench = inverse_dynamics(arm, q, qd, qdd, loads, gravity)  # type: ignore[arg-type]
    reading = signal = None
    if scene.joint_torque is not None:
        static_torque, _ = inverse_dynamics(arm, q, 0.0 * q, 0.0 * q, (), gravity)  # type: ignore[arg-type]
        sensor, f = scene.joint_torque, scene.joint_torque.friction
        coulomb = np.array(f.coulomb) + np.array(f.load) * np.abs(static_torque)
        friction = coulomb * np.tanh(qd / f.velocity) + np.array(f.viscous) * qd
        friction += np.array(f.lubricant) * np.tanh(qd / f.lubricant_velocity)
        parts = {
            "motor": torque + friction,
            "gravity_free": torque - static_torque + friction,
            "external": 0.0 * torque,
        }
        signal = parts[sensor.contains] + np.array(sensor.bias)
        signal += np.array(sensor.noise) * rng.standard_normal(q.shape)
        signal /= 1.0 if gain is None else gain
    if scene.base_wrench is not None:
        base = scene.base_wrench
        if base.delay != 0.0:
            earlier = motion.at(t - base.delay)
            loads = [push.load(arm, t - base.delay, earlier[0]) for push in pushes]
            wrench = inverse_dynamics(arm, *earlier, loads, gravity)[1]  # type: ignore[arg-type]
        reading = WrenchMap.of(base).reading(wrench)
        reading += rng.standard_normal(reading.shape) * np.repeat([base.force_noise, base.moment_noise], 3)
    wrist = None
    if scene.wrist_wrench is not None:
        wrist = _wrist_reading(scene, t, q, qd, qdd)
        noise = np.repeat([scene.wrist_wrench.force_noise, scene.wrist_wrench.moment_noise], 3)
        wrist += rng.standard_normal(wrist.shape) * noise
    return FreeMotion(t, q, qd, signal, reading, f"simulated recording {seed}", wrist=wrist)


def _wrist_reading(scene: Scene, t: np.ndarray, q: np.ndarray, qd: np.ndarray, qdd: np.ndarray) -> np.ndarray:
    """Readings of the wrist sensor: the base wrench of an arm of which only the tool has a mass, moved to the
    flange."""
    robot, sensor = scene.robot, scene.wrist_wrench
    assert sensor is not None
    assert scene.tool is not None
    tool = move_inertia(scene.tool.inertia, robot.flange_rotation, robot.flange_translation)
    nothing = Inertia(0.0, np.zeros(3), np.zeros((3, 3)))
    bodies = [nothing] * (len(robot.links) - 1) + [tool]
    links = tuple(Link(link.name, body) for link, body in zip(robot.links, bodies, strict=True))
    bare, gravity = replace(robot, links=links), tuple(float(x) for x in scene.gravity_base)
    _, wrench = inverse_dynamics(bare, q, qd, qdd, (), gravity)  # type: ignore[arg-type]
    rotations, origins = link_poses(robot, q)
    readings = np.empty((len(t), 6))
    for i, (R, o) in enumerate(zip(rotations[-1], origins[-1], strict=True)):
        flange = R @ robot.flange_rotation
        place = o + R @ (robot.flange_translation + robot.flange_rotation @ sensor.translation)
        there = WrenchMap.make(flange @ sensor.rotation, place, sensor.sign, sensor.bias)
        readings[i] = there.reading(wrench[i])
    return readings
