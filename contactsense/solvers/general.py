"""Contacts on smooth convex bodies: quick steps, a careful search for the few wrenches on which they fail, a
sure one for the rest, and what to say where there is no contact."""

from collections.abc import Callable
from functools import lru_cache
from math import sqrt
from types import FunctionType
from typing import Any

from numba import njit

from contactsense.solvers.answer import (
    MISS,
    NOT_CONVERGED,
    OK,
    Answer,
    finish,
    nothing,
    rescaled,
    scaled,
    unit_exponents,
    unusable,
)
from contactsense.solvers.enclose import enclose
from contactsense.solvers.implicit import evaluate
from contactsense.solvers.level import Point, enter_level, entry, onto
from contactsense.solvers.newton import refine
from contactsense.solvers.osculating import approach, gauge_at
from contactsense.solvers.start import first_of_any, straight
from contactsense.solvers.typed import kernel

_FAINT, _HEAVY = 1e-100, 1e100
_PURE = 1e-12
"""Torsion per force and moment below which a wrench that enters nowhere is a force that passes by."""


@kernel
def miss_at(
    size: Any,
    inner: Point,
    fx: float,
    fy: float,
    fz: float,
    mx: float,
    my: float,
    mz: float,
    x: float,
    y: float,
    z: float,
) -> Answer:
    """A miss, at the surface point on the ray from the inner point through (x, y, z), which lies outside."""
    new = onto(size, False, inner, x, y, z)
    x, y, z = new[1], new[2], new[3]
    level = evaluate(size, x, y, z)
    slope = sqrt(level[1] * level[1] + level[2] * level[2] + level[3] * level[3])
    nx, ny, nz = level[1] / slope, level[2] / slope, level[3] / slope
    return finish(MISS, fx, fy, fz, mx, my, mz, x, y, z, nx, ny, nz, 0.0, 0.0, 0.0)


@kernel
def solve_smooth_counted(
    fx: float,
    fy: float,
    fz: float,
    mx: float,
    my: float,
    mz: float,
    size: Any,
    inner: Point,
    extent: Point,
    gauge: bool,
) -> tuple[Answer, int]:
    """`solve_smooth`, and the number of steps of `approach`, `refine` and `enclose` together."""
    status = unusable(fx, fy, fz, mx, my, mz)
    if status != OK:
        return nothing(status), 0
    reach = max(extent[0], extent[1], extent[2])
    lever = reach + sqrt(inner[0] * inner[0] + inner[1] * inner[1] + inner[2] * inner[2])
    large = max(abs(fx), abs(fy), abs(fz))
    e = g = 0
    plain = _FAINT < large < _HEAVY and max(abs(mx), abs(my), abs(mz)) < _HEAVY * large * lever
    if not plain:
        e, g, _ = unit_exponents(fx, fy, fz, mx, my, mz, lever)
        fx, fy, fz, mx, my, mz = scaled(fx, fy, fz, mx, my, mz, e, g, 0)
    found, steps, x, y, z, nx, ny, nz, xi, trace, det = approach(
        size, gauge, inner, extent, fx, fy, fz, mx, my, mz
    )
    if not found:
        found, more, x, y, z, nx, ny, nz, xi, trace, det = refine(
            size, gauge, inner, reach, lever, fx, fy, fz, mx, my, mz, x, y, z
        )
        steps += more
    if not found:
        t = fx * mx + fy * my + fz * mz
        ff = fx * fx + fy * fy + fz * fz
        mm = mx * mx + my * my + mz * mz
        if t * t <= _PURE * _PURE * ff * (mm + lever * lever * ff):
            entered, x, y, z = enter_level(size, inner, reach, fx, fy, fz, mx, my, mz)
            if entered == MISS:
                return rescaled(miss_at(size, inner, fx, fy, fz, mx, my, mz, x, y, z), e, g, 0), steps
        else:
            more, x, y, z = enclose(size, inner, reach, fx, fy, fz, mx, my, mz)
            steps += more
        found, more, x, y, z, nx, ny, nz, xi, trace, det = refine(
            size, gauge, inner, reach, lever, fx, fy, fz, mx, my, mz, x, y, z
        )
        steps += more
    status = OK if found else NOT_CONVERGED
    answer = finish(status, fx, fy, fz, mx, my, mz, x, y, z, nx, ny, nz, xi, trace, det)
    return (answer if plain else rescaled(answer, e, g, 0)), steps


@kernel
def solve_smooth(
    fx: float,
    fy: float,
    fz: float,
    mx: float,
    my: float,
    mz: float,
    size: Any,
    inner: Point,
    extent: Point,
    gauge: bool,
) -> Answer:
    """Contact centroid on a smooth convex body that is given by a function.

    Args:
        fx, fy, fz, mx, my, mz: Wrench on the body.
        size: What the function takes before the point; for the packaged bodies see `implicit.evaluate`.
        inner: A point well inside.
        extent: Half the body's size along each axis, about.
        gauge: Whether the function plus one is homogeneous of degree one about the inner point.

    Returns:
        See `contactsense.solvers.answer`.
    """
    return solve_smooth_counted(fx, fy, fz, mx, my, mz, size, inner, extent, gauge)[0]


@kernel
def wrench_axis_smooth(
    fx: float,
    fy: float,
    fz: float,
    mx: float,
    my: float,
    mz: float,
    size: Any,
    inner: Point,
    extent: Point,
    gauge: bool,
) -> Answer:
    """Where the wrench axis enters such a body; on a miss the point that the line comes nearest to in its
    metric."""
    status = unusable(fx, fy, fz, mx, my, mz)
    if status != OK:
        return nothing(status)
    reach = max(extent[0], extent[1], extent[2])
    e, g, _ = unit_exponents(fx, fy, fz, mx, my, mz, reach)
    fx, fy, fz, mx, my, mz = scaled(fx, fy, fz, mx, my, mz, e, g, 0)
    status, x, y, z = enter_level(size, inner, reach, fx, fy, fz, mx, my, mz)
    if status == OK:
        level = evaluate(size, x, y, z)
        slope = sqrt(level[1] * level[1] + level[2] * level[2] + level[3] * level[3])
        nx, ny, nz = level[1] / slope, level[2] / slope, level[3] / slope
        answer = finish(OK, fx, fy, fz, mx, my, mz, x, y, z, nx, ny, nz, 0.0, 0.0, 0.0)
    else:
        answer = miss_at(size, inner, fx, fy, fz, mx, my, mz, x, y, z)
    return rescaled(answer, e, g, 0)


@lru_cache(maxsize=64)
def solvers_for(function: Callable[..., Any]) -> tuple[Callable[..., Answer], Callable[..., Answer]]:
    """`solve_smooth` and `wrench_axis_smooth` for a compiled function of one's own in place of `evaluate`.

    Numba's cache cannot keep them, so they are compiled once in each process.
    """
    own: dict[str, Any] = {"evaluate": function, "first": first_of_any, "bend": straight}
    for part in (
        entry,
        onto,
        enter_level,
        refine,
        enclose,
        gauge_at,
        approach,
        miss_at,
        solve_smooth_counted,
        solve_smooth,
        wrench_axis_smooth,
    ):
        plain = getattr(part, "py_func", part)
        bound = FunctionType(plain.__code__, {**plain.__globals__, **own}, plain.__name__)
        own[plain.__name__] = njit(error_model="numpy")(bound)
    return own["solve_smooth"], own["wrench_axis_smooth"]
