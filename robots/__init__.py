"""Description of an arm: kinematics, inertia and surface of each link. Data only, no estimation."""

from contactsense.robots.errors import RobotError, UnknownRobotError
from contactsense.robots.kinematic_calibration import calibrated
from contactsense.robots.library import from_urdf, known_names, load, names
from contactsense.robots.robot import Inertia, Joint, Link, Robot

__all__ = [
    "Inertia",
    "Joint",
    "Link",
    "Robot",
    "RobotError",
    "UnknownRobotError",
    "calibrated",
    "from_urdf",
    "known_names",
    "load",
    "names",
]
