"""Simulated recordings of an exactly known scene: its sensors, friction and payload.

The dynamics are the mock's, which share no code with the estimator's; friction and sensors are implemented
here in NumPy, from the same formulas.
"""

from dataclasses import replace
from typing import Protocol

import numpy as np

from contactsense import Scene
from contactsense.calibration import FreeMotion
from contactsense.robots import Link, Robot
from contactsense.robots.tool import join_inertia, move_inertia
from contactsense.service.mock.newton_euler import inverse_dynamics
from contactsense.service.sensors.signal_mapping import WrenchMap


class Motion(Protocol):
    """A motion from rest to rest, such as a `FourierTrajectory`."""

    @property
    def period(self) -> float:
        """Duration [s]."""

    def at(self, t: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Positions [rad], velocities [rad/s] and accelerations [rad/s^2] at times t, shape (N, n) each."""


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
) -> FreeMotion:
    """Readings of the sensors of `scene` during a motion.

    Args:
        scene: The truth, with its sensors' noise; model errors are not simulated.
        motion: Motion of the arm.
        seed: Seed of the noise.
        rate: Sample rate [Hz].
        gain: True over stated torque constants, shape (n,); None: they are correct.
    """
    rng = np.random.default_rng(seed)
    t = np.arange(0.0, motion.period, 1.0 / rate)
    q, qd, qdd = motion.at(t)
    arm, gravity = arm_of(scene), tuple(float(x) for x in scene.gravity_base)
    torque, wrench = inverse_dynamics(arm, q, qd, qdd, (), gravity)  # type: ignore[arg-type]
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
            wrench = inverse_dynamics(arm, *motion.at(t - base.delay), (), gravity)[1]  # type: ignore[arg-type]
        reading = WrenchMap.of(base).reading(wrench)
        reading += rng.standard_normal(reading.shape) * np.repeat([base.force_noise, base.moment_noise], 3)
    return FreeMotion(t, q, qd, signal, reading, f"simulated recording {seed}")
