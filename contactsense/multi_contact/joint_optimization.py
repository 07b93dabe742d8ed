"""Joint optimization of several simultaneous contacts by damped Gauss-Newton steps; the energy is that of
`contactsense.multi_contact.joint_energy`."""

import math

from contactsense.kinematics.linalg.cholesky import solve_in_place
from contactsense.multi_contact.buffers import UNKNOWNS, MeasurementRows, OptimizerState, PrimitiveFrames
from contactsense.multi_contact.joint_energy import component, energy_of, linearize
from contactsense.robots.jit.kernel import fused_kernel
from contactsense.robots.surface.convex_primitives import Surfaces, project
from contactsense.robots.vectors import Vector, tangents
from contactsense.solvers.posterior import Prior

MAX_ITERATIONS = 20
"""Maximum number of Gauss-Newton steps."""
LINE_SEARCH_STEPS = 5
"""Maximum number of step lengths tried in one line search."""
MIN_STEP_SCALE = 0.25
"""If the line search shortens a step below this factor, the next step is damped."""
MIN_DAMPING, MAX_DAMPING = 0.1, 10.0
"""Range of the damping: relative increase of the diagonal of the Gauss-Newton matrix."""
ENERGY_TOLERANCE = 1e-3
"""Converged if the predicted or actual decrease of the energy is less than this.

In curved valleys the remaining decrease may be fifty times as large: 0.05, negligible beside noise.
"""
MAX_LOG_FORCE_STEP = 1.5
"""Maximum step in the logarithm of a force."""
REJECTION_FACTOR = 3.0
"""A search above the limit is rejected unless this many times the predicted decrease brings it below."""


@fused_kernel
def find_joint_mode(
    surfaces: Surfaces,
    frames: PrimitiveFrames,
    rows: MeasurementRows,
    m: int,
    prior: Prior,
    count: int,
    limit: float,
    optimizer: OptimizerState,
) -> tuple[float, float]:
    """Most probable contacts, from the initial values in `optimizer`, which also holds the result.

    Args:
        surfaces: Primitives.
        frames: Body frames of all primitives, base frame.
        rows, m: The measurement and the number of its rows.
        prior: Prior of contacts.
        count: Number of contacts.
        limit: Energy above which the contacts are rejected; the search ends as soon as it cannot get
            below.
        optimizer: Initial values, with pushing forces; on return the result, and in `matrix` the Cholesky
            factor of its information matrix.

    Returns:
        Energy, and log evidence (Laplace approximation, up to the constant of the noise). The energy is
        infinite if it stays above the limit or the matrix is not positive definite.
    """
    size = count * UNKNOWNS
    H, g = optimizer.matrix, optimizer.step
    energy = energy_of(surfaces.link, rows, m, prior, count, optimizer)
    log_det = math.inf
    damping = 0.0
    for iteration in range(MAX_ITERATIONS + 1):
        linearize(surfaces, frames, rows, m, prior, count, optimizer)
        for i in range(size):
            H[i, i] *= 1.0 + damping
        log_det, predicted_decrease = solve_in_place(H, g, size)
        _save_iterate(count, optimizer, True)
        if log_det == math.inf or iteration == MAX_ITERATIONS:
            break
        if damping == 0.0 and (
            predicted_decrease < ENERGY_TOLERANCE or energy - REJECTION_FACTOR * predicted_decrease > limit
        ):
            break
        full_scale = 1.0
        for i in range(count):
            full_scale = min(full_scale, MAX_LOG_FORCE_STEP / max(abs(g[i * UNKNOWNS]), 1e-9))
        scale = full_scale
        decrease = 0.0
        for _ in range(LINE_SEARCH_STEPS):
            _step(surfaces, frames, prior, count, scale, optimizer)
            trial_energy = energy_of(surfaces.link, rows, m, prior, count, optimizer)
            if trial_energy < energy:
                decrease = energy - trial_energy
                energy = trial_energy
                break
            # Minimum of the parabola through both energies with the slope at the start.
            scale *= min(
                max(
                    predicted_decrease * scale / (trial_energy - energy + 2.0 * predicted_decrease * scale),
                    0.1,
                ),
                0.5,
            )
        if decrease == 0.0:
            _save_iterate(count, optimizer, False)
        if decrease >= ENERGY_TOLERANCE:
            damping = 0.0
        elif (
            damping == 0.0 and decrease > 0.0 and scale > MIN_STEP_SCALE * full_scale
        ) or damping >= MAX_DAMPING:
            break
        else:
            # The quadratic model fails, for example across a discontinuity of the curvature: damp the next
            # step.
            damping = max(10.0 * damping, MIN_DAMPING)
    if damping > 0.0:
        linearize(surfaces, frames, rows, m, prior, count, optimizer)
        log_det, _ = solve_in_place(H, g, size)
    if log_det == math.inf or energy > limit:
        return math.inf, -math.inf
    log_density = count * math.log(2.0 * math.pi / prior.area)
    for i in range(count):
        log_density += prior.log_link_density[surfaces.link[optimizer.primitive[i]]]
    return energy, log_density - energy - 0.5 * log_det


@fused_kernel
def set_contact(
    surfaces: Surfaces,
    frames: PrimitiveFrames,
    optimizer: OptimizerState,
    i: int,
    p: int,
    point: Vector,
    force: Vector,
) -> None:
    """Set contact i to the point on primitive p nearest to a point [m], with a pushing force [N]. Base
    frame."""
    R, o, c, T = frames.rotation[p], frames.origin[p], optimizer.point[i], optimizer.frame[i]
    x, y, z = point[0] - o[0], point[1] - o[1], point[2] - o[2]
    _, bx, by, bz, n1, n2, n3 = project(
        surfaces.kind[p],
        surfaces.size[p],
        R[0, 0] * x + R[1, 0] * y + R[2, 0] * z,
        R[0, 1] * x + R[1, 1] * y + R[2, 1] * z,
        R[0, 2] * x + R[1, 2] * y + R[2, 2] * z,
    )
    for k in range(3):
        c[k] = o[k] + R[k, 0] * bx + R[k, 1] * by + R[k, 2] * bz
        T[k, 0] = R[k, 0] * n1 + R[k, 1] * n2 + R[k, 2] * n3
    t1, t2 = tangents((T[0, 0], T[1, 0], T[2, 0]))
    T[0, 1], T[1, 1], T[2, 1] = t1
    T[0, 2], T[1, 2], T[2, 2] = t2
    optimizer.primitive[i] = p
    optimizer.force[i, 0], optimizer.force[i, 1], optimizer.force[i, 2] = force
    optimizer.torsion[i], optimizer.offset[i] = 0.0, 0.0


@fused_kernel
def _save_iterate(count: int, optimizer: OptimizerState, save: bool) -> None:
    """Save the iterate, or restore it."""
    for i in range(count):
        for k in range(3):
            if save:
                optimizer.saved_point[i, k], optimizer.saved_force[i, k] = (
                    optimizer.point[i, k],
                    optimizer.force[i, k],
                )
            else:
                optimizer.point[i, k], optimizer.force[i, k] = (
                    optimizer.saved_point[i, k],
                    optimizer.saved_force[i, k],
                )
            for a in range(3):
                if save:
                    optimizer.saved_frame[i, k, a] = optimizer.frame[i, k, a]
                else:
                    optimizer.frame[i, k, a] = optimizer.saved_frame[i, k, a]
        if save:
            optimizer.saved_torsion[i], optimizer.saved_offset[i] = optimizer.torsion[i], optimizer.offset[i]
        else:
            optimizer.torsion[i], optimizer.offset[i] = optimizer.saved_torsion[i], optimizer.saved_offset[i]


@fused_kernel
def _step(
    surfaces: Surfaces,
    frames: PrimitiveFrames,
    prior: Prior,
    count: int,
    scale: float,
    optimizer: OptimizerState,
) -> None:
    """Take the step, times `scale`, from the saved iterate."""
    for i in range(count):
        at = i * UNKNOWNS
        d, T = optimizer.step, optimizer.saved_frame[i]
        f, c = optimizer.saved_force[i], optimizer.saved_point[i]
        F = -component(T, 0, f)
        alpha = component(T, 1, f) / F - scale * d[at + 1] * prior.friction_ratio
        beta = component(T, 2, f) / F - scale * d[at + 2] * prior.friction_ratio
        torsion_ratio = optimizer.saved_torsion[i] / F - scale * d[at + 3] * prior.torsion_lever
        offset = optimizer.saved_offset[i] - scale * d[at + 6] * prior.surface_deviation
        F *= math.exp(-scale * d[at])
        v1, v2 = -scale * d[at + 4], -scale * d[at + 5]
        point = (
            c[0] + v1 * T[0, 1] + v2 * T[0, 2],
            c[1] + v1 * T[1, 1] + v2 * T[1, 2],
            c[2] + v1 * T[2, 1] + v2 * T[2, 2],
        )
        force = (
            F * (alpha * T[0, 1] + beta * T[0, 2] - T[0, 0]),
            F * (alpha * T[1, 1] + beta * T[1, 2] - T[1, 0]),
            F * (alpha * T[2, 1] + beta * T[2, 2] - T[2, 0]),
        )
        set_contact(surfaces, frames, optimizer, i, optimizer.primitive[i], point, force)
        optimizer.torsion[i] = F * torsion_ratio
        optimizer.offset[i] = offset
