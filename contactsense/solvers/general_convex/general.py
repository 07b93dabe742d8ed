"""Contacts on smooth convex bodies.

A fast iteration, Newton's method with a line search for the few wrenches on which it fails, the ellipsoid
method for the remaining ones, and the answer if there is no contact.
"""

from collections.abc import Callable
from functools import lru_cache
from math import ldexp
from types import FunctionType
from typing import Any

from numba import njit

from contactsense.robots.jit.kernel import kernel
from contactsense.robots.vectors import Vector, divide, norm
from contactsense.solvers.general_convex.ellipsoid_method import bracket_contact
from contactsense.solvers.general_convex.implicit_surfaces import (
    resized,
    unit_exponent,
    unresized,
    unscaled_exponent,
)
from contactsense.solvers.general_convex.initial_guess import ellipsoid_guess, unmodified_step
from contactsense.solvers.general_convex.level_set import (
    SmoothBody,
    body_in_unit,
    enter_level,
    level_at,
    line_entry,
    ray_entry,
    reach_of,
)
from contactsense.solvers.general_convex.newton import newton_iteration
from contactsense.solvers.general_convex.osculating import gauge_at, osculating_iteration
from contactsense.solvers.solution import (
    MISS,
    NOT_CONVERGED,
    OK,
    Answer,
    input_status,
    make_answer,
    no_contact,
)
from contactsense.solvers.units import Units, from_units, to_units, units_for
from contactsense.solvers.wrench import Wrench, invariant

_FAINT, _HEAVY = 1e-30, 1e30


@kernel
def _without_torsion(status: int, body: SmoothBody, wrench: Wrench, point: Vector) -> Answer:
    """Answer at a surface point, as if there were no torsion."""
    gradient = level_at(body.size, point).gradient
    n = divide(gradient, norm(gradient))
    return make_answer(status, wrench, point, n, 0.0, 0.0, 0.0)


@kernel
def _miss_at(body: SmoothBody, wrench: Wrench, outside: Vector) -> Answer:
    """A miss, at the surface point on the ray from the inner point through a point outside."""
    # Not as a gauge, whose point on the surface is less exact.
    plain = SmoothBody(body.size, body.inner, body.extent, False)
    return _without_torsion(MISS, body, wrench, ray_entry(plain, outside).point)


@kernel
def solve_smooth_counted(wrench: Wrench, body: SmoothBody) -> tuple[Answer, int]:
    """`solve_smooth`, and the total number of steps of its iterations."""
    status = input_status(wrench)
    if status != OK:
        return no_contact(status), 0
    k = unit_exponent(body.size, reach_of(body))
    if k != 0:
        body = body_in_unit(body, resized(body.size, k), k)
    lever = reach_of(body) + norm(body.inner)
    f, m = wrench
    large = max(abs(f[0]), abs(f[1]), abs(f[2]))
    moment = max(abs(m[0]), abs(m[1]), abs(m[2]))
    units = Units(0, 0, 0)
    if not (k == 0 and _FAINT < large < _HEAVY and moment < _HEAVY * large * lever):
        scaled = units_for(wrench, ldexp(lever, k))
        units = Units(scaled.force, scaled.moment, k)
        wrench = to_units(wrench, units)
    pure, start = invariant(wrench) == 0.0, body.inner
    if pure:
        # Where it grazes a flat, the iterations would take any point of the flat for its contact.
        entered, start = enter_level(body, wrench)
        if entered == MISS:
            return from_units(_miss_at(body, wrench, start), units), 0
    found = osculating_iteration(body, wrench)
    steps = found.steps
    if not found.converged:
        found = newton_iteration(body, lever, wrench, found.point)
        steps += found.steps
    if not found.converged:
        if not pure:
            cuts, start = bracket_contact(body, wrench)
            steps += cuts
        found = newton_iteration(body, lever, wrench, start)
        steps += found.steps
    status = OK if found.converged else NOT_CONVERGED
    answer = make_answer(status, wrench, found.point, found.normal, found.xi, found.trace, found.det)
    return from_units(answer, units), steps


@kernel
def solve_smooth(wrench: Wrench, body: SmoothBody) -> Answer:
    """Contact centroid on a smooth convex body that is given by a function.

    Returns:
        See `contactsense.solvers.solution`.
    """
    return solve_smooth_counted(wrench, body)[0]


@kernel
def wrench_axis_smooth(wrench: Wrench, body: SmoothBody) -> Answer:
    """Point where the wrench axis enters such a body; on a miss the nearest point in its metric."""
    status = input_status(wrench)
    if status != OK:
        return no_contact(status)
    k = unit_exponent(body.size, reach_of(body))
    scaled = units_for(wrench, reach_of(body))
    units = Units(scaled.force, scaled.moment, k)
    local, small = to_units(wrench, units), body_in_unit(body, resized(body.size, k), k)
    status, point = enter_level(small, local)
    if status == OK:
        return from_units(_without_torsion(OK, small, local, point), units)
    return from_units(_miss_at(small, local, point), units)


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
        level_at,
        line_entry,
        ray_entry,
        enter_level,
        newton_iteration,
        bracket_contact,
        gauge_at,
        osculating_iteration,
        _without_torsion,
        _miss_at,
        solve_smooth_counted,
        solve_smooth,
        wrench_axis_smooth,
    ):
        plain = getattr(part, "py_func", part)
        bound = FunctionType(plain.__code__, {**plain.__globals__, **own}, plain.__name__)
        own[plain.__name__] = njit(error_model="numpy")(bound)
    return own["solve_smooth"], own["wrench_axis_smooth"]
