"""Contacts on smooth convex bodies.

A fast iteration, Newton's method with a line search for the few wrenches on which it fails, the ellipsoid
method for the remaining ones, and the answer if there is no contact.
"""

from collections.abc import Callable
from functools import lru_cache
from math import sqrt
from types import FunctionType
from typing import Any

from numba import njit

from contactsense.solvers.ellipsoid_method import bracket_contact
from contactsense.solvers.implicit_surfaces import evaluate
from contactsense.solvers.initial_guess import ellipsoid_guess, unmodified_step
from contactsense.solvers.level_set import Point, enter_level, line_entry, ray_entry
from contactsense.solvers.newton import newton_iteration
from contactsense.solvers.osculating import gauge_at, osculating_iteration
from contactsense.solvers.solution import (
    MISS,
    NOT_CONVERGED,
    OK,
    Answer,
    input_status,
    make_answer,
    no_contact,
    rescaled,
    scaled,
    unit_exponents,
)
from contactsense.solvers.typed_kernel import kernel

_FAINT, _HEAVY = 1e-100, 1e100
_ZERO_TORSION = 1e-12
"""Torsion per force and moment below which a wrench that misses counts as a pure force."""


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
    new = ray_entry(size, False, inner, x, y, z)
    x, y, z = new[1], new[2], new[3]
    level = evaluate(size, x, y, z)
    slope = sqrt(level[1] * level[1] + level[2] * level[2] + level[3] * level[3])
    nx, ny, nz = level[1] / slope, level[2] / slope, level[3] / slope
    return make_answer(MISS, fx, fy, fz, mx, my, mz, x, y, z, nx, ny, nz, 0.0, 0.0, 0.0)


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
    """`solve_smooth`, and the total number of steps of its iterations."""
    status = input_status(fx, fy, fz, mx, my, mz)
    if status != OK:
        return no_contact(status), 0
    reach = max(extent[0], extent[1], extent[2])
    lever = reach + sqrt(inner[0] * inner[0] + inner[1] * inner[1] + inner[2] * inner[2])
    large = max(abs(fx), abs(fy), abs(fz))
    e = g = 0
    plain = _FAINT < large < _HEAVY and max(abs(mx), abs(my), abs(mz)) < _HEAVY * large * lever
    if not plain:
        e, g, _ = unit_exponents(fx, fy, fz, mx, my, mz, lever)
        fx, fy, fz, mx, my, mz = scaled(fx, fy, fz, mx, my, mz, e, g, 0)
    converged, steps, x, y, z, nx, ny, nz, xi, trace, det = osculating_iteration(
        size, gauge, inner, extent, fx, fy, fz, mx, my, mz
    )
    if not converged:
        converged, extra_steps, x, y, z, nx, ny, nz, xi, trace, det = newton_iteration(
            size, gauge, inner, reach, lever, fx, fy, fz, mx, my, mz, x, y, z
        )
        steps += extra_steps
    if not converged:
        t = fx * mx + fy * my + fz * mz
        ff = fx * fx + fy * fy + fz * fz
        mm = mx * mx + my * my + mz * mz
        if t * t <= _ZERO_TORSION * _ZERO_TORSION * ff * (mm + lever * lever * ff):
            entered, x, y, z = enter_level(size, inner, reach, fx, fy, fz, mx, my, mz)
            if entered == MISS:
                return rescaled(miss_at(size, inner, fx, fy, fz, mx, my, mz, x, y, z), e, g, 0), steps
        else:
            extra_steps, x, y, z = bracket_contact(size, inner, reach, fx, fy, fz, mx, my, mz)
            steps += extra_steps
        converged, extra_steps, x, y, z, nx, ny, nz, xi, trace, det = newton_iteration(
            size, gauge, inner, reach, lever, fx, fy, fz, mx, my, mz, x, y, z
        )
        steps += extra_steps
    status = OK if converged else NOT_CONVERGED
    answer = make_answer(status, fx, fy, fz, mx, my, mz, x, y, z, nx, ny, nz, xi, trace, det)
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
        See `contactsense.solvers.solution`.
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
    """Point where the wrench axis enters such a body; on a miss the nearest point in its metric."""
    status = input_status(fx, fy, fz, mx, my, mz)
    if status != OK:
        return no_contact(status)
    reach = max(extent[0], extent[1], extent[2])
    e, g, _ = unit_exponents(fx, fy, fz, mx, my, mz, reach)
    fx, fy, fz, mx, my, mz = scaled(fx, fy, fz, mx, my, mz, e, g, 0)
    status, x, y, z = enter_level(size, inner, reach, fx, fy, fz, mx, my, mz)
    if status == OK:
        level = evaluate(size, x, y, z)
        slope = sqrt(level[1] * level[1] + level[2] * level[2] + level[3] * level[3])
        nx, ny, nz = level[1] / slope, level[2] / slope, level[3] / slope
        answer = make_answer(OK, fx, fy, fz, mx, my, mz, x, y, z, nx, ny, nz, 0.0, 0.0, 0.0)
    else:
        answer = miss_at(size, inner, fx, fy, fz, mx, my, mz, x, y, z)
    return rescaled(answer, e, g, 0)


@lru_cache(maxsize=64)
def solvers_for(function: Callable[..., Any]) -> tuple[Callable[..., Answer], Callable[..., Answer]]:
    """`solve_smooth` and `wrench_axis_smooth` for a user's compiled function instead of `evaluate`.

    Numba cannot cache them, so they are compiled once in each process.
    """
    own: dict[str, Any] = {
        "evaluate": function,
        "initial_guess": ellipsoid_guess,
        "warped_step": unmodified_step,
    }
    for part in (
        line_entry,
        ray_entry,
        enter_level,
        newton_iteration,
        bracket_contact,
        gauge_at,
        osculating_iteration,
        miss_at,
        solve_smooth_counted,
        solve_smooth,
        wrench_axis_smooth,
    ):
        plain = getattr(part, "py_func", part)
        bound = FunctionType(plain.__code__, {**plain.__globals__, **own}, plain.__name__)
        own[plain.__name__] = njit(error_model="numpy")(bound)
    return own["solve_smooth"], own["wrench_axis_smooth"]
