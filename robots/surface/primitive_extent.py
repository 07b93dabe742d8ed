"""How large primitives are, and whether their numbers are in metres."""

from collections.abc import Iterator, Sequence
from itertools import product

import numpy as np

from contactsense.robots.primitives import Box, Capsule, Cylinder, Ellipsoid, Primitive, Sphere
from contactsense.robots.rotations import rotation_from_rpy


def bounds(primitive: Primitive) -> tuple[np.ndarray, np.ndarray]:
    """Lower and upper corner of the box along the axes of its frame that holds a primitive, shapes (3,), (3,)
    [m]."""
    if isinstance(primitive, Sphere):
        centre = np.array(primitive.center)
        return centre - primitive.radius, centre + primitive.radius
    if isinstance(primitive, Capsule):
        ends = np.array((primitive.a, primitive.b))
        return ends.min(axis=0) - primitive.radius, ends.max(axis=0) + primitive.radius
    if isinstance(primitive, Cylinder):
        return _cone_bounds(primitive)
    centre, R = np.array(primitive.center), rotation_from_rpy(primitive.rpy)
    if isinstance(primitive, Ellipsoid):
        reach = np.linalg.norm(R * np.array(primitive.radii), axis=1)
        return centre - reach, centre + reach
    assert isinstance(primitive, Box)
    corners = np.array(list(product((-1.0, 1.0), repeat=3))) * np.array(primitive.half) @ R.T + centre
    return corners.min(axis=0), corners.max(axis=0)


def _cone_bounds(cone: Cylinder) -> tuple[np.ndarray, np.ndarray]:
    """Bounds of the rounded cone: the sharp rim of a flat one may be metres away."""
    a, b = np.array(cone.a), np.array(cone.b)
    axis = (b - a) / np.linalg.norm(b - a)
    half, radius_a, radius_b = cone.core()
    ends = (a + b) / 2.0 + np.outer((-half, half), axis)
    # A disc of radius 1 reaches so far along each axis of the frame.
    disc = np.sqrt(np.clip(1.0 - axis**2, 0.0, None))
    reach = np.array((radius_a, radius_b))[:, None] * disc + cone.rounding
    return (ends - reach).min(axis=0), (ends + reach).max(axis=0)


def extent(primitives: Sequence[Primitive]) -> np.ndarray:
    """Edge lengths of the box along the axes of their frame that holds all primitives, shape (3,) [m]."""
    lower, upper = zip(*map(bounds, primitives), strict=True)
    return np.asarray(np.max(upper, axis=0) - np.min(lower, axis=0))


def beyond(primitives: Sequence[Primitive], most: float, thickest: float = 0.0) -> Iterator[tuple[int, str]]:
    """Primitives so far from their frame, or so large, that their numbers may be millimetres.

    Args:
        primitives: Of one frame.
        most: Largest usual distance from the frame, and largest usual size [m].
        thickest: What is no thicker may be larger, such as a floor [m].

    Yields:
        The index of each of them, and what was expected and what was given.
    """
    for i, primitive in enumerate(primitives):
        lower, upper = bounds(primitive)
        # The distance of the box from the frame's origin; 0 if the origin is in it.
        distance = float(np.linalg.norm(np.maximum(np.maximum(lower, -upper), 0.0)))
        size = float(np.max(upper - lower)) if np.min(upper - lower) > thickest else 0.0
        if max(distance, size) > most:
            what = f"a size of {size:.4g} m" if size > most else f"a distance of {distance:.4g} m"
            yield (i, f"expected at most {most:g} m from its frame and in size, got {what}; are these mm?")
