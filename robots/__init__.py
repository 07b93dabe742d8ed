"""Description of an arm: kinematics, inertia and surface of each link. Data only, no estimation."""

from contactsense.robots.kinematic_calibration import calibrated
from contactsense.robots.library import UnknownRobotError, from_urdf, known_names, load, names
from contactsense.robots.robot import Inertia, Joint, Link, Robot
from contactsense.robots.yaml_schema import RobotError

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
