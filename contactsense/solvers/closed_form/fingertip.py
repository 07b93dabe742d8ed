"""The paper's fingertip (figure 5): a hemisphere on a cylinder of the same radius, open below."""

from contactsense.robots.jit.kernel import kernel
from contactsense.robots.vectors import dot
from contactsense.solvers.closed_form.cylinder import directions, height, on_lateral
from contactsense.solvers.closed_form.ellipsoid import ball, on_ball
from contactsense.solvers.closed_form.wrench_axis import line_answer
from contactsense.solvers.solution import FAR, MISS, OK, PATCH_TOLERANCE, Answer, no_contact
from contactsense.solvers.units import LARGE, SMALL, from_units, in_units, length_to_units
from contactsense.solvers.wrench import Wrench, pure_force


@kernel
def _fingertip(wrench: Wrench, radius: float) -> Answer:
    over = FAR
    ex = ey = z = 0.0
    disc, a, b, u, v = directions(wrench, radius, 0.0)
    if disc > 0.0:
        ex, ey = a - u, b - v
        z, _ = height(wrench, ex, ey, radius, 0.0)
        over = z
        if over <= 0.0:
            return on_lateral(OK, wrench, ex, ey, z, radius, 0.0)
    status, n, xi = ball(wrench, 0.0, radius)
    below = -n[2] * radius if status == OK else FAR
    if min(over, below) > PATCH_TOLERANCE * radius:
        return no_contact(MISS)
    if over < below:
        return on_lateral(OK, wrench, ex, ey, z, radius, 0.0)
    return on_ball(OK, wrench, 0.0, radius, n, xi)


@kernel
def solve_fingertip(wrench: Wrench, radius: float) -> Answer:
    """Contact centroid on the hemisphere z > 0 about the origin and the cylinder below it.

    Args:
        wrench: Wrench on the body.
        radius: Of both.

    Returns:
        See `contactsense.solvers.solution`; a miss without a nearest point.
    """
    f, m = wrench
    if SMALL < radius * radius * dot(f, f) < LARGE and dot(m, m) < LARGE:
        return _fingertip(wrench, radius)
    status, local, units = in_units(wrench, radius)
    if status != OK:
        return no_contact(status)
    return from_units(_fingertip(local, length_to_units(radius, units)), units)


@kernel
def wrench_axis_fingertip(wrench: Wrench, radius: float) -> Answer:
    """Point where the wrench axis enters the fingertip."""
    status, local, units = in_units(wrench, radius)
    if status != OK:
        return no_contact(status)
    radius = length_to_units(radius, units)
    answer = _fingertip(pure_force(local), radius)
    return from_units(line_answer(answer, local, PATCH_TOLERANCE * radius), units)
