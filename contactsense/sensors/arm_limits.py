"""Whether what a scene states of links and drives can be that of its arm."""

from contactsense.robots import Robot
from contactsense.robots.units import in_metres
from contactsense.sensors.field_checks import lighter_than, of_its_mass
from contactsense.sensors.settings import JointTorqueSensor, LinkInertia, per_joint


def in_this_arm(robot: Robot, link: str, inertia: LinkInertia) -> None:
    """Check the inertia that a scene states of one link.

    Args:
        robot: The arm.
        link: Name of the link.
        inertia: What the scene states.

    Raises:
        ValueError: It is beyond that of a part of this arm; the message names the field.
    """
    field = "com"
    try:
        in_metres(inertia.com)
        field = "mass"
        lighter_than(robot.mass, inertia.mass)
        field = "tensor"
        of_its_mass(inertia.mass, inertia.tensor)
    except ValueError as error:
        raise ValueError(f"inertia.{link}.{field}: {error}") from None


def within_the_joints(robot: Robot, sensor: JointTorqueSensor) -> None:
    """Check the friction and the bias of the joint torques.

    Args:
        robot: The arm.
        sensor: With one value for all joints, or one for each.

    Raises:
        ValueError: A joint could not move against its friction, or not reach its bias; the message names the
            field.
    """
    friction = sensor.friction
    for field, value in (
        ("friction.coulomb", friction.coulomb),
        ("friction.lubricant", friction.lubricant),
        ("friction.rest_error", friction.rest_error),
        ("bias", sensor.bias),
    ):
        for joint, torque in zip(robot.joints, per_joint(value, len(robot.joints)), strict=True):
            if abs(torque) >= joint.torque_limit:
                raise ValueError(
                    f"joint_torque.{field}: expected Nm, less than the {joint.torque_limit:g} of "
                    f"{joint.name}, got {torque:g}"
                )
