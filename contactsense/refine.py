"""The search for the most probable contact on one primitive: Gauss-Newton on the surface, see
`contactsense.energy`."""

import math

from contactsense.energy import energy_at, log_prior, loosen, set_up
from contactsense.ldl import solve
from robots.compiled import fused_kernel
from robots.surface import curvature, project

ITERATIONS = 12
"""Most Gauss-Newton steps for one primitive."""
TRIALS = 4
"""Most lengths that are tried for one step before the search ends."""
CUT = 8.0
"""Explanations whose energy or log evidence is worse than the best by this much are dropped (probability
3e-4)."""
ENOUGH = 5e-3
"""A step that lowers the energy by less than this ends the search: a tenth of a standard deviation."""
SLACK = 0.05
"""How much more that may be per unit of energy by which a candidate is worse than the best so far."""
PATIENCE = 1.5
"""How many times the gain that a step promises is hoped for before a candidate above the limit is given up;
once, where the whole step leads nowhere."""


@fused_kernel
def refine(  # type: ignore[no-untyped-def]
    kind, size, w, L, prior, limit, cx, cy, cz, nx, ny, nz, fx, fy, fz, xi, work
):
    """Most probable contact on one primitive, from a first guess on its surface. All in the body frame.

    Args:
        kind, size: The primitive, as in `robots.surface.Surfaces`.
        w, L: Fused wrench and its information matrix as left by `view`, shapes (6,) and (6, 6).
        prior: What is known of contacts beforehand.
        limit: Energy above which the contact is of no interest; the search ends once it is sure to stay
            there.
        cx, cy, cz, nx, ny, nz: First guess: a point of the surface [m] and the outward normal there.
        fx, fy, fz, xi: First guess: a force that pushes there [N], and torsion [Nm].
        work: Scratch; on return `frame` holds normal and tangents at the
            result.

    Returns:
        energy, log evidence of a contact about there (up to the noise's own constant), point (3), normal
        (3), force (3) [N], torsion [Nm], and the covariance of the point along the two tangents (vv11, vv12,
        vv22) [m^2]. The log evidence is -infinity where the energy stays above the limit, or where the matrix
        is not positive.
    """
    energy = math.inf
    H, g, T = work.normal_equations, work.gradient, work.frame
    log_det, v11, v12, v22 = math.inf, 0.0, 0.0, 0.0
    widen = 1.0
    for iteration in range(ITERATIONS + 1):
        # What the offset does changes slowly; it is held still while a step is tried, so that the gradient is
        # exact.
        loose = loosen(L, prior, nx, ny, nz, fx, fy, fz)
        widen = loose[2]
        energy = energy_at(w, L, prior, loose, cx, cy, cz, nx, ny, nz, fx, fy, fz, xi)
        W = curvature(kind, size, cx, cy, cz, nx, ny, nz)
        set_up(w, L, prior, loose, W, cx, cy, cz, nx, ny, nz, fx, fy, fz, xi, work)
        log_det, hope, v11, v12, v22 = solve(H, g)
        if log_det == math.inf or iteration == ITERATIONS:
            break
        # The worse a candidate is, the less its place and weight matter.
        enough = ENOUGH + SLACK * max(energy - hope - (limit - CUT), 0.0)
        if hope < enough or energy - PATIENCE * hope > limit:
            break
        scale = 1.0
        accepted = False
        for _ in range(TRIALS):
            v1, v2 = -scale * g[4], -scale * g[5]
            _, ax, ay, az, mx, my, mz = project(
                kind,
                size,
                cx + v1 * T[0, 1] + v2 * T[0, 2],
                cy + v1 * T[1, 1] + v2 * T[1, 2],
                cz + v1 * T[2, 1] + v2 * T[2, 2],
            )
            hx, hy, hz, ti = fx - scale * g[0], fy - scale * g[1], fz - scale * g[2], xi - scale * g[3]
            tried = energy_at(w, L, prior, loose, ax, ay, az, mx, my, mz, hx, hy, hz, ti)
            if tried < energy:
                accepted = True
                break
            if energy - hope > limit:
                # The step promised too little, and did not even keep that.
                break
            # Least place of the parabola through both energies and the slope between them.
            scale *= min(max(hope * scale / (tried - energy + 2.0 * hope * scale), 0.1), 0.5)
        if not accepted:
            break
        cx, cy, cz, nx, ny, nz, fx, fy, fz, xi = ax, ay, az, mx, my, mz, hx, hy, hz, ti
        gained = energy - tried
        energy = tried
        if gained < enough or (scale == 1.0 and abs(gained - hope) < enough):
            # The energy is as parabolic as it was taken to be: the next step would gain nothing worth having.
            break
    if log_det == math.inf or energy > limit:
        return math.inf, -math.inf, cx, cy, cz, nx, ny, nz, fx, fy, fz, xi, 0.0, 0.0, 0.0
    push = -(fx * nx + fy * ny + fz * nz)
    log_z = log_prior(prior, push) - energy - 0.5 * (log_det + math.log(widen))
    return energy, log_z, cx, cy, cz, nx, ny, nz, fx, fy, fz, xi, v11, v12, v22
