"""Errors in the description of an arm, and in what belongs to it: meshes, tools, kinematic calibrations."""


class RobotError(ValueError):
    """An invalid description of a robot: the message names the file, the element and the error."""


class SurfaceFileError(RobotError):
    """A `.surface.yaml` is missing or wrong, or does not belong to the robot."""


class UnknownRobotError(RobotError):
    """A name that is not in the library; the message lists the available names."""
