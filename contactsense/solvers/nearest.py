"""The surface point nearest to a force's line: what a miss answers."""

from collections.abc import Callable
from math import sqrt
from typing import Any

from numba import njit

from contactsense.solvers.answer import MISS, Answer, finish

Projection = Callable[..., tuple[float, float, float, float, float, float, float]]
"""Compiled: (size of a body..., x, y, z) -> signed distance, nearest surface point, outward normal there."""

_HALVINGS = 60


# Not cached by itself: a compiled function among the arguments defeats numba's cache; the callers are cached.
@njit(error_model="numpy")
def nearest_to_line(
    project: Projection,
    size: Any,
    reach: float,
    fx: float,
    fy: float,
    fz: float,
    mx: float,
    my: float,
    mz: float,
) -> Answer:
    """A miss, at the surface point nearest to the line of the force.

    Distance to a convex body is convex along a line, so its slope, normal times direction, is bisected.

    Args:
        project: Projection on the body.
        size: First argument of `project`.
        reach: Radius of a ball about the origin that holds the body.
        fx, fy, fz, mx, my, mz: Wrench on the body, force not zero, of ordinary size.
    """
    force = sqrt(fx * fx + fy * fy + fz * fz)
    dx, dy, dz = fx / force, fy / force, fz / force
    px, py, pz = (dy * mz - dz * my) / force, (dz * mx - dx * mz) / force, (dx * my - dy * mx) / force
    low, high = -2.0 * reach, 2.0 * reach
    for _ in range(_HALVINGS):
        at = 0.5 * (low + high)
        _, _, _, _, nx, ny, nz = project(size, px + at * dx, py + at * dy, pz + at * dz)
        if nx * dx + ny * dy + nz * dz > 0.0:
            high = at
        else:
            low = at
    at = 0.5 * (low + high)
    _, cx, cy, cz, nx, ny, nz = project(size, px + at * dx, py + at * dy, pz + at * dz)
    return finish(MISS, fx, fy, fz, mx, my, mz, cx, cy, cz, nx, ny, nz, 0.0, 0.0, 0.0)
