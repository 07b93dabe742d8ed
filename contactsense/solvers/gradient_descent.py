"""The paper's iterative solution (section 6): gradient descent on V = g^T g / 2. A slow baseline.

Unknowns x = (c, K / 2) with m = (K / 2) grad S + c x f and S = |A c|^2 - R^2 = 0. The step length is
optimal along the gradient of the linearized g.
"""

from math import sqrt

from contactsense.solvers.solution import (
    MISS,
    NOT_CONVERGED,
    OK,
    PULLING,
    Answer,
    input_status,
    make_answer,
    no_contact,
)
from contactsense.solvers.typed_kernel import kernel

_STEPS = 20000
_TOLERANCE = 1e-12


@kernel
def descend(
    fx: float,
    fy: float,
    fz: float,
    mx: float,
    my: float,
    mz: float,
    a: float,
    b: float,
    c: float,
    x: float,
    y: float,
    z: float,
    k: float,
    steps: int,
    tolerance: float,
) -> tuple[int, float, float, float, float, float]:
    """Gradient descent on an ellipsoid in scaled units: |f| = 1, largest semi-axis 1.

    Args:
        fx, fy, fz, mx, my, mz: Wrench in those units.
        a, b, c: Semi-axes.
        x, y, z, k: Initial point and K / 2.
        steps: Maximum number of steps.
        tolerance: Converged if |g| is below this.

    Returns:
        Number of steps, the point, K / 2, and |g|.
    """
    ha, hb, hc = 2.0 / (a * a), 2.0 / (b * b), 2.0 / (c * c)
    taken = 0
    size = 0.0
    for taken in range(steps + 1):
        sx, sy, sz = ha * x, hb * y, hc * z
        g1 = k * sx + y * fz - z * fy - mx
        g2 = k * sy + z * fx - x * fz - my
        g3 = k * sz + x * fy - y * fx - mz
        g4 = 0.5 * (x * sx + y * sy + z * sz) - 1.0
        size = sqrt(g1 * g1 + g2 * g2 + g3 * g3 + g4 * g4)
        if size <= tolerance or taken == steps:
            break
        # G^T g, and the change of g along it.
        d1 = k * ha * g1 - fz * g2 + fy * g3 + sx * g4
        d2 = fz * g1 + k * hb * g2 - fx * g3 + sy * g4
        d3 = -fy * g1 + fx * g2 + k * hc * g3 + sz * g4
        d4 = sx * g1 + sy * g2 + sz * g3
        e1 = k * ha * d1 + fz * d2 - fy * d3 + sx * d4
        e2 = -fz * d1 + k * hb * d2 + fx * d3 + sy * d4
        e3 = fy * d1 - fx * d2 + k * hc * d3 + sz * d4
        e4 = sx * d1 + sy * d2 + sz * d3
        change = e1 * e1 + e2 * e2 + e3 * e3 + e4 * e4
        if change == 0.0:
            break
        rate = (d1 * d1 + d2 * d2 + d3 * d3 + d4 * d4) / change
        x, y, z, k = x - rate * d1, y - rate * d2, z - rate * d3, k - rate * d4
    return taken, x, y, z, k, size


@kernel
def descent_ellipsoid(
    fx: float, fy: float, fz: float, mx: float, my: float, mz: float, a: float, b: float, c: float
) -> Answer:
    """Contact centroid on an ellipsoid by gradient descent, from the point whose normal opposes the
    force.

    It may end in a local minimum, or on the side where the force pulls (paper, section 8): then the
    status is `NOT_CONVERGED` or `PULLING`.
    """
    status = input_status(fx, fy, fz, mx, my, mz)
    if status != OK:
        return no_contact(status)
    large = max(abs(fx), abs(fy), abs(fz))
    gx, gy, gz = fx / large, fy / large, fz / large
    force = large * sqrt(gx * gx + gy * gy + gz * gz)
    size = max(a, b, c)
    ux, uy, uz = fx / force, fy / force, fz / force
    vx, vy, vz = mx / force / size, my / force / size, mz / force / size
    if not max(abs(vx), abs(vy), abs(vz)) < 1e100:
        return no_contact(MISS)
    ra, rb, rc = a / size, b / size, c / size
    stretch = sqrt(ra * ra * ux * ux + rb * rb * uy * uy + rc * rc * uz * uz)
    _, x, y, z, k, residual_norm = descend(
        ux,
        uy,
        uz,
        vx,
        vy,
        vz,
        ra,
        rb,
        rc,
        -ra * ra * ux / stretch,
        -rb * rb * uy / stretch,
        -rc * rc * uz / stretch,
        0.0,
        _STEPS,
        _TOLERANCE,
    )
    nx, ny, nz = x / (ra * ra), y / (rb * rb), z / (rc * rc)
    slope = sqrt(nx * nx + ny * ny + nz * nz)
    if not slope > 0.0:
        return no_contact(NOT_CONVERGED)
    nx, ny, nz = nx / slope, ny / slope, nz / slope
    status = OK if nx * ux + ny * uy + nz * uz < 0.0 else PULLING
    if not residual_norm <= _TOLERANCE:
        status = NOT_CONVERGED
    xi = 2.0 * k * slope * force * size
    xx, yy, zz = nx * nx, ny * ny, nz * nz
    trace = ((yy + zz) / (ra * ra) + (zz + xx) / (rb * rb) + (xx + yy) / (rc * rc)) / (slope * size)
    root = 1.0 / (ra * rb * rc * slope * slope * size)
    x, y, z = size * x, size * y, size * z
    return make_answer(status, fx, fy, fz, mx, my, mz, x, y, z, nx, ny, nz, xi, trace, root * root)
