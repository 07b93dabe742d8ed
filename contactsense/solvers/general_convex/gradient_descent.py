"""The paper's iterative solution (section 6): gradient descent on V = g^T g / 2. A slow baseline.

Unknowns x = (c, K / 2) with m = (K / 2) grad S + c x f and S = |A c|^2 - R^2 = 0. The step length is
optimal along the gradient of the linearized g.
"""

from math import sqrt

from contactsense.robots.jit.kernel import kernel
from contactsense.robots.vectors import Vector, divide, dot, norm, scale
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
from contactsense.solvers.wrench import Wrench

_STEPS = 20000
_TOLERANCE = 1e-12


@kernel
def descend(
    wrench: Wrench, axes: Vector, start: Vector, k: float, steps: int, tolerance: float
) -> tuple[int, Vector, float, float]:
    """Gradient descent on an ellipsoid in scaled units: |f| = 1, largest semi-axis 1.

    Args:
        wrench: Wrench in those units.
        axes: Semi-axes.
        start, k: Initial point and K / 2.
        steps: Maximum number of steps.
        tolerance: Converged if |g| is below this.

    Returns:
        Number of steps, the point, K / 2, and |g|.
    """
    (fx, fy, fz), (mx, my, mz) = wrench
    x, y, z = start
    a, b, c = axes
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
    return taken, (x, y, z), k, size


@kernel
def descent_ellipsoid(wrench: Wrench, a: float, b: float, c: float) -> Answer:
    """Contact centroid on an ellipsoid by gradient descent, from the point whose normal opposes the
    force.

    It may end in a local minimum, or on the side where the force pulls (paper, section 8): then the
    status is `NOT_CONVERGED` or `PULLING`.
    """
    status = input_status(wrench)
    if status != OK:
        return no_contact(status)
    f, m = wrench
    large = max(abs(f[0]), abs(f[1]), abs(f[2]))
    force = large * norm(divide(f, large))
    size = max(a, b, c)
    u, v = divide(f, force), divide(divide(m, force), size)
    if not max(abs(v[0]), abs(v[1]), abs(v[2])) < 1e100:
        return no_contact(MISS)
    ra, rb, rc = a / size, b / size, c / size
    stretch = sqrt(ra * ra * u[0] * u[0] + rb * rb * u[1] * u[1] + rc * rc * u[2] * u[2])
    start = (-ra * ra * u[0] / stretch, -rb * rb * u[1] / stretch, -rc * rc * u[2] / stretch)
    _, x, k, residual_norm = descend(Wrench(u, v), (ra, rb, rc), start, 0.0, _STEPS, _TOLERANCE)
    gradient = (x[0] / (ra * ra), x[1] / (rb * rb), x[2] / (rc * rc))
    slope = norm(gradient)
    if not slope > 0.0:
        return no_contact(NOT_CONVERGED)
    n = divide(gradient, slope)
    status = OK if dot(n, u) < 0.0 else PULLING
    if not residual_norm <= _TOLERANCE:
        status = NOT_CONVERGED
    xi = 2.0 * k * slope * force * size
    xx, yy, zz = n[0] * n[0], n[1] * n[1], n[2] * n[2]
    trace = ((yy + zz) / (ra * ra) + (zz + xx) / (rb * rb) + (xx + yy) / (rc * rc)) / (slope * size)
    root = 1.0 / (ra * rb * rc * slope * slope * size)
    return make_answer(status, wrench, scale(size, x), n, xi, trace, root * root)
