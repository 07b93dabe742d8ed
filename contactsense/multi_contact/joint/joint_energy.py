"""Energy of several simultaneous contacts: points, forces and torsions; its gradient and Gauss-Newton matrix.

The energy is that of `contactsense.solvers.posterior.equations`, with one measurement for all contacts:

    E = 1/2 |y - sum_i A_i w_i|^2 + sum_i [ priors of force, friction ratio, torsion and surface offset ]
        + 1/2 |U (z - z0)|^2

y are the rows of `contactsense.multi_contact.measurement_rows`, A_i the rows of the link of contact i, and
w_i = (f, (c + h n) x f + xi n). The unknowns of a contact are the logarithm of its normal force F, the
friction ratios f_t / F, the torsion ratio xi / F, a step of the point c in the tangent plane, and the offset
h of the real surface from the primitive; ratios and offset in units of their priors. In these the priors are
unit normal distributions (Student's t for the friction ratio), so directions that no sensor measures keep
their prior. What is known before of some of the contacts are further rows, see
`contactsense.multi_contact.known_contacts.known_prior`.

Eight sets of contacts are evaluated at a time, see `contactsense.multi_contact.memory.joint_layout`.
"""

import math

import numpy as np

from contactsense.kinematics.linalg.lanes import add_dots, clear
from contactsense.multi_contact.joint.contact_linearization import linearize_contacts
from contactsense.multi_contact.joint.joint_problem import JointProblem
from contactsense.multi_contact.joint.known_rows import add_known_information, fill_known_residuals
from contactsense.multi_contact.memory.buffers import UNKNOWNS, JointState
from contactsense.robots.jit.kernel import fused_kernel
from contactsense.robots.jit.lanes import LANES
from contactsense.robots.surface.convex_primitives import Surfaces, curvature
from contactsense.solvers.posterior.contact_prior import STUDENT_DOF, Prior

from contactsense.multi_contact.memory.joint_layout import (  # isort: skip
    ACTIVE, BNX, BNY, BNZ, BX, BY, BZ, ENERGY, FORCE_PRIOR, FRICTION_RATIO, FX, FY, FZ, JACOBIAN,
    LOG_FORCE, LOG_TAIL, MOMENT_PRIOR, NX, NY, NZ, OFFSET, OFFSET_STEP, PRIOR_ENERGY, PRIOR_GRADIENT,
    PRIOR_MATRIX, PX, PY, PZ, S00, S01, S02, S11, S12, S22,
    SQUARED_RATIO, SX, SY, SZ, TORSION, TX, TY, TZ, W0, W1, W2, W3, W4, W5,
)  # fmt: skip

PRIMITIVE_EXTENT = 0.6
"""Prior standard deviation of a point on a primitive, relative to its bounding radius.

That of a point anywhere on a rod. It bounds the covariance of directions that cannot be resolved.
"""


@fused_kernel
def fill_energies(problem: JointProblem, joint: JointState, number: int) -> None:
    """Energies of the contacts of all lanes, infinite where a force pulls.

    Also fills `joint.residual` and the wrenches.

    Args:
        problem, joint: As for `contactsense.multi_contact.joint.joint_optimization.find_joint_modes`.
        number: Where in `joint.lane` they are put, such as `ENERGY`.
    """
    _, prior, (rows, m), known, count = problem
    y, energy = joint.residual, joint.lane[number]
    for r in range(m):
        for j in range(r * LANES, (r + 1) * LANES):
            y[j] = rows.value[r]
    for i in range(count):
        _prior_energies_and_wrenches(prior, joint.contact[i])
        add_dots(y, (0, 1), joint.rows[i], (0, 6), joint.contact[i], W0 // LANES, m, 6, -1.0)
    clear(energy, 0, 1)
    add_dots(energy, (0, 1), y, (0, 1), y, 0, 1, m, 0.5)
    fill_known_residuals(known, joint)
    deviation = joint.known_residual
    add_dots(energy, (0, 1), deviation, (0, 1), deviation, 0, 1, known.rows, 0.5)
    for i in range(count):
        block = joint.contact[i]
        for j in range(LANES):
            energy[j] += block[PRIOR_ENERGY + j]


@fused_kernel
def _prior_energies_and_wrenches(prior: Prior, block: np.ndarray) -> None:
    """Energies of the priors of one contact, and its wrenches."""
    inverse_lever = 1.0 / prior.torsion_lever
    for j in range(LANES):
        n, f = (block[NX + j], block[NY + j], block[NZ + j]), (block[FX + j], block[FY + j], block[FZ + j])
        xi, h = block[TORSION + j], block[OFFSET + j]
        F = -(n[0] * f[0] + n[1] * f[1] + n[2] * f[2])
        pushes = F > 0.0
        F = F if pushes else 1.0
        fs = block[SX + j] * f[0] + block[SY + j] * f[1] + block[SZ + j] * f[2]
        ft = block[TX + j] * f[0] + block[TY + j] * f[1] + block[TZ + j] * f[2]
        ratio = 1.0 / (block[FRICTION_RATIO + j] * F)
        block[SQUARED_RATIO + j] = (fs * fs + ft * ft) * ratio * ratio
        block[LOG_FORCE + j] = F
        torsion_ratio = xi * inverse_lever / F
        offset = h / block[OFFSET_STEP + j]
        squares = block[MOMENT_PRIOR + j] * (torsion_ratio * torsion_ratio + offset * offset)
        block[PRIOR_ENERGY + j] = 0.5 * squares if pushes else math.inf
        x, y, z = block[PX + j] + h * n[0], block[PY + j] + h * n[1], block[PZ + j] + h * n[2]
        block[W0 + j], block[W1 + j], block[W2 + j] = f
        block[W3 + j] = y * f[2] - z * f[1] + xi * n[0]
        block[W4 + j] = z * f[0] - x * f[2] + xi * n[1]
        block[W5 + j] = x * f[1] - y * f[0] + xi * n[2]
    inverse_force = 1.0 / prior.force
    for j in range(LANES):
        block[LOG_FORCE + j] = math.log(block[LOG_FORCE + j] * inverse_force)
        block[LOG_TAIL + j] = math.log(1.0 + block[SQUARED_RATIO + j] / STUDENT_DOF)
    for j in range(LANES):
        log_force = block[LOG_FORCE + j]
        energy = log_force * log_force + (STUDENT_DOF + 2.0) * block[LOG_TAIL + j]
        block[PRIOR_ENERGY + j] += 0.5 * block[FORCE_PRIOR + j] * energy


@fused_kernel
def linearize(problem: JointProblem, joint: JointState) -> None:
    """Gauss-Newton matrices and gradients of the energies at the contacts in `joint`.

    The matrices (lower triangles) go to `joint.matrix`, the gradients to `joint.step`. Arguments as for
    `contactsense.multi_contact.joint.joint_optimization.find_joint_modes`.
    """
    surfaces, prior, (_, m), known, count = problem
    H, g, J, y = joint.matrix, joint.step, joint.jacobian, joint.residual
    fill_energies(problem, joint, ENERGY)
    for i in range(count):
        at, block = i * UNKNOWNS, joint.contact[i]
        _fill_shape_operators(surfaces, joint.primitive[i], joint.lane[ACTIVE], block)
        linearize_contacts(prior, block)
        for a in range(UNKNOWNS):
            clear(J[at + a], 0, m)
            # Torsion, steps and offset have no force.
            first = 0 if a < 3 else 3
            column = JACOBIAN // LANES + 6 * a + first
            add_dots(J[at + a], (0, 1), joint.rows[i], (first, 6), block, column, m, 6 - first, 1.0)
            for q in range(LANES):
                g[(at + a) * LANES + q] = block[PRIOR_GRADIENT + a * LANES + q]
            add_dots(g, (at + a, 1), J[at + a], (0, 1), y, 0, 1, m, -1.0)
            clear(H[at + a], 0, at)
            first = PRIOR_MATRIX + a * (a + 1) // 2 * LANES
            for q in range((a + 1) * LANES):
                H[at + a, at * LANES + q] = block[first + q]
            add_dots(H[at + a], (0, 1), J, (0, J.shape[1] // LANES), J[at + a], 0, at + a + 1, m, 1.0)
    add_known_information(known, joint)


@fused_kernel
def _fill_shape_operators(
    surfaces: Surfaces, primitive: np.ndarray, active: np.ndarray, block: np.ndarray
) -> None:
    """Shape operators at the points of one contact, where the optimization goes on."""
    for j in range(LANES):
        if active[j] == 0.0:
            continue
        p = primitive[j]
        (
            block[S00 + j], block[S01 + j], block[S02 + j], block[S11 + j], block[S12 + j], block[S22 + j],
        ) = curvature(
            surfaces.kind[p], surfaces.size[p], block[BX + j], block[BY + j], block[BZ + j], block[BNX + j],
            block[BNY + j], block[BNZ + j],
        )  # fmt: skip
