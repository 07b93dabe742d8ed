"""Whether a robot that was built in Python can be an arm: what its files would be refused for."""

from collections import Counter
from collections.abc import Callable, Sequence
from math import inf, isnan, pi, radians

import numpy as np

from contactsense.robots.principal_moments import check_principal_moments
from contactsense.robots.robot import Inertia, Joint, Robot
from contactsense.robots.units import FURTHEST, FURTHEST_BODY, in_metres

MOST_RADIANS, PLACEHOLDER = 10.0 * pi, 1000.0
"""Limits of a joint between these are in degrees; larger ones are an exporter's for none [rad]."""
LIGHT = 1e-3
"""The inertia of a lighter link is a placeholder [kg]."""
_ROUNDING = 1e-3
"""Of a rotation matrix and of a tensor whose components were rounded, relative."""


def check_arm(robot: Robot) -> None:
    """Check joints, links and flange of an arm.

    Raises:
        ValueError: the first that is wrong; the message names it, what was expected and what was given.
    """
    if not robot.joints:
        raise ValueError("joints: expected at least one, got none")
    for kind, names in (("links", robot.link_names), ("joints", [joint.name for joint in robot.joints])):
        name, times = Counter(names).most_common(1)[0]
        if times > 1 or "" in names:
            got = f"{name!r} {times} times" if times > 1 else "an empty one"
            raise ValueError(f"{kind}: expected names, each once, got {got}")
    for number, joint in enumerate(robot.joints):
        _within(f"joint {joint.name}", _check_joint, joint, _furthest(number))
    for number, link in enumerate(robot.links):
        _within(f"link {link.name}", _check_inertia, link.inertia, _furthest(number))
    _within("flange", _check_pose, robot.flange_rotation, robot.flange_translation, FURTHEST)


def _furthest(number: int) -> float:
    """Largest coordinate in the frame of a link: the base may be a whole hall."""
    return FURTHEST if number > 0 else FURTHEST_BODY


def _within(place: str, check: Callable[..., object], *arguments: object) -> None:
    """A check whose message begins with the place."""
    try:
        check(*arguments)
    except ValueError as error:
        raise ValueError(f"{place}: {error}") from None


def _check_joint(joint: Joint, furthest: float) -> None:
    _check_pose(joint.rotation, joint.translation, furthest)
    _check_limits(joint.position_limits)
    for name in ("velocity_limit", "torque_limit"):
        limit = getattr(joint, name)
        if not _is_number(limit) or not limit > 0.0:
            raise ValueError(
                f"{name}: expected a number above 0, or infinity if it is unknown, got {limit!r}"
            )
    if not _is_number(joint.rotor_inertia) or not 0.0 <= joint.rotor_inertia < inf:
        raise ValueError(f"rotor_inertia: expected a number of at least 0, got {joint.rotor_inertia!r}")
    constant = joint.torque_constant
    if constant is not None and not (_is_number(constant) and 0.0 < constant < inf):
        raise ValueError(f"torque_constant: expected a number above 0, or None, got {constant!r}")


def _check_limits(limits: Sequence[float]) -> None:
    if np.shape(limits) != (2,) or not all(map(_is_number, limits)) or not limits[0] <= limits[1]:
        raise ValueError(f"position_limits: expected two angles, the lower first, got {limits!r}")
    largest = max(-limits[0], limits[1])
    if MOST_RADIANS < largest < PLACEHOLDER:
        low, high = (f"{radians(limit):.4g}" for limit in limits)
        raise ValueError(
            f"position_limits: expected rad, none above {MOST_RADIANS:.4g}, got {limits!r}; if these are "
            f"degrees: ({low}, {high})"
        )


def _check_pose(rotation: np.ndarray, translation: np.ndarray, furthest: float) -> None:
    is_turn = np.abs(rotation @ rotation.T - np.eye(3)).max() < _ROUNDING and np.linalg.det(rotation) > 0.0
    if not is_turn:
        raise ValueError(f"rotation: expected a rotation matrix, got {rotation.tolist()}")
    x, y, z = translation.tolist()
    _within("translation", in_metres, (x, y, z), furthest)


def _check_inertia(inertia: Inertia, furthest: float) -> None:
    x, y, z = inertia.com.tolist()
    _within("com", in_metres, (x, y, z), furthest)
    tensor = inertia.tensor
    if np.abs(tensor - tensor.T).max() > _ROUNDING * np.abs(tensor).max():
        raise ValueError(f"tensor: expected a symmetric matrix, got {tensor.tolist()}")
    if inertia.mass > LIGHT:
        _within("tensor", check_principal_moments, tensor)


def _is_number(value: object) -> bool:
    return isinstance(value, float | int | np.floating | np.integer) and not isnan(value)
