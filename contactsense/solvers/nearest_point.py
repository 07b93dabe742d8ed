"""Surface point nearest to the line of a force (the answer of a miss), and the entry of a line into a
body.

Both need only the projection onto the body: the nearest surface point to a point, and the signed distance.
"""

from math import ldexp, sqrt

from contactsense.robots.surface.convex_primitives import project
from contactsense.solvers.solution import (
    MISS,
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

TAPERED = 100
"""Kind of a tapered capsule, beside those of `contactsense.robots.surface.convex_primitives`; size (half,
radius_a, radius_b, unused)."""

Size = tuple[float, float, float, float]

_HALVINGS = 60
_STEPS = 60


@kernel
def project_body(
    kind: int, size: Size, x: float, y: float, z: float
) -> tuple[float, float, float, float, float, float, float]:
    """Signed distance from a body, its nearest surface point, the outward normal there."""
    if kind == TAPERED:
        return _project_tapered(size, x, y, z)
    return project(kind, size, x, y, z)  # type: ignore[no-any-return]


@kernel
def _project_tapered(
    size: Size, x: float, y: float, z: float
) -> tuple[float, float, float, float, float, float, float]:
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
    return distance, pr * ux, pr * uy, pz, nr * ux, nr * uy, nz


@kernel
def nearest_to_line(
    kind: int,
    size: Size,
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
        kind, size: The body, as `project_body` takes it.
        reach: Radius of a ball about the origin that holds the body.
        fx, fy, fz, mx, my, mz: Wrench on the body, force not zero, of ordinary size.
    """
    force = sqrt(fx * fx + fy * fy + fz * fz)
    dx, dy, dz = fx / force, fy / force, fz / force
    px, py, pz = (dy * mz - dz * my) / force, (dz * mx - dx * mz) / force, (dx * my - dy * mx) / force
    low, high = -2.0 * reach, 2.0 * reach
    for _ in range(_HALVINGS):
        at = 0.5 * (low + high)
        _, _, _, _, nx, ny, nz = project_body(kind, size, px + at * dx, py + at * dy, pz + at * dz)
        if nx * dx + ny * dy + nz * dz > 0.0:
            high = at
        else:
            low = at
    at = 0.5 * (low + high)
    _, cx, cy, cz, nx, ny, nz = project_body(kind, size, px + at * dx, py + at * dy, pz + at * dz)
    return make_answer(MISS, fx, fy, fz, mx, my, mz, cx, cy, cz, nx, ny, nz, 0.0, 0.0, 0.0)


@kernel
def _enter(
    kind: int,
    size: Size,
    reach: float,
    fx: float,
    fy: float,
    fz: float,
    mx: float,
    my: float,
    mz: float,
) -> Answer:
    ff = fx * fx + fy * fy + fz * fz
    px, py, pz = (fy * mz - fz * my) / ff, (fz * mx - fx * mz) / ff, (fx * my - fy * mx) / ff
    # In units of the force: the line is p + s f, and outside of the ball before s = -reach / |f|.
    at = -2.0 * reach / sqrt(ff)
    cx = cy = cz = nx = ny = nz = 0.0
    for _ in range(_STEPS):
        distance, cx, cy, cz, nx, ny, nz = project_body(kind, size, px + at * fx, py + at * fy, pz + at * fz)
        push = nx * fx + ny * fy + nz * fz
        if push >= 0.0:
            return nearest_to_line(kind, size, reach, fx, fy, fz, mx, my, mz)
        step = -distance / push
        at += step
        if step <= 4e-16 * (2.0 * reach + abs(at)):
            break
    return make_answer(OK, fx, fy, fz, mx, my, mz, cx, cy, cz, nx, ny, nz, 0.0, 0.0, 0.0)


@kernel
def enter(
    kind: int,
    size: Size,
    reach: float,
    fx: float,
    fy: float,
    fz: float,
    mx: float,
    my: float,
    mz: float,
) -> Answer:
    """Where the wrench axis enters a convex body that is given by its projection.

    Along a line the signed distance is convex, so Newton's method from outside runs into the first root
    without passing it, or shows that there is none.

    Args:
        kind, size: The body, as `project_body` takes it.
        reach: Radius of a ball about the origin that holds the body.
        fx, fy, fz, mx, my, mz: Wrench on the body.
    """
    status = input_status(fx, fy, fz, mx, my, mz)
    if status != OK:
        return no_contact(status)
    e, g, k = unit_exponents(fx, fy, fz, mx, my, mz, reach)
    fx, fy, fz, mx, my, mz = scaled(fx, fy, fz, mx, my, mz, e, g, k)
    own = (ldexp(size[0], -k), ldexp(size[1], -k), ldexp(size[2], -k), ldexp(size[3], -k))
    return rescaled(_enter(kind, own, ldexp(reach, -k), fx, fy, fz, mx, my, mz), e, g, k)
