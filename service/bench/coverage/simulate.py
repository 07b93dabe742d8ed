"""Simulated recordings of a scene that is known exactly: its sensors, its friction, its payload.

The dynamics are the mock's, which share no line with the estimator's; friction and sensors are written here
in NumPy, from the same formulas.
"""

from dataclasses import replace

import numpy as np

from contactsense import Scene
from contactsense.calibration import Stretch
from contactsense.calibration.harmonics import Harmonics
from robots import Link, Robot
from robots.tool import join_inertia, move_inertia
from service.mock.dynamics import inverse_dynamics
from service.sensors.mapping import WrenchMap


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
    motion: Harmonics,
    seed: int,
    rate: float = 500.0,
    gain: np.ndarray | None = None,
) -> Stretch:
    """What the sensors of `scene` would read over a motion.

    Args:
        scene: The truth, with its sensors' noise; model errors are not simulated.
        motion: What the arm does.
        seed: Of the noise.
        rate: Samples a second [Hz].
        gain: True over stated torque constants, shape (n,); without it, they are right.
    """
    chance = np.random.default_rng(seed)
    t = np.arange(0.0, motion.period, 1.0 / rate)
    q, qd, qdd = motion.at(t)
    arm, gravity = arm_of(scene), tuple(float(x) for x in scene.gravity_base)
    torque, wrench = inverse_dynamics(arm, q, qd, qdd, (), gravity)  # type: ignore[arg-type]
    reading = read = None
    if scene.joint_torque is not None:
        still, _ = inverse_dynamics(arm, q, 0.0 * q, 0.0 * q, (), gravity)  # type: ignore[arg-type]
        sensor, f = scene.joint_torque, scene.joint_torque.friction
        dry = np.array(f.coulomb) + np.array(f.load) * np.abs(still)
        rub = dry * np.tanh(qd / f.velocity) + np.array(f.viscous) * qd
        rub += np.array(f.lubricant) * np.tanh(qd / f.lubricant_velocity)
        parts = {"motor": torque + rub, "gravity_free": torque - still + rub, "external": 0.0 * torque}
        read = parts[sensor.contains] + np.array(sensor.bias)
        read += np.array(sensor.noise) * chance.standard_normal(q.shape)
        read /= 1.0 if gain is None else gain
    if scene.base_wrench is not None:
        base = scene.base_wrench
        if base.delay != 0.0:
            wrench = inverse_dynamics(arm, *motion.at(t - base.delay), (), gravity)[1]  # type: ignore[arg-type]
        reading = WrenchMap.of(base).reading(wrench)
        reading += chance.standard_normal(reading.shape) * np.repeat([base.force_noise, base.moment_noise], 3)
    return Stretch(t, q, qd, read, reading, f"simulated recording {seed}")
