"""Laplace approximation of the evidence of surface cells: used if the line of action is not known.

If the place is uncertain by more than a few centimetres, a single mode does not represent the posterior.
Every sample of `contactsense.localization.surface.surface_samples` is then evaluated, and the sum over the
samples is the integral over the surface. The unknowns of a cell are the logarithm phi of the normal force
F (relative to its median), the friction ratios (alpha, beta), the torsion ratio chi = xi / F, and a shift
(v1, v2) within the cell:

    f = F (-n + alpha t1 + beta t2),    m = c x f + F chi n,    c = c0 + v1 t1 + v2 t2

In these unknowns all priors are normal distributions (Student's t for the friction ratio), so an
uninformative measurement returns the prior. Laplace's approximation of the integral over the six unknowns
is the evidence of the cell. The computation uses the axes (n, t1, t2) with origin c0, in which most
derivatives of the wrench are sparse (`contactsense.localization.surface_search.cell_equations`).

A block of cells is processed in parallel, one cell per SIMD lane
(`contactsense.localization.surface.simd_layout`).
"""

import math

import numpy as np

from contactsense.robots.jit.lanes import HALF
from contactsense.solvers.posterior.contact_prior import Prior

from contactsense.localization.surface.simd_layout import (  # isort: skip
    A00, A01, A02, A03, A04, A05, A11, A12, A13, A14, A15, A22, A23, A24, A25, A33, A34, A35, A44, A45,
    A55, ACTIVE, ALPHA, BETA, CHI, DET, ENERGY, FORCE, FX, FY, FZ, LENGTH, LOG_EVIDENCE, LOG_FORCE, NX,
    NY, NZ, PX, PY, PZ, RATIO_INFORMATION, SPREAD, T1X, T1Y, T1Z, T2X, T2Y, T2Z, TILT, V1, V11, V12, V2,
    V22, W0, W1, W2, W3, W4, W5, X, Y, Z,
)  # fmt: skip
from contactsense.kinematics.exponential import exponential
from contactsense.kinematics.linalg.ldl import ldl_solve_unrolled
from contactsense.kinematics.logarithm import logarithm
from contactsense.kinematics.wrench_information import blocks, matvec, rotate_block, shift_information
from contactsense.localization.surface_search.cell_equations import CellContact, CellPrior, cell_equations
from contactsense.robots.jit.array_views import view
from contactsense.robots.jit.kernel import fused_kernel
from contactsense.robots.vectors import tangents

MAX_ITERATIONS = 6
"""Maximum number of Gauss-Newton steps per cell."""
ENERGY_TOLERANCE = 0.1
"""Converged if the predicted decrease of the energy is less than this. It is the same for all cells: with one
that grows with the energy, the evidence of a link would depend on the prior of the others."""
REJECTION_FACTOR, UNMEASURED_REJECTION_FACTOR = 1.0, 2.0
"""A cell is rejected unless this many times the predicted decrease of the energy brings it below the limit;
the second one where the force is not measured, so that the search starts far from the mode."""
MIN_INITIAL_FORCE_SHARE = 0.3
"""Lower bound of the initial normal force, relative to the measured force."""
MIN_INITIAL_FORCE = 1e-3
"""Lower bound of the initial normal force, relative to the median of the prior."""
MAX_LOG_FORCE_STEP = 1.5
"""Maximum step in the logarithm of the force."""


@fused_kernel
def find_modes(
    count: int,
    w: np.ndarray,
    L: np.ndarray,
    prior: Prior,
    force_deviation: float,
    limit: float,
    block: np.ndarray,
) -> None:
    """Find the posterior mode in each cell of a block by Gauss-Newton.

    Args:
        count: Number of cells in the block, at most `LANES`, all on one link.
        w, L: Fused wrench and its information matrix, link frame, shapes (6,) and (6, 6).
        prior: Prior of contacts.
        force_deviation: Root of the trace of the force's covariance [N]. If the force is more than this,
            the search starts from it, else from a force of this size or the prior's median if that is less.
        limit: Energy above which a cell is rejected, as soon as no step promises to get below it.
        block: The block, with centres, normals, spreads and tilts of the cells; on return, the modes and
            their evidence.
    """
    torsion_information = 1.0 / prior.torsion_lever**2
    measured = math.sqrt(w[0] * w[0] + w[1] * w[1] + w[2] * w[2]) > force_deviation
    rejection_factor = REJECTION_FACTOR if measured else UNMEASURED_REJECTION_FACTOR
    _begin(count, w, L, prior, force_deviation, block)
    first, last = 0, count
    for step in range(MAX_ITERATIONS + 1):
        may_step = step < MAX_ITERATIONS
        _gauss_newton_steps(torsion_information, limit, rejection_factor, may_step, (first, last), block)
        # The halves in which cells are active: one of them or both. Both at once take less time than one
        # after the other, as the processor begins with the second while the first waits for its divisions.
        if not _has_active_cells(first, block):
            first += HALF
        if last > HALF and not _has_active_cells(HALF, block):
            last = HALF
        if first >= last:
            break
    _evidence(count, prior, limit, block)


@fused_kernel
def _has_active_cells(first: int, block: np.ndarray) -> bool:
    """Whether a cell of the half block from `first` on is active."""
    half = view(block, first, (LENGTH - first,))
    active = 0.0
    for j in range(HALF):
        active += half[ACTIVE + j]
    return active > 0.0


@fused_kernel
def _begin(
    count: int, w: np.ndarray, L: np.ndarray, prior: Prior, force_deviation: float, block: np.ndarray
) -> None:
    """Wrench and information matrix about the centre of each cell, in the axes of its normal and
    tangents; and the initial values: the measured force, if it is more than its deviation."""
    f, m = (w[0], w[1], w[2]), (w[3], w[4], w[5])
    magnitude = math.sqrt(f[0] * f[0] + f[1] * f[1] + f[2] * f[2])
    measured = magnitude > force_deviation
    min_push = max(MIN_INITIAL_FORCE_SHARE * magnitude, MIN_INITIAL_FORCE * prior.force)
    push = max(min(prior.force, force_deviation), min_push)
    force, coupling, moment = blocks(L)
    for first in range(0, count, HALF):
        half = view(block, first, (LENGTH - first,))
        for j in range(HALF):
            x, y, z = half[X + j], half[Y + j], half[Z + j]
            n = (half[NX + j], half[NY + j], half[NZ + j])
            t1, t2 = tangents(n)
            half[T1X + j], half[T1Y + j], half[T1Z + j] = t1
            half[T2X + j], half[T2Y + j], half[T2Z + j] = t2
            axes = (n, t1, t2)
            shifted = (m[0] - y * f[2] + z * f[1], m[1] - z * f[0] + x * f[2], m[2] - x * f[1] + y * f[0])
            w0, w1, w2 = matvec(axes, f)
            half[W0 + j], half[W1 + j], half[W2 + j] = w0, w1, w2
            half[W3 + j], half[W4 + j], half[W5 + j] = matvec(axes, shifted)
            F, D, M = shift_information(force, coupling, moment, x, y, z)
            F, D, M = rotate_block(axes, F), rotate_block(axes, D), rotate_block(axes, M)
            half[A00 + j], half[A01 + j], half[A02 + j] = F[0]
            half[A11 + j], half[A12 + j], half[A22 + j] = F[1][1], F[1][2], F[2][2]
            half[A03 + j], half[A13 + j], half[A23 + j] = D[0]
            half[A04 + j], half[A14 + j], half[A24 + j] = D[1]
            half[A05 + j], half[A15 + j], half[A25 + j] = D[2]
            half[A33 + j], half[A34 + j], half[A35 + j] = M[0]
            half[A44 + j], half[A45 + j], half[A55 + j] = M[1][1], M[1][2], M[2][2]
            normal_force = max(-w0, min_push) if measured else push
            share = 1.0 / normal_force if measured else 0.0
            half[FORCE + j] = normal_force
            tilt = half[TILT + j]
            half[RATIO_INFORMATION + j] = 1.0 / (prior.friction_ratio * prior.friction_ratio + tilt * tilt)
            half[LOG_FORCE + j] = logarithm(normal_force / prior.force)
            half[ALPHA + j], half[BETA + j] = share * w1, share * w2
            half[CHI + j], half[V1 + j], half[V2 + j] = 0.0, 0.0, 0.0
            half[ACTIVE + j] = 1.0 if first + j < count else 0.0


@fused_kernel
def _gauss_newton_steps(
    torsion_information: float,
    limit: float,
    rejection_factor: float,
    may_step: bool,
    cells: tuple[int, int],
    block: np.ndarray,
) -> None:
    """Energy, its curvature, and a Gauss-Newton step for all active cells.

    Args:
        torsion_information: Inverse variance of the torsion ratio [1/m^2].
        limit: Energy above which a cell is rejected.
        rejection_factor: Factor of the predicted decrease that a cell above it may still fall by.
        may_step: False in the last iteration.
        cells: Those of the halves that are computed: from a multiple of `HALF` on to before another number.
        block: The block.
    """
    for first in range(cells[0], cells[1], HALF):
        half = view(block, first, (LENGTH - first,))
        for j in range(HALF):
            A = (
                half[A00 + j], half[A01 + j], half[A02 + j], half[A03 + j], half[A04 + j], half[A05 + j],
                half[A11 + j], half[A12 + j], half[A13 + j], half[A14 + j], half[A15 + j],
                half[A22 + j], half[A23 + j], half[A24 + j], half[A25 + j],
                half[A33 + j], half[A34 + j], half[A35 + j],
                half[A44 + j], half[A45 + j],
                half[A55 + j],
            )  # fmt: skip
            measured = half[W0 + j], half[W1 + j], half[W2 + j], half[W3 + j], half[W4 + j], half[W5 + j]
            cell_information = 1.0 / (half[SPREAD + j] * half[SPREAD + j])
            prior = CellPrior(half[RATIO_INFORMATION + j], torsion_information, cell_information)
            contact = CellContact(
                half[LOG_FORCE + j], half[FORCE + j], half[ALPHA + j], half[BETA + j], half[CHI + j],
                half[V1 + j], half[V2 + j],
            )  # fmt: skip
            energy, H, gradient = cell_equations(A, measured, prior, contact)
            det, positive, predicted_decrease, (v11, v12, v22), s = ldl_solve_unrolled(H, gradient)
            active = half[ACTIVE + j] > 0.0
            # The energy after the last step is predicted, not evaluated.
            half[ENERGY + j] = (
                energy - min(predicted_decrease, ENERGY_TOLERANCE) if active else half[ENERGY + j]
            )
            half[V11 + j] = v11 if active else half[V11 + j]
            half[V12 + j] = v12 if active else half[V12 + j]
            half[V22 + j] = v22 if active else half[V22 + j]
            half[DET + j] = (det if positive else 0.0) if active else half[DET + j]
            # The residual is bilinear in the force and the other unknowns: limit the step of the force.
            scale = min(1.0, MAX_LOG_FORCE_STEP / max(abs(s[0]), 1e-300)) if active else 0.0
            continues = (
                active
                & positive
                & (predicted_decrease >= ENERGY_TOLERANCE)
                & (energy - rejection_factor * predicted_decrease <= limit)
                & may_step
            )
            half[ACTIVE + j] = 1.0 if continues else 0.0
            half[LOG_FORCE + j] = contact.log_force - scale * s[0]
            half[FORCE + j] = contact.force * exponential(-scale * s[0])
            half[ALPHA + j] = contact.alpha - scale * s[1]
            half[BETA + j] = contact.beta - scale * s[2]
            half[CHI + j] = contact.chi - scale * s[3]
            half[V1 + j] = contact.v1 - scale * s[4]
            half[V2 + j] = contact.v2 - scale * s[5]


@fused_kernel
def _evidence(count: int, prior: Prior, limit: float, block: np.ndarray) -> None:
    """Energy, evidence, point and force at the modes that have been found."""
    for first in range(0, count, HALF):
        half = view(block, first, (LENGTH - first,))
        for j in range(HALF):
            prior_scale = (
                prior.torsion_lever * half[SPREAD + j] * half[SPREAD + j] / half[RATIO_INFORMATION + j]
            )
            log_evidence = -half[ENERGY + j] - 0.5 * logarithm(half[DET + j] * prior_scale * prior_scale)
            accepted = (half[DET + j] > 0.0) & (half[ENERGY + j] <= limit)
            half[ENERGY + j] = half[ENERGY + j] if accepted else math.inf
            half[LOG_EVIDENCE + j] = log_evidence if accepted else -math.inf
            v1, v2 = half[V1 + j], half[V2 + j]
            half[PX + j] = half[X + j] + v1 * half[T1X + j] + v2 * half[T2X + j]
            half[PY + j] = half[Y + j] + v1 * half[T1Y + j] + v2 * half[T2Y + j]
            half[PZ + j] = half[Z + j] + v1 * half[T1Z + j] + v2 * half[T2Z + j]
            F, alpha, beta = half[FORCE + j], half[ALPHA + j], half[BETA + j]
            half[FX + j] = F * (alpha * half[T1X + j] + beta * half[T2X + j] - half[NX + j])
            half[FY + j] = F * (alpha * half[T1Y + j] + beta * half[T2Y + j] - half[NY + j])
            half[FZ + j] = F * (alpha * half[T1Z + j] + beta * half[T2Z + j] - half[NZ + j])
