"""Contacts on smooth convex bodies.

A fast iteration, Newton's method with a line search for the few wrenches on which it fails, the ellipsoid
method for the remaining ones, and the answer if there is no contact.
"""

from collections.abc import Callable
from functools import lru_cache
from math import ldexp, sqrt
from types import FunctionType
from typing import Any

from numba import njit

from contactsense.solvers.ellipsoid_method import bracket_contact
from contactsense.solvers.implicit_surfaces import (
    evaluate,
    resized,
    unit_exponent,
    unresized,
    unscaled_exponent,
)
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
    invariant,
    make_answer,
    no_contact,
    rescaled,
    scaled,
    unit_exponents,
)
from contactsense.solvers.typed_kernel import kernel

_FAINT, _HEAVY = 1e-30, 1e30


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
def _resized(point: Point, k: int) -> Point:
    """A point in the unit of length 2^k."""
    return ldexp(point[0], -k), ldexp(point[1], -k), ldexp(point[2], -k)


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
    k = unit_exponent(size, reach)
    if k != 0:
        size, inner, extent, reach = (
            resized(size, k),
            _resized(inner, k),
            _resized(extent, k),
            ldexp(reach, -k),
        )
    lever = reach + sqrt(inner[0] * inner[0] + inner[1] * inner[1] + inner[2] * inner[2])
    large = max(abs(fx), abs(fy), abs(fz))
    e = g = 0
    plain = k == 0 and _FAINT < large < _HEAVY and max(abs(mx), abs(my), abs(mz)) < _HEAVY * large * lever
    if not plain:
        e, g, _ = unit_exponents(fx, fy, fz, mx, my, mz, ldexp(lever, k))
        fx, fy, fz, mx, my, mz = scaled(fx, fy, fz, mx, my, mz, e, g, k)
    converged, steps, x, y, z, nx, ny, nz, xi, trace, det = osculating_iteration(
        size, gauge, inner, extent, fx, fy, fz, mx, my, mz
    )
    if not converged:
        converged, extra_steps, x, y, z, nx, ny, nz, xi, trace, det = newton_iteration(
            size, gauge, inner, reach, lever, fx, fy, fz, mx, my, mz, x, y, z
        )
        steps += extra_steps
    if not converged:
        if invariant(fx, fy, fz, mx, my, mz) == 0.0:
            entered, x, y, z = enter_level(size, inner, reach, fx, fy, fz, mx, my, mz)
            if entered == MISS:
                return rescaled(miss_at(size, inner, fx, fy, fz, mx, my, mz, x, y, z), e, g, k), steps
        else:
            extra_steps, x, y, z = bracket_contact(size, inner, reach, fx, fy, fz, mx, my, mz)
            steps += extra_steps
        converged, extra_steps, x, y, z, nx, ny, nz, xi, trace, det = newton_iteration(
            size, gauge, inner, reach, lever, fx, fy, fz, mx, my, mz, x, y, z
        )
        steps += extra_steps
    status = OK if converged else NOT_CONVERGED
    answer = make_answer(status, fx, fy, fz, mx, my, mz, x, y, z, nx, ny, nz, xi, trace, det)
    return (answer if plain else rescaled(answer, e, g, k)), steps


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
    k = unit_exponent(size, reach)
    e, g, _ = unit_exponents(fx, fy, fz, mx, my, mz, reach)
    size, inner, reach = resized(size, k), _resized(inner, k), ldexp(reach, -k)
    fx, fy, fz, mx, my, mz = scaled(fx, fy, fz, mx, my, mz, e, g, k)
    status, x, y, z = enter_level(size, inner, reach, fx, fy, fz, mx, my, mz)
    if status == OK:
        level = evaluate(size, x, y, z)
        slope = sqrt(level[1] * level[1] + level[2] * level[2] + level[3] * level[3])
        nx, ny, nz = level[1] / slope, level[2] / slope, level[3] / slope
        answer = make_answer(OK, fx, fy, fz, mx, my, mz, x, y, z, nx, ny, nz, 0.0, 0.0, 0.0)
    else:
        answer = miss_at(size, inner, fx, fy, fz, mx, my, mz, x, y, z)
    return rescaled(answer, e, g, k)


@lru_cache(maxsize=64)
def solvers_for(function: Callable[..., Any]) -> tuple[Callable[..., Answer], Callable[..., Answer]]:
    """`solve_smooth` and `wrench_axis_smooth` for a user's compiled function instead of `evaluate`.

    Numba cannot cache them, so they are compiled once in each process.
    """
    own: dict[str, Any] = {
        "evaluate": function,
        "initial_guess": ellipsoid_guess,
        "warped_step": unmodified_step,
        "unit_exponent": unscaled_exponent,
        "resized": unresized,
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
