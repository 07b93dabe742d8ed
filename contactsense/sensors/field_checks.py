"""Checks of the fields of a scene."""

from math import pi, radians

from contactsense.robots.primitives import Vector

FURTHEST = 5.0
"""Largest coordinate of a sensor's origin or of a tool's centre of mass [m]."""
LATEST = 0.5
"""Largest delay of a sensor [s]."""


def within_one_turn(rpy: Vector) -> Vector:
    """Roll, pitch, yaw [rad] as they are.

    Raises:
        ValueError: an angle is larger than one turn, as angles in degrees are.
    """
    if max(map(abs, rpy)) > 2.0 * pi:
        in_radians = ", ".join(f"{radians(angle):.4g}" for angle in rpy)
        raise ValueError(
            "expected roll, pitch, yaw in rad, none above one turn (6.283), got "
            f"{list(rpy)}; if these are degrees: [{in_radians}]"
        )
    return rpy


def in_metres(place: Vector) -> Vector:
    """A place on the arm [m] as it is.

    Raises:
        ValueError: a coordinate is beyond any arm, as coordinates in mm are.
    """
    if max(map(abs, place)) > FURTHEST:
        raise ValueError(
            f"expected x, y, z in m, none above {FURTHEST:g}, got {list(place)}; "
            f"if these are mm: [{', '.join(f'{1e-3 * x:.4g}' for x in place)}]"
        )
    return place


def in_seconds(delay: float) -> float:
    """A delay of a sensor [s] as it is.

    Raises:
        ValueError: it is beyond any sensor, as delays in ms are.
    """
    if abs(delay) > LATEST:
        raise ValueError(
            f"expected s, none above {LATEST:g}, got {delay:g}; if this is ms: {1e-3 * delay:.4g}"
        )
    return delay
