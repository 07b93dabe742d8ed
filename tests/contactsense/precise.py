"""A scene of hardly any noise, so that constructed truth is found to fractions of a millimetre."""

from contactsense import JointTorqueSensor, Scene, WrenchSensor
from tests.plain_arm import plain_ur5e

PRECISE = Scene(
    robot=plain_ur5e(),
    base_wrench=WrenchSensor(force_noise=0.002, moment_noise=0.0004),
    joint_torque=JointTorqueSensor(noise=0.002),
    surface_error=1e-4,
)
