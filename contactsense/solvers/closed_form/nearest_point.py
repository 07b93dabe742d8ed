"""Surface point nearest to the line of a force (the answer of a miss), and the entry of a line into a
body.

Both need only the projection onto the body: the nearest surface point to a point, and the signed distance.
"""

from math import sqrt

from contactsense.robots.jit.kernel import kernel
from contactsense.robots.surface.convex_primitives import project
from contactsense.robots.vectors import Vector, add_scaled, cross, divide, dot, norm
from contactsense.solvers.solution import MISS, OK, Answer, make_answer, no_contact
from contactsense.solvers.units import from_units, in_units, length_to_units
from contactsense.solvers.wrench import Wrench, line_point

TAPERED = 100
"""Kind of a tapered capsule, beside those of `contactsense.robots.surface.convex_primitives`; size (half,
radius_a, radius_b, unused)."""

Size = tuple[float, float, float, float]

_HALVINGS = 60
_STEPS = 60


@kernel
def project_body(kind: int, size: Size, point: Vector) -> tuple[float, Vector, Vector]:
    """Signed distance from a body, its nearest surface point, the outward normal there."""
    if kind == TAPERED:
        return _project_tapered(size, point)
    distance, x, y, z, nx, ny, nz = project(kind, size, point[0], point[1], point[2])
    return distance, (x, y, z), (nx, ny, nz)


@kernel
def _project_tapered(size: Size, point: Vector) -> tuple[float, Vector, Vector]:
    x, y, z = point
    half, radius_a, radius_b = size[0], size[1], size[2]
    rho = sqrt(x * x + y * y)
    ux, uy = (x / rho, y / rho) if rho > 0.0 else (1.0, 0.0)
    sin_beta = (radius_a - radius_b) / (2.0 * half)
    cos_beta = sqrt(1.0 - sin_beta * sin_beta)
    along = (z + half) * cos_beta - rho * sin_beta
    if 0.0 < along < 2.0 * half * cos_beta:
        distance = rho * cos_beta + (z + half) * sin_beta - radius_a
        nr, nz = cos_beta, sin_beta
    else:
        at, radius = (-half, radius_a) if along <= 0.0 else (half, radius_b)
        gap = sqrt(rho * rho + (z - at) * (z - at))
        nr, nz = (rho / gap, (z - at) / gap) if gap > 0.0 else (1.0, 0.0)
        distance = gap - radius
    pr, pz = rho - distance * nr, z - distance * nz
    return distance, (pr * ux, pr * uy, pz), (nr * ux, nr * uy, nz)


@kernel
def nearest_to_line(kind: int, size: Size, reach: float, wrench: Wrench) -> Answer:
    """A miss, at the surface point nearest to the line of the force.

    Distance to a convex body is convex along a line, so its slope, normal times direction, is bisected.

    Args:
        kind, size: The body, as `project_body` takes it.
        reach: Radius of a ball about the origin that holds the body.
        wrench: Wrench on the body, force not zero, of ordinary size.
    """
    f, m = wrench
    force = norm(f)
    d = divide(f, force)
    p = divide(cross(d, m), force)
    low, high = -2.0 * reach, 2.0 * reach
    for _ in range(_HALVINGS):
        at = 0.5 * (low + high)
        _, _, n = project_body(kind, size, add_scaled(p, at, d))
        if dot(n, d) > 0.0:
            high = at
        else:
            low = at
    _, c, n = project_body(kind, size, add_scaled(p, 0.5 * (low + high), d))
    return make_answer(MISS, wrench, c, n, 0.0, 0.0, 0.0)


@kernel
def _enter(kind: int, size: Size, reach: float, wrench: Wrench) -> Answer:
    f = wrench.force
    # In units of the force: the line is p + s f, and outside of the ball before s = -reach / |f|.
    p = line_point(wrench)
    at = -2.0 * reach / norm(f)
    c = n = (0.0, 0.0, 0.0)
    for _ in range(_STEPS):
        distance, c, n = project_body(kind, size, add_scaled(p, at, f))
        push = dot(n, f)
        if push >= 0.0:
            return nearest_to_line(kind, size, reach, wrench)
        step = -distance / push
        at += step
        if step <= 4e-16 * (2.0 * reach + abs(at)):
            break
    return make_answer(OK, wrench, c, n, 0.0, 0.0, 0.0)


@kernel
def enter(kind: int, size: Size, reach: float, wrench: Wrench) -> Answer:
    """Where the wrench axis enters a convex body that is given by its projection.

    Along a line the signed distance is convex, so Newton's method from outside runs into the first root
    without passing it, or shows that there is none.

    Args:
        kind, size: The body, as `project_body` takes it.
        reach: Radius of a ball about the origin that holds the body.
        wrench: Wrench on the body.
    """
    status, local, units = in_units(wrench, reach)
    if status != OK:
        return no_contact(status)
    own = (
        length_to_units(size[0], units),
        length_to_units(size[1], units),
        length_to_units(size[2], units),
        length_to_units(size[3], units),
    )
    return from_units(_enter(kind, own, length_to_units(reach, units), local), units)
