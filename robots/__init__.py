"""What an arm is: kinematics, inertia and surface of each link. Data, no estimation."""

from robots.robot import Inertia, Joint, Link, Robot

__all__ = ["Inertia", "Joint", "Link", "Robot"]
