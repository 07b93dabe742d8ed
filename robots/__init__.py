"""What an arm is: kinematics, inertia and surface of each link. Data, no estimation."""

from robots.library import UnknownRobotError, load, names
from robots.robot import Inertia, Joint, Link, Robot
from robots.schema import RobotError

__all__ = ["Inertia", "Joint", "Link", "Robot", "RobotError", "UnknownRobotError", "load", "names"]
