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
`contactsense.multi_contact.known_prior`.

Eight sets of contacts are evaluated at a time, see `contactsense.multi_contact.joint_layout`.
"""

import math

import numpy as np

from contactsense.kinematics.linalg.lanes import add_dots, clear
from contactsense.multi_contact.buffers import UNKNOWNS, JointState
from contactsense.multi_contact.joint_problem import JointProblem
from contactsense.multi_contact.known_rows import add_known_information, fill_known_residuals
from contactsense.robots.jit.kernel import fused_kernel
from contactsense.robots.jit.lanes import LANES
from contactsense.robots.surface.convex_primitives import Surfaces, curvature
from contactsense.solvers.posterior.contact_prior import STUDENT_DOF, Prior

from contactsense.multi_contact.joint_layout import (  # isort: skip
    ACTIVE, BNX, BNY, BNZ, BX, BY, BZ, ENERGY, EXTENT, FORCE_PRIOR, FRICTION_RATIO, FX, FY, FZ, JACOBIAN,
    LOG_FORCE, LOG_TAIL, MOMENT_PRIOR, NX, NY, NZ, OFFSET, OFFSET_STEP, PRIOR_ENERGY, PRIOR_GRADIENT,
    PRIOR_MATRIX, PX, PY, PZ, R00, R01, R02, R10, R11, R12, R20, R21, R22, S00, S01, S02, S11, S12, S22,
    SQUARED_RATIO, SX, SY, SZ, TORSION, TORSION_STEP, TX, TY, TZ, W0, W1, W2, W3, W4, W5,
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
        problem, joint: As for `contactsense.multi_contact.joint_optimization.find_joint_modes`.
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
    `contactsense.multi_contact.joint_optimization.find_joint_modes`.
    """
    surfaces, prior, (_, m), known, count = problem
    H, g, J, y = joint.matrix, joint.step, joint.jacobian, joint.residual
    fill_energies(problem, joint, ENERGY)
    for i in range(count):
        at, block = i * UNKNOWNS, joint.contact[i]
        _fill_shape_operators(surfaces, joint.primitive[i], joint.lane[ACTIVE], block)
        _linearize_contacts(prior, block)
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


@fused_kernel
def _linearize_contacts(prior: Prior, block: np.ndarray) -> None:
    """Derivatives of the wrenches of one contact, and what its priors add to matrices and gradients."""
    inverse_lever = 1.0 / prior.torsion_lever
    for j in range(LANES):
        n, f = (block[NX + j], block[NY + j], block[NZ + j]), (block[FX + j], block[FY + j], block[FZ + j])
        s, t = (block[SX + j], block[SY + j], block[SZ + j]), (block[TX + j], block[TY + j], block[TZ + j])
        xi, h = block[TORSION + j], block[OFFSET + j]
        friction_ratio, deviation = block[FRICTION_RATIO + j], block[OFFSET_STEP + j]
        inverse_ratio = 1.0 / friction_ratio
        # Curvature of the surface along the tangents: k11, k12, k22.
        s0 = block[R00 + j] * s[0] + block[R10 + j] * s[1] + block[R20 + j] * s[2]
        s1 = block[R01 + j] * s[0] + block[R11 + j] * s[1] + block[R21 + j] * s[2]
        s2 = block[R02 + j] * s[0] + block[R12 + j] * s[1] + block[R22 + j] * s[2]
        t0 = block[R00 + j] * t[0] + block[R10 + j] * t[1] + block[R20 + j] * t[2]
        t1 = block[R01 + j] * t[0] + block[R11 + j] * t[1] + block[R21 + j] * t[2]
        t2 = block[R02 + j] * t[0] + block[R12 + j] * t[1] + block[R22 + j] * t[2]
        xx, xy, xz = block[S00 + j], block[S01 + j], block[S02 + j]
        yy, yz, zz = block[S11 + j], block[S12 + j], block[S22 + j]
        u0, u1, u2 = xx * s0 + xy * s1 + xz * s2, xy * s0 + yy * s1 + yz * s2, xz * s0 + yz * s1 + zz * s2
        v0, v1, v2 = xx * t0 + xy * t1 + xz * t2, xy * t0 + yy * t1 + yz * t2, xz * t0 + yz * t1 + zz * t2
        k11, k12, k22 = (
            s0 * u0 + s1 * u1 + s2 * u2,
            t0 * u0 + t1 * u1 + t2 * u2,
            t0 * v0 + t1 * v1 + t2 * v2,
        )
        F = max(-(n[0] * f[0] + n[1] * f[1] + n[2] * f[2]), 1e-300)
        alpha, beta = (
            (s[0] * f[0] + s[1] * f[1] + s[2] * f[2]) / F,
            (t[0] * f[0] + t[1] * f[1] + t[2] * f[2]) / F,
        )
        # Derivatives of the wrench: by the logarithm of the force, the wrench itself.
        G = JACOBIAN + j
        x, y, z = block[PX + j] + h * n[0], block[PY + j] + h * n[1], block[PZ + j] + h * n[2]
        for k in range(6):
            block[G + k * LANES] = block[W0 + k * LANES + j]
        scale = friction_ratio * F
        a, b = (scale * s[0], scale * s[1], scale * s[2]), (scale * t[0], scale * t[1], scale * t[2])
        block[G + 6 * LANES], block[G + 7 * LANES], block[G + 8 * LANES] = a
        block[G + 9 * LANES] = y * a[2] - z * a[1]
        block[G + 10 * LANES] = z * a[0] - x * a[2]
        block[G + 11 * LANES] = x * a[1] - y * a[0]
        block[G + 12 * LANES], block[G + 13 * LANES], block[G + 14 * LANES] = b
        block[G + 15 * LANES] = y * b[2] - z * b[1]
        block[G + 16 * LANES] = z * b[0] - x * b[2]
        block[G + 17 * LANES] = x * b[1] - y * b[0]
        torsion = prior.torsion_lever * F
        block[TORSION_STEP + j] = torsion
        block[G + 21 * LANES], block[G + 22 * LANES], block[G + 23 * LANES] = (
            torsion * n[0],
            torsion * n[1],
            torsion * n[2],
        )
        # A step along a tangent moves the point, turns the offset, and turns the torsion with the normal.
        e11, e12, e22 = 1.0 + h * k11, h * k12, 1.0 + h * k22
        c0, c1, c2 = e11 * s[0] + e12 * t[0], e11 * s[1] + e12 * t[1], e11 * s[2] + e12 * t[2]
        block[G + 27 * LANES] = c1 * f[2] - c2 * f[1] + xi * (k11 * s[0] + k12 * t[0])
        block[G + 28 * LANES] = c2 * f[0] - c0 * f[2] + xi * (k11 * s[1] + k12 * t[1])
        block[G + 29 * LANES] = c0 * f[1] - c1 * f[0] + xi * (k11 * s[2] + k12 * t[2])
        c0, c1, c2 = e12 * s[0] + e22 * t[0], e12 * s[1] + e22 * t[1], e12 * s[2] + e22 * t[2]
        block[G + 33 * LANES] = c1 * f[2] - c2 * f[1] + xi * (k12 * s[0] + k22 * t[0])
        block[G + 34 * LANES] = c2 * f[0] - c0 * f[2] + xi * (k12 * s[1] + k22 * t[1])
        block[G + 35 * LANES] = c0 * f[1] - c1 * f[0] + xi * (k12 * s[2] + k22 * t[2])
        block[G + 39 * LANES] = deviation * (n[1] * f[2] - n[2] * f[1])
        block[G + 40 * LANES] = deviation * (n[2] * f[0] - n[0] * f[2])
        block[G + 41 * LANES] = deviation * (n[0] * f[1] - n[1] * f[0])
        # Priors. With constant force and torsion, a step turns the normal and changes the ratios.
        q1, q2 = -(alpha * k11 + beta * k12), -(alpha * k12 + beta * k22)
        chi = xi * inverse_lever / F
        # How much the priors of the force, and of torsion and offset, count.
        wf, wm = block[FORCE_PRIOR + j], block[MOMENT_PRIOR + j]
        # Weight of the Student t term: the factor that gives a quadratic the same gradient.
        squared_ratio = (alpha * alpha + beta * beta) * inverse_ratio * inverse_ratio
        ww = wf * (STUDENT_DOF + 2.0) / (STUDENT_DOF + squared_ratio)
        a4, a5 = inverse_ratio * (k11 - alpha * q1), inverse_ratio * (k12 - alpha * q2)
        b4, b5 = inverse_ratio * (k12 - beta * q1), inverse_ratio * (k22 - beta * q2)
        ra, rb = ww * inverse_ratio * alpha, ww * inverse_ratio * beta
        lf, one = wf * block[LOG_FORCE + j], wf + wm * chi * chi
        g = PRIOR_GRADIENT + j
        block[g], block[g + LANES], block[g + 2 * LANES], block[g + 3 * LANES] = lf, ra, rb, wm * chi
        block[g + 4 * LANES] = lf * q1 - wm * chi * chi * q1 + ra * a4 + rb * b4
        block[g + 5 * LANES] = lf * q2 - wm * chi * chi * q2 + ra * a5 + rb * b5
        block[g + 6 * LANES] = wm * h / deviation
        H = PRIOR_MATRIX + j
        block[H], block[H + 2 * LANES] = wf, ww
        block[H + 5 * LANES], block[H + 9 * LANES] = ww, wm
        block[H + 10 * LANES], block[H + 11 * LANES], block[H + 12 * LANES] = wf * q1, ww * a4, ww * b4
        block[H + 13 * LANES] = -wm * chi * q1
        block[H + 14 * LANES] = one * q1 * q1 + ww * (a4 * a4 + b4 * b4) + block[EXTENT + j]
        block[H + 15 * LANES], block[H + 16 * LANES], block[H + 17 * LANES] = wf * q2, ww * a5, ww * b5
        block[H + 18 * LANES] = -wm * chi * q2
        block[H + 19 * LANES] = one * q1 * q2 + ww * (a4 * a5 + b4 * b5)
        block[H + 20 * LANES] = one * q2 * q2 + ww * (a5 * a5 + b5 * b5) + block[EXTENT + j]
        block[H + 27 * LANES] = wm
