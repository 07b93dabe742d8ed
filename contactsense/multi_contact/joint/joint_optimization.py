"""Joint optimization of several simultaneous contacts by damped Gauss-Newton steps; the energy is that of
`contactsense.multi_contact.joint.joint_energy`.

Exact sensors make the energy a narrow curved valley: a step along it leaves it, unless it follows the curve.
Two things keep it in:

- Forces and torsions take a step as such, not their logarithms and ratios. The measurement is linear in them
  while the places stay, so that their sum remains what the sensors measure.
- If the energy falls less than predicted, what the step left of the measured rows, beyond the linear model,
  is corrected with the same factored matrix (geodesic acceleration: Transtrum & Sethna 2012, Improvements to
  the Levenberg-Marquardt algorithm for nonlinear least-squares minimization, arXiv:1201.5885).

Eight starts are optimized at a time, one in each SIMD lane, see
`contactsense.multi_contact.memory.joint_layout`.
"""

import math

from contactsense.kinematics.linalg.lanes import (
    add_dots,
    add_multiple,
    cholesky_in_lanes,
    clear,
    substitute,
    substitute_back,
)
from contactsense.multi_contact.joint.contact_step import restore_iterate, save_iterate, take_step
from contactsense.multi_contact.joint.joint_energy import fill_energies, linearize
from contactsense.multi_contact.joint.joint_problem import JointProblem
from contactsense.multi_contact.memory.buffers import UNKNOWNS, JointState
from contactsense.multi_contact.memory.joint_layout import (
    ACTIVE,
    CORRECTED,
    DAMPING,
    DECREASE,
    ENDS,
    ENERGY,
    FULL_SCALE,
    LOG_EVIDENCE,
    MOVING,
    PREDICTED,
    SCALE,
    SEARCHING,
    TRIAL,
    VALID,
)
from contactsense.robots.jit.kernel import fused_kernel
from contactsense.robots.jit.lanes import LANES

MAX_ITERATIONS = 8
"""Maximum number of Gauss-Newton steps."""
LINE_SEARCH_STEPS = 2
"""Maximum number of step lengths tried in one line search."""
MAX_FORCE_DECREASE = 0.8
"""Maximum decrease of a normal force in one step, relative to the force."""
MIN_DECREASE = 0.5
"""A step is corrected if the energy falls by less than this share of the prediction."""
MIN_STEP_SCALE = 0.25
"""If the line search shortens a step below this factor, the next step is damped."""
MIN_DAMPING, MAX_DAMPING = 0.1, 10.0
"""Range of the damping: relative increase of the diagonal of the Gauss-Newton matrix."""
ENERGY_TOLERANCE = 1e-3
"""Converged if the predicted or actual decrease of the energy is less than this.

In curved valleys the remaining decrease may be fifty times as large: 0.05, negligible beside noise.
"""
REJECTION_FACTOR = 3.0
"""A search above the limit is rejected unless this many times the predicted decrease brings it below."""


@fused_kernel
def find_joint_modes(problem: JointProblem, lanes: int, limit: float, joint: JointState) -> None:
    """Most probable contacts, from the initial values in `joint`, which also holds the results.

    Args:
        problem: Whose energy is minimized.
        lanes: Number of starts, at most `LANES`.
        limit: Energy above which the contacts are rejected; a search ends as soon as it cannot get below.
        joint: Initial values, with pushing forces; on return the result, and in `matrix` and
            `inverse_diagonal` the Cholesky factors of the information matrices. In `lane`: `ENERGY`, and
            `LOG_EVIDENCE` (Laplace approximation, up to the constant of the noise). The energy is infinite if
            it stays above the limit or the matrix is not positive definite.
    """
    surfaces, prior, count, lane = problem.surfaces, problem.prior, problem.contacts, joint.lane
    for j in range(LANES):
        lane[ACTIVE, j] = 1.0 if j < lanes else 0.0
        lane[DAMPING, j], lane[ENDS, j] = 0.0, 0.0
    take_rows(problem, joint)
    for iteration in range(MAX_ITERATIONS + 1):
        linearize(problem, joint)
        _solve(count, joint)
        save_iterate(count, joint)
        if iteration == MAX_ITERATIONS or not _any_goes_on(limit, joint):
            break
        _descend(problem, joint)
        for j in range(LANES):
            _adapt_damping(j, iteration, joint)
    for j in range(LANES):
        log_density = count * math.log(2.0 * math.pi / prior.area)
        for i in range(count):
            log_density += prior.log_link_density[surfaces.link[joint.primitive[i, j]]]
            det = 1.0
            for a in range(i * UNKNOWNS, (i + 1) * UNKNOWNS):
                det *= joint.pivot[a * LANES + j]
            log_density -= 0.5 * math.log(det)
        if lane[VALID, j] > 0.0 and lane[ENERGY, j] <= limit:
            lane[LOG_EVIDENCE, j] = log_density - lane[ENERGY, j]
        else:
            lane[ENERGY, j], lane[LOG_EVIDENCE, j] = math.inf, -math.inf


@fused_kernel
def take_rows(problem: JointProblem, joint: JointState) -> None:
    """Fill `joint.rows`: those of the link of each contact."""
    surfaces, _, (rows, m), _, count = problem
    for i in range(count):
        out = joint.rows[i]
        for j in range(LANES):
            A = rows.matrix[surfaces.link[joint.primitive[i, j]]]
            for r in range(m):
                for k in range(6):
                    out[(6 * r + k) * LANES + j] = A[r, k]


@fused_kernel
def _solve(count: int, joint: JointState) -> None:
    """Damp and factor the matrices; `joint.step` becomes the step, `PREDICTED` what it lowers the energy
    by."""
    H, g, lane, size = joint.matrix, joint.step, joint.lane, count * UNKNOWNS
    for a in range(size):
        # Times 1 + damping.
        add_dots(H[a], (a, 1), H[a], (a, 1), lane[DAMPING], 0, 1, 1, 1.0)
    cholesky_in_lanes(H, size, joint.pivot, joint.inverse_diagonal)
    substitute(H, size, joint.inverse_diagonal, g)
    clear(lane[PREDICTED], 0, 1)
    add_dots(lane[PREDICTED], (0, 1), g, (0, 1), g, 0, 1, size, 0.5)
    substitute_back(H, size, joint.inverse_diagonal, g)
    for j in range(LANES):
        lowest = math.inf
        for a in range(size):
            lowest = min(lowest, joint.pivot[a * LANES + j])
        lane[VALID, j] = 1.0 if lowest > 0.0 and lane[PREDICTED, j] < math.inf else 0.0


@fused_kernel
def _any_goes_on(limit: float, joint: JointState) -> bool:
    """End the optimization of lanes that have converged, cannot get below the limit, or have failed."""
    lane, going = joint.lane, False
    for j in range(LANES):
        if lane[ACTIVE, j] == 0.0:
            continue
        predicted = lane[PREDICTED, j]
        ends = lane[DAMPING, j] == 0.0 and (
            predicted < ENERGY_TOLERANCE or lane[ENERGY, j] - REJECTION_FACTOR * predicted > limit
        )
        if ends or lane[ENDS, j] > 0.0 or lane[VALID, j] == 0.0:
            lane[ACTIVE, j] = 0.0
        else:
            going = True
    return going


@fused_kernel
def _adapt_damping(j: int, iteration: int, joint: JointState) -> None:
    """Damping of the next step of a lane, after a step; or its end."""
    lane = joint.lane
    decrease, damping = lane[DECREASE, j], lane[DAMPING, j]
    shortened = lane[SCALE, j] < MIN_STEP_SCALE * lane[FULL_SCALE, j]
    if lane[ACTIVE, j] == 0.0 or decrease >= ENERGY_TOLERANCE:
        lane[DAMPING, j] = 0.0
    elif (damping == 0.0 and decrease > 0.0 and not shortened) or damping >= MAX_DAMPING:
        lane[DAMPING, j], lane[ENDS, j] = 0.0, 1.0
    else:
        # The quadratic model fails, for example across a discontinuity of the curvature: damp the next step.
        lane[DAMPING, j] = max(10.0 * damping, MIN_DAMPING)
    if iteration == MAX_ITERATIONS - 1:
        # The last matrix is that of the result.
        lane[DAMPING, j] = 0.0


@fused_kernel
def _descend(problem: JointProblem, joint: JointState) -> None:
    """Search along the steps of the active lanes for lower energies; `DECREASE` is zero where none was
    found."""
    surfaces, prior, count = problem.surfaces, problem.prior, problem.contacts
    lane, step = joint.lane, joint.step
    for j in range(LANES):
        full = 1.0
        for i in range(count):
            # The longest step that leaves all forces pushing.
            full = min(full, MAX_FORCE_DECREASE / max(step[i * UNKNOWNS * LANES + j], 1e-9))
        lane[SCALE, j], lane[FULL_SCALE, j], lane[DECREASE, j] = full, full, 0.0
        lane[SEARCHING, j] = lane[ACTIVE, j]
    for _ in range(LINE_SEARCH_STEPS):
        for j in range(LANES):
            lane[MOVING, j] = lane[SEARCHING, j]
        take_step(surfaces, prior, count, lane[SCALE], step, joint)
        fill_energies(problem, joint, TRIAL)
        _correct(problem, joint)
        searching = False
        for j in range(LANES):
            if lane[SEARCHING, j] == 0.0:
                continue
            rise = lane[TRIAL, j] - lane[ENERGY, j]
            if rise < 0.0:
                lane[DECREASE, j], lane[SEARCHING, j] = -rise, 0.0
            else:
                # Minimum of the parabola through both energies with the slope at the start.
                slope = lane[PREDICTED, j] * lane[SCALE, j]
                lane[SCALE, j] *= min(max(slope / (rise + 2.0 * slope), 0.1), 0.5)
                searching = True
        if not searching:
            break
    for j in range(LANES):
        lane[MOVING, j] = lane[SEARCHING, j]
    restore_iterate(count, joint)


@fused_kernel
def _correct(problem: JointProblem, joint: JointState) -> None:
    """Correct the steps that lower the energy by less than expected, where that helps; `TRIAL` is the energy
    after it."""
    surfaces, prior, (_, m), _, count = problem
    lane, any_corrected, any_back = joint.lane, False, False
    for j in range(LANES):
        scale, decrease = lane[SCALE, j], lane[ENERGY, j] - lane[TRIAL, j]
        needed = MIN_DECREASE * lane[PREDICTED, j] * scale * (2.0 - scale)
        corrects = lane[SEARCHING, j] > 0.0 and lane[TRIAL, j] < math.inf and decrease < needed
        lane[MOVING, j] = 1.0 if corrects else 0.0
        any_corrected = any_corrected or corrects
    if not any_corrected:
        return
    _fill_corrected_step(count, m, joint)
    take_step(surfaces, prior, count, lane[SCALE], joint.corrected_step, joint)
    fill_energies(problem, joint, CORRECTED)
    for j in range(LANES):
        if lane[MOVING, j] == 0.0:
            continue
        lane[MOVING, j] = 0.0
        if lane[CORRECTED, j] < lane[TRIAL, j]:
            lane[TRIAL, j] = lane[CORRECTED, j]
        elif lane[TRIAL, j] < lane[ENERGY, j]:
            lane[MOVING, j], any_back = 1.0, True
    if any_back:
        take_step(surfaces, prior, count, lane[SCALE], joint.step, joint)


@fused_kernel
def _fill_corrected_step(count: int, m: int, joint: JointState) -> None:
    """Fill `joint.corrected_step`: the step, times `SCALE`, after which `joint.residual` was found, without
    what that exceeds the linear model by."""
    J, d, c, excess, size = joint.jacobian, joint.step, joint.corrected_step, joint.excess, count * UNKNOWNS
    scale = joint.lane[SCALE]
    for a in range(size):
        for j in range(LANES):
            c[a * LANES + j] = scale[j] * d[a * LANES + j]
    for q in range(m * LANES):
        excess[q] = joint.residual[q] - joint.saved_residual[q]
    for a in range(size):
        add_multiple(excess, 0, J[a], 0, c, a, m, -1.0)
    clear(c, 0, size)
    add_dots(c, (0, 1), J, (0, J.shape[1] // LANES), excess, 0, size, m, 1.0)
    substitute(joint.matrix, size, joint.inverse_diagonal, c)
    substitute_back(joint.matrix, size, joint.inverse_diagonal, c)
    for a in range(size):
        for j in range(LANES):
            c[a * LANES + j] = d[a * LANES + j] - c[a * LANES + j] / scale[j]
