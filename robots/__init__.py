"""What an arm is: kinematics, inertia and surface of each link. Data, no estimation."""

from robots.calibrate import calibrated
from robots.library import UnknownRobotError, from_urdf, load, names
from robots.robot import Inertia, Joint, Link, Robot
from robots.schema import RobotError

__all__ = [
    "Inertia",
    "Joint",
    "Link",
    "Robot",
    "RobotError",
    "UnknownRobotError",
    "calibrated",
    "from_urdf",
    "load",
    "names",
]
