"""Whether places and angles can be in m and rad."""

from math import isfinite, pi, radians

Vector = tuple[float, float, float]

FURTHEST = 5.0
"""Largest coordinate of a place on an arm in the frame of its link, and largest size of a primitive that can
be touched [m]."""
FURTHEST_BODY = 50.0
"""Largest coordinate of the frame of a body of the cell, and of what is fixed in a URDF, such as an arm in a
hall [m]."""
_ONE_TURN = 2.0 * pi + 0.01
"""One turn that was rounded, such as 6.2832, is still one turn [rad]."""


def within_one_turn(rpy: Vector) -> Vector:
    """Roll, pitch, yaw [rad] as they are.

    Raises:
        ValueError: an angle is larger than one turn, as angles in degrees are.
    """
    if not all(abs(angle) <= _ONE_TURN for angle in rpy):
        in_radians = ", ".join(f"{radians(angle):.4g}" for angle in rpy)
        meant = f"; if these are degrees: [{in_radians}]" if all(map(isfinite, rpy)) else ""
        raise ValueError(
            f"expected roll, pitch, yaw in rad, none above one turn (6.283), got {list(rpy)}{meant}"
        )
    return rpy


def in_metres(place: Vector, furthest: float = FURTHEST) -> Vector:
    """A place [m] as it is; by default one on the arm.

    Raises:
        ValueError: a coordinate is above `furthest` [m], as coordinates in mm are.
    """
    if not all(abs(x) <= furthest for x in place):
        in_mm = ", ".join(f"{1e-3 * x:.4g}" for x in place)
        meant = f"; if these are mm: [{in_mm}]" if all(map(isfinite, place)) else ""
        raise ValueError(f"expected x, y, z in m, none above {furthest:g}, got {list(place)}{meant}")
    return place
