"""What the joints' drives put into the torque signal beside the arm's own dynamics: bias and friction.

Friction is a function of velocity and of the gravity torque that the joint carries; the formula is in
`contactsense.sensing.Friction`. It is never right near a reversal and at rest, where a joint holds any torque
up to Coulomb friction; so each joint also has a standard deviation of what is left unexplained, which grows
towards rest. That part does not average out, however low the bandwidth.
"""

import math
from typing import NamedTuple

import numpy as np

from contactsense.sensing import JointTorqueSensor, per_joint
from robots.compiled import kernel


class Drive(NamedTuple):
    """What a joint torque signal contains. Arrays of shape (n,), for n joints."""

    gravity: float
    """1 if the signal contains gravity, else 0."""
    inertia: float
    """1 if the signal contains inertia and rotors, else 0."""
    bias: np.ndarray
    """What is read without any torque [Nm]."""
    coulomb: np.ndarray
    """Coulomb friction [Nm]."""
    load: np.ndarray
    """Coulomb friction per gravity torque."""
    viscous: np.ndarray
    """Viscous friction [Nms/rad]."""
    lubricant: np.ndarray
    """Friction of the lubricant [Nm]."""
    friction_error: np.ndarray
    """Relative error of friction, standard deviation."""
    rest_variance: np.ndarray
    """Variance of what is unexplained at rest, beyond `model_variance` [Nm^2]."""
    model_variance: np.ndarray
    """Variance of what is unexplained at any velocity [Nm^2]."""
    velocity: float
    """Width of Coulomb friction's smooth sign [rad/s]."""
    lubricant_velocity: float
    """Velocity at which the lubricant's friction levels off [rad/s]."""
    rest_velocity: float
    """Velocity below which `rest_variance` counts [rad/s]."""


def make_drive(sensor: JointTorqueSensor, joints: int) -> Drive:
    """Arrays of a scene's setting, for that many joints."""
    f = sensor.friction
    frictional = 0.0 if sensor.contains == "external" else 1.0
    return Drive(
        gravity=1.0 if sensor.contains == "motor" else 0.0,
        inertia=frictional,
        bias=per_joint(sensor.bias, joints),
        coulomb=frictional * per_joint(f.coulomb, joints),
        load=frictional * per_joint(f.load, joints),
        viscous=frictional * per_joint(f.viscous, joints),
        lubricant=frictional * per_joint(f.lubricant, joints),
        friction_error=per_joint(f.error, joints),
        rest_variance=per_joint(f.rest_error, joints) ** 2,
        model_variance=per_joint(sensor.model_error, joints) ** 2,
        velocity=f.velocity,
        lubricant_velocity=f.lubricant_velocity,
        rest_velocity=f.rest_velocity,
    )


@kernel
def friction_torque(drive: Drive, j: int, qd: float, gravity_torque: float) -> float:
    """Torque that friction takes from joint j's actuator at velocity qd [rad/s], under that gravity torque
    [Nm]."""
    dry, wet = drive.coulomb[j] + drive.load[j] * abs(gravity_torque), drive.lubricant[j]
    friction = drive.viscous[j] * qd
    # A drive without friction is not to pay for it.
    if dry != 0.0:
        friction += dry * math.tanh(qd / drive.velocity)
    if wet != 0.0:
        friction += wet * math.tanh(qd / drive.lubricant_velocity)
    return float(friction)


@kernel
def unexplained(drive: Drive, j: int, qd: float, friction: float) -> float:
    """Standard deviation of what model and friction leave of joint j's torque [Nm].

    Args:
        drive, j: The joint.
        qd: Its velocity [rad/s].
        friction: What `friction_torque` says of it [Nm].
    """
    x = qd / drive.rest_velocity
    changed = drive.friction_error[j] * friction
    rest = drive.rest_variance[j] / (1.0 + x * x) ** 2
    return math.sqrt(drive.model_variance[j] + rest + changed * changed)
