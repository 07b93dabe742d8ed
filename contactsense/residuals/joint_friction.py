"""Model of the joint torque signal apart from rigid-body dynamics: bias and friction.

Friction is a function of velocity and of the gravity torque that the joint carries; the formula is in
`contactsense.sensors.settings.Friction`. Oil temperature changes it by a factor, which
`contactsense.residuals.bias_filter` estimates. The formula is inaccurate near a reversal and at rest, where a
joint holds any torque up to Coulomb friction. So each joint also has a standard deviation of the model error,
which grows towards rest. That error does not average out at any bandwidth.
"""

import math
from typing import Annotated, NamedTuple

import numpy as np

from contactsense.robots.jit.declaration import Floats
from contactsense.robots.jit.kernel import inlined_kernel
from contactsense.sensors.settings import JointTorqueSensor, per_joint


class JointTorqueModel(NamedTuple):
    """Contents of the joint torque signal. Arrays of shape (n,), for n joints."""

    gravity: float
    """1 if the signal contains gravity, else 0."""
    inertia: float
    """1 if the signal contains inertia and rotors, else 0."""
    bias: Annotated[Floats, "joints"]
    """Reading at zero torque [Nm]."""
    coulomb: Annotated[Floats, "joints"]
    """Coulomb friction [Nm]."""
    load: Annotated[Floats, "joints"]
    """Coulomb friction per gravity torque."""
    viscous: Annotated[Floats, "joints"]
    """Viscous friction [Nm s/rad]."""
    lubricant: Annotated[Floats, "joints"]
    """Friction of the lubricant [Nm]."""
    friction_factor: Annotated[Floats, "joints"]
    """Factor on all of them: 1 in a scene, estimated in a stream."""
    friction_error: Annotated[Floats, "joints"]
    """Standard deviation of that factor between days."""
    rest_variance: Annotated[Floats, "joints"]
    """Variance of the model error at rest, in addition to `model_variance` [Nm^2]."""
    model_variance: Annotated[Floats, "joints"]
    """Variance of the model error at any velocity [Nm^2]."""
    inertia_torque_variance: Annotated[Floats, "joints"]
    """Variance of the model error per square of the inertia torque
    (`contactsense.residuals.inertia_torque`)."""
    average_variance: Annotated[Floats, "joints"]
    """Variance of these errors in the average of the residuals over that in a sample
    (`contactsense.residuals.residual_ewma.share_in_average`)."""
    velocity: float
    """Width of Coulomb friction's smooth sign [rad/s]."""
    lubricant_velocity: float
    """Velocity at which the lubricant's friction saturates [rad/s]."""
    rest_velocity: float
    """Velocity below which `rest_variance` applies [rad/s]."""


def joint_torque_model(sensor: JointTorqueSensor, joints: int) -> JointTorqueModel:
    """Arrays from a scene's setting, for that many joints."""
    f = sensor.friction
    frictional = 0.0 if sensor.contains == "external" else 1.0
    return JointTorqueModel(
        gravity=1.0 if sensor.contains == "motor" else 0.0,
        inertia=frictional,
        bias=per_joint(sensor.bias, joints),
        coulomb=frictional * per_joint(f.coulomb, joints),
        load=frictional * per_joint(f.load, joints),
        viscous=frictional * per_joint(f.viscous, joints),
        lubricant=frictional * per_joint(f.lubricant, joints),
        friction_factor=np.ones(joints),
        friction_error=per_joint(f.error, joints),
        rest_variance=per_joint(f.rest_error, joints) ** 2,
        model_variance=per_joint(sensor.model_error, joints) ** 2,
        inertia_torque_variance=per_joint(sensor.inertia_torque_error, joints) ** 2,
        average_variance=per_joint(sensor.average_error, joints) ** 2,
        velocity=f.velocity,
        lubricant_velocity=f.lubricant_velocity,
        rest_velocity=f.rest_velocity,
    )


@inlined_kernel
def friction_torque(torque_model: JointTorqueModel, j: int, qd: float, gravity_torque: float) -> float:
    """Friction torque of joint j [Nm] at velocity qd [rad/s] and under that gravity torque [Nm]."""
    coulomb, lubricant = (
        torque_model.coulomb[j] + torque_model.load[j] * abs(gravity_torque),
        torque_model.lubricant[j],
    )
    friction = torque_model.viscous[j] * qd
    # Joints without friction skip the hyperbolic tangent.
    if coulomb != 0.0:
        friction += coulomb * math.tanh(qd / torque_model.velocity)
    if lubricant != 0.0:
        friction += lubricant * math.tanh(qd / torque_model.lubricant_velocity)
    return float(torque_model.friction_factor[j] * friction)


@inlined_kernel
def unmodelled_torque_std(torque_model: JointTorqueModel, j: int, qd: float) -> float:
    """Standard deviation of the model error of joint j's torque at velocity qd [rad/s], those of the friction
    factor and of the inertia torque apart [Nm]."""
    x = qd / torque_model.rest_velocity
    return math.sqrt(torque_model.model_variance[j] + torque_model.rest_variance[j] / (1.0 + x * x) ** 2)
