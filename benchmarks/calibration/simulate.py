"""Simulated recordings of an exactly known scene: its sensors, friction and payload.

The dynamics are the mock's, which share no code with the estimator's; friction and sensors are implemented
here in NumPy, from the same formulas.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Protocol

import numpy as np

from contactsense import LinkWrenchSensor, Scene
from contactsense.calibration import FreeMotion
from contactsense.robots import Inertia, Link, Robot
from contactsense.robots.tool import join_inertia, move_inertia
from contactsense.scene_model.wrench_map import WrenchMap
from contactsense.service.mock.arm.newton_euler import LinkLoad, inverse_dynamics, link_poses


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
    readings = {}
    for field, own in scene.link_sensors.items():
        late = (q, qd, qdd) if own.delay == 0.0 else motion.at(t - own.delay)
        noise = np.repeat([own.force_noise, own.moment_noise], 3)
        loads = [push.load(arm, t - own.delay, late[0]) for push in pushes]
        readings[field] = _link_reading(scene, field, late, loads)
        readings[field] += noise * rng.standard_normal((len(t), 6))
    return FreeMotion(t, q, qd, signal, reading, f"simulated recording {seed}", link_readings=readings)


def _link_reading(
    scene: Scene, field: str, state: tuple[np.ndarray, np.ndarray, np.ndarray], loads: Sequence[LinkLoad]
) -> np.ndarray:
    """Readings of a sensor within the arm: the base wrench of an arm of which only what the sensor carries
    has a mass and is pushed, moved to the sensor. `state`: positions, velocities, accelerations."""
    arm, sensor = arm_of(scene), scene.link_sensors[field]
    nothing = Inertia(0.0, np.zeros(3), np.zeros((3, 3)))
    bodies = [nothing] * len(arm.links)
    rotation, place = sensor.rotation, np.array(sensor.translation)
    if isinstance(sensor, LinkWrenchSensor):
        mount = arm.link_names.index(sensor.link)
        bodies[mount:] = [link.inertia for link in arm.links[mount:]]
        loads = [load for load in loads if load.link >= mount]
    else:
        assert scene.tool is not None
        mount, loads = len(arm.links) - 1, []
        bodies[mount] = move_inertia(scene.tool.inertia, arm.flange_rotation, arm.flange_translation)
        rotation, place = arm.flange_rotation @ rotation, arm.flange_translation + arm.flange_rotation @ place
    links = tuple(Link(link.name, body) for link, body in zip(arm.links, bodies, strict=True))
    gravity = tuple(float(x) for x in scene.gravity_base)
    _, wrench = inverse_dynamics(replace(arm, links=links), *state, loads, gravity)  # type: ignore[arg-type]
    rotations, origins = link_poses(arm, state[0])
    readings = np.empty_like(wrench)
    for i, (R, o) in enumerate(zip(rotations[mount], origins[mount], strict=True)):
        there = WrenchMap.make(R @ rotation, o + R @ place, sensor.sign_factor, sensor.bias)
        readings[i] = there.reading(wrench[i])
    return readings
