"""Most probable contact on one primitive, by Gauss-Newton on the surface; see
`contactsense.solvers.posterior`."""

import math
from typing import NamedTuple

import numpy as np

from contactsense.kinematics.linalg.ldl import ldl_solve
from contactsense.robots.jit.kernel import fused_kernel
from contactsense.robots.surface.convex_primitives import curvature, project
from contactsense.solvers.posterior import (
    Contact,
    Prior,
    SearchBuffers,
    energy_at,
    inflate_by_surface_deviation,
    linearize,
    log_prior,
)

MAX_ITERATIONS = 12
"""Maximum number of Gauss-Newton steps."""
LINE_SEARCH_STEPS = 4
"""Maximum number of step lengths tried in one line search."""
ENERGY_CUTOFF = 8.0
"""Candidates whose energy or log evidence is worse than the best by this much are dropped (odds of 3e-4)."""
ENERGY_TOLERANCE = 5e-3
"""Converged if a step lowers the energy by less than this: a tenth of a standard deviation."""
RELATIVE_TOLERANCE = 0.05
"""Additional tolerance per unit of energy by which a candidate is worse than the best so far."""
REJECTION_FACTOR = 1.5
"""A candidate above the limit is rejected unless this many times the predicted decrease brings it below.

If the full step fails to lower the energy, the factor is one.
"""


class Mode(NamedTuple):
    """The most probable contact on one primitive, body frame."""

    energy: float
    """Negative log of the posterior density."""
    log_evidence: float
    """Log evidence of a contact near this mode (Laplace approximation, up to the constant of the noise);
    -infinity if the energy stays above the limit or the Gauss-Newton matrix is not positive definite."""
    contact: Contact
    variances: tuple[float, float, float]
    """Covariance of the point along the two tangents (v11, v12, v22) [m^2]."""


@fused_kernel
def find_posterior_mode(
    kind: int,
    size: np.ndarray,
    w: np.ndarray,
    L: np.ndarray,
    prior: Prior,
    limit: float,
    start: Contact,
    buffers: SearchBuffers,
    energy_tolerance: float = ENERGY_TOLERANCE,
) -> Mode:
    """Most probable contact on one primitive, from an initial guess on its surface. Body frame.

    Args:
        kind, size: The primitive, as in `contactsense.robots.surface.convex_primitives.Surfaces`.
        w, L: Fused wrench and its information matrix, body frame, shapes (6,) and (6, 6).
        prior: Prior of contacts.
        limit: Energy above which the contact is rejected; the search ends as soon as it cannot get below.
        start: Initial guess: a `Contact` on the surface with a force that pushes.
        buffers: Scratch; on return `frame` holds normal and tangents at the result.
        energy_tolerance: Converged if a step lowers the energy by less than this.

    Returns:
        The `Mode`.
    """
    energy = math.inf
    H, g, T = buffers.normal_equations, buffers.gradient, buffers.frame
    log_det, v11, v12, v22 = math.inf, 0.0, 0.0, 0.0
    variance_ratio = 1.0
    contact = start
    for iteration in range(MAX_ITERATIONS + 1):
        (cx, cy, cz), (nx, ny, nz), (fx, fy, fz), xi = contact
        # The inflation by the surface's offset varies slowly. It is constant within a step, so that the
        # gradient is exact.
        inflation = inflate_by_surface_deviation(L, prior, contact)
        variance_ratio = inflation[2]
        W = curvature(kind, size, cx, cy, cz, nx, ny, nz)
        energy = linearize(w, L, prior, inflation, W, contact, buffers)
        log_det, predicted_decrease, v11, v12, v22 = ldl_solve(H, g)
        if log_det == math.inf or iteration == MAX_ITERATIONS:
            break
        # The worse a candidate is, the less its accuracy matters.
        tolerance = energy_tolerance + RELATIVE_TOLERANCE * max(
            energy - predicted_decrease - (limit - ENERGY_CUTOFF), 0.0
        )
        if predicted_decrease < tolerance or energy - REJECTION_FACTOR * predicted_decrease > limit:
            break
        scale = 1.0
        accepted = False
        for _ in range(LINE_SEARCH_STEPS):
            v1, v2 = -scale * g[4], -scale * g[5]
            _, ax, ay, az, mx, my, mz = project(
                kind,
                size,
                cx + v1 * T[0, 1] + v2 * T[0, 2],
                cy + v1 * T[1, 1] + v2 * T[1, 2],
                cz + v1 * T[2, 1] + v2 * T[2, 2],
            )
            force = (fx - scale * g[0], fy - scale * g[1], fz - scale * g[2])
            trial = Contact((ax, ay, az), (mx, my, mz), force, xi - scale * g[3])
            trial_energy = energy_at(w, L, prior, inflation, trial)
            if trial_energy < energy:
                accepted = True
                break
            if energy - predicted_decrease > limit:
                # Even the predicted decrease leaves the energy above the limit.
                break
            # Minimum of the parabola through both energies with the slope at the start.
            scale *= min(
                max(
                    predicted_decrease * scale / (trial_energy - energy + 2.0 * predicted_decrease * scale),
                    0.1,
                ),
                0.5,
            )
        if not accepted:
            break
        contact = trial
        decrease = energy - trial_energy
        energy = trial_energy
        if decrease < tolerance or (scale == 1.0 and abs(decrease - predicted_decrease) < tolerance):
            # The quadratic model holds: the next step would be negligible.
            break
    if log_det == math.inf or energy > limit:
        return Mode(math.inf, -math.inf, contact, (0.0, 0.0, 0.0))
    (nx, ny, nz), (fx, fy, fz) = contact.normal, contact.force
    normal_force = -(fx * nx + fy * ny + fz * nz)
    log_z = log_prior(prior, normal_force) - energy - 0.5 * (log_det + math.log(variance_ratio))
    return Mode(energy, log_z, contact, (v11, v12, v22))
