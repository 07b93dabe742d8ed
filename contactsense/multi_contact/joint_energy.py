"""Energy of several simultaneous contacts: points, forces and torsions; its gradient and Gauss-Newton matrix.

The energy is that of `contactsense.solvers.posterior`, with one measurement for all contacts:

    E = 1/2 |y - sum_i A_i w_i|^2 + sum_i [ priors of force, friction ratio, torsion and surface offset ]

y are the rows of `contactsense.multi_contact.measurement_rows`, A_i the rows of the link of contact i, and
w_i = (f, (c + h n) x f + xi n). The unknowns of a contact are the logarithm of its normal force F, the
friction ratios f_t / F, the torsion ratio xi / F and the offset h of the real surface from the primitive,
each in units of its prior, and a step of the point c in the tangent plane. In these the priors are unit
normal distributions (Student's t for the friction ratio), so directions that no sensor measures keep their
prior. A tracked contact also has a prior of its point, and may have one of its force.
"""

import math

import numpy as np

from contactsense.multi_contact.buffers import UNKNOWNS, MeasurementRows, OptimizerState, PrimitiveFrames
from contactsense.robots.jit.kernel import fused_kernel
from contactsense.robots.surface.convex_primitives import Surfaces, curvature
from contactsense.solvers.posterior import STUDENT_DOF, Prior

PRIMITIVE_EXTENT = 0.6
"""Prior standard deviation of a point on a primitive, relative to its bounding radius.

That of a point anywhere on a rod. It bounds the covariance of directions that cannot be resolved.
"""


@fused_kernel
def energy_of(
    links: np.ndarray, rows: MeasurementRows, m: int, prior: Prior, count: int, optimizer: OptimizerState
) -> float:
    """Energy of the contacts in `optimizer`, infinite where a force pulls.

    Also fills `optimizer.residual` and the wrench of each contact.

    Args:
        links: Link of each primitive, shape (P,).
        rows, m, prior, count, optimizer: As for
            `contactsense.multi_contact.joint_optimization.find_joint_mode`.
    """
    y = optimizer.residual
    for r in range(m):
        y[r] = rows.value[r]
    energy = 0.0
    for i in range(count):
        c, T, f, w = optimizer.point[i], optimizer.frame[i], optimizer.force[i], optimizer.wrench[i]
        xi, h = optimizer.torsion[i], optimizer.offset[i]
        F = -component(T, 0, f)
        if F <= 0.0:
            return math.inf
        log_force = math.log(F / prior.force)
        torsion_ratio = xi / (prior.torsion_lever * F)
        squared_ratio = (component(T, 1, f) ** 2 + component(T, 2, f) ** 2) / (prior.friction_ratio * F) ** 2
        squares = (
            torsion_ratio * torsion_ratio
            + log_force * log_force
            + (STUDENT_DOF + 2.0) * math.log(1.0 + squared_ratio / STUDENT_DOF)
        )
        squares += (h / prior.surface_deviation) ** 2
        for k in range(3):
            S = optimizer.prior_point_information[i, k]
            information_shift = (
                S[0] * (c[0] - optimizer.prior_point[i, 0])
                + S[1] * (c[1] - optimizer.prior_point[i, 1])
                + S[2] * (c[2] - optimizer.prior_point[i, 2])
            )
            squares += information_shift * (c[k] - optimizer.prior_point[i, k])
            squares += optimizer.prior_force_information[i] * (f[k] - optimizer.prior_force[i, k]) ** 2
        energy += 0.5 * squares
        px, py, pz = c[0] + h * T[0, 0], c[1] + h * T[1, 0], c[2] + h * T[2, 0]
        w[0], w[1], w[2] = f[0], f[1], f[2]
        w[3] = py * f[2] - pz * f[1] + xi * T[0, 0]
        w[4] = pz * f[0] - px * f[2] + xi * T[1, 0]
        w[5] = px * f[1] - py * f[0] + xi * T[2, 0]
        A = rows.matrix[links[optimizer.primitive[i]]]
        for r in range(m):
            a = A[r]
            y[r] -= a[0] * w[0] + a[1] * w[1] + a[2] * w[2] + a[3] * w[3] + a[4] * w[4] + a[5] * w[5]
    for r in range(m):
        energy += 0.5 * y[r] * y[r]
    return energy


@fused_kernel
def linearize(
    surfaces: Surfaces,
    frames: PrimitiveFrames,
    rows: MeasurementRows,
    m: int,
    prior: Prior,
    count: int,
    optimizer: OptimizerState,
) -> None:
    """Gauss-Newton matrix and gradient of the energy at the contacts in `optimizer`.

    The matrix (lower triangle) goes to `optimizer.matrix`, the gradient to `optimizer.step`. Arguments as for
    `contactsense.multi_contact.joint_optimization.find_joint_mode`.
    """
    size = count * UNKNOWNS
    H, g, J, G = optimizer.matrix, optimizer.step, optimizer.jacobian, optimizer.wrench_jacobian
    energy_of(surfaces.link, rows, m, prior, count, optimizer)
    H[:size, :size] = 0.0
    g[:size] = 0.0
    for i in range(count):
        at = i * UNKNOWNS
        p = optimizer.primitive[i]
        c, T, f, w = optimizer.point[i], optimizer.frame[i], optimizer.force[i], optimizer.wrench[i]
        xi, h = optimizer.torsion[i], optimizer.offset[i]
        k11, k12, k22 = _tangent_curvature(surfaces, frames, optimizer, i)
        F = -component(T, 0, f)
        alpha, beta = component(T, 1, f) / F, component(T, 2, f) / F
        # With constant force and torsion, a step turns the normal and changes the ratios.
        s1, s2 = -(alpha * k11 + beta * k12), -(alpha * k12 + beta * k22)
        _add_prior_row(H, g, at, math.log(F / prior.force), (1.0, 0.0, 0.0, 0.0, s1, s2, 0.0))
        x = xi / (prior.torsion_lever * F)
        _add_prior_row(H, g, at, x, (0.0, 0.0, 0.0, 1.0, -x * s1, -x * s2, 0.0))
        # Weight of the Student t term: the factor that gives a quadratic the same gradient.
        inverse_ratio = 1.0 / prior.friction_ratio
        weight = math.sqrt(
            (STUDENT_DOF + 2.0)
            / (STUDENT_DOF + (alpha * alpha + beta * beta) * inverse_ratio * inverse_ratio)
        )
        e = weight * inverse_ratio
        row = (0.0, weight, 0.0, 0.0, e * (k11 - alpha * s1), e * (k12 - alpha * s2), 0.0)
        _add_prior_row(H, g, at, e * alpha, row)
        row = (0.0, 0.0, weight, 0.0, e * (k12 - beta * s1), e * (k22 - beta * s2), 0.0)
        _add_prior_row(H, g, at, e * beta, row)
        _add_prior_row(H, g, at, h / prior.surface_deviation, (0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0))
        px, py, pz = c[0] + h * T[0, 0], c[1] + h * T[1, 0], c[2] + h * T[2, 0]
        for k in range(6):
            G[k, at] = w[k]
        for a in range(1, 3):
            x = prior.friction_ratio * F
            fx, fy, fz = x * T[0, a], x * T[1, a], x * T[2, a]
            G[0, at + a], G[1, at + a], G[2, at + a] = fx, fy, fz
            G[3, at + a], G[4, at + a], G[5, at + a] = py * fz - pz * fy, pz * fx - px * fz, px * fy - py * fx
        for a in range(3, UNKNOWNS):
            G[0, at + a], G[1, at + a], G[2, at + a] = 0.0, 0.0, 0.0
        for k in range(3):
            G[3 + k, at + 3] = prior.torsion_lever * F * T[k, 0]
            # A step along a tangent turns the normal and with it the torsion.
            G[3 + k, at + 4] = xi * (k11 * T[k, 1] + k12 * T[k, 2])
            G[3 + k, at + 5] = xi * (k12 * T[k, 1] + k22 * T[k, 2])
        for a in range(3):
            # Steps along the tangents, which also turn the offset; last, the offset along the normal.
            e0 = 0.0 if a < 2 else prior.surface_deviation
            e1 = (1.0 + h * k11) if a == 0 else (h * k12 if a == 1 else 0.0)
            e2 = h * k12 if a == 0 else ((1.0 + h * k22) if a == 1 else 0.0)
            tx = e0 * T[0, 0] + e1 * T[0, 1] + e2 * T[0, 2]
            ty = e0 * T[1, 0] + e1 * T[1, 1] + e2 * T[1, 2]
            tz = e0 * T[2, 0] + e1 * T[2, 1] + e2 * T[2, 2]
            if a == 2:
                G[3, at + 6], G[4, at + 6], G[5, at + 6] = 0.0, 0.0, 0.0
            G[3, at + 4 + a] += ty * f[2] - tz * f[1]
            G[4, at + 4 + a] += tz * f[0] - tx * f[2]
            G[5, at + 4 + a] += tx * f[1] - ty * f[0]
        _add_known_contact_prior(surfaces.radius[p], optimizer, i)
        B = rows.matrix[surfaces.link[p]]
        for r in range(m):
            A = B[r]
            for a in range(at, at + UNKNOWNS):
                J[r, a] = (
                    A[0] * G[0, a]
                    + A[1] * G[1, a]
                    + A[2] * G[2, a]
                    + A[3] * G[3, a]
                    + A[4] * G[4, a]
                    + A[5] * G[5, a]
                )
    for r in range(m):
        for a in range(size):
            x = J[r, a]
            g[a] -= x * optimizer.residual[r]
            for b in range(a + 1):
                H[a, b] += x * J[r, b]


@fused_kernel
def component(T: np.ndarray, a: int, f: np.ndarray) -> float:
    """Component of the vector f along column a of the frame T."""
    return float(T[0, a] * f[0] + T[1, a] * f[1] + T[2, a] * f[2])


@fused_kernel
def _tangent_curvature(
    surfaces: Surfaces, frames: PrimitiveFrames, optimizer: OptimizerState, i: int
) -> tuple[float, float, float]:
    """Curvature of the surface along the two tangents at contact i: k11, k12, k22 [1/m]."""
    p = optimizer.primitive[i]
    R, o, c, T = frames.rotation[p], frames.origin[p], optimizer.point[i], optimizer.frame[i]
    b = optimizer.body
    for k in range(3):
        x = 0.0
        for a in range(3):
            x += R[a, k] * (c[a] - o[a])
        b[k, 3] = x
        for column in range(3):
            x = 0.0
            for a in range(3):
                x += R[a, k] * T[a, column]
            b[k, column] = x
    xx, xy, xz, yy, yz, zz = curvature(
        surfaces.kind[p], surfaces.size[p], b[0, 3], b[1, 3], b[2, 3], b[0, 0], b[1, 0], b[2, 0]
    )
    u1 = xx * b[0, 1] + xy * b[1, 1] + xz * b[2, 1]
    u2 = xy * b[0, 1] + yy * b[1, 1] + yz * b[2, 1]
    u3 = xz * b[0, 1] + yz * b[1, 1] + zz * b[2, 1]
    v1 = xx * b[0, 2] + xy * b[1, 2] + xz * b[2, 2]
    v2 = xy * b[0, 2] + yy * b[1, 2] + yz * b[2, 2]
    v3 = xz * b[0, 2] + yz * b[1, 2] + zz * b[2, 2]
    return (
        b[0, 1] * u1 + b[1, 1] * u2 + b[2, 1] * u3,
        b[0, 2] * u1 + b[1, 2] * u2 + b[2, 2] * u3,
        b[0, 2] * v1 + b[1, 2] * v2 + b[2, 2] * v3,
    )


@fused_kernel
def _add_prior_row(
    H: np.ndarray,
    g: np.ndarray,
    at: int,
    residual: float,
    row: tuple[float, float, float, float, float, float, float],
) -> None:
    """Add a squared prior residual with its derivatives by one contact to H (lower triangle) and g."""
    for a in range(UNKNOWNS):
        g[at + a] += residual * row[a]
        for b in range(a + 1):
            H[at + a, at + b] += row[a] * row[b]


@fused_kernel
def _add_known_contact_prior(radius: float, optimizer: OptimizerState, i: int) -> None:
    """Add the priors of point and force of contact i, and the extent of its primitive."""
    at = i * UNKNOWNS
    H, g, G = optimizer.matrix, optimizer.step, optimizer.wrench_jacobian
    S, T, c, c0 = (
        optimizer.prior_point_information[i],
        optimizer.frame[i],
        optimizer.point[i],
        optimizer.prior_point[i],
    )
    extent_information = 1.0 / (PRIMITIVE_EXTENT * radius) ** 2
    for a in range(2):
        for k in range(3):
            tangent_information = S[k, 0] * T[0, a + 1] + S[k, 1] * T[1, a + 1] + S[k, 2] * T[2, a + 1]
            g[at + 4 + a] += tangent_information * (c[k] - c0[k])
            for b in range(a + 1):
                H[at + 4 + a, at + 4 + b] += tangent_information * T[k, b + 1]
        H[at + 4 + a, at + 4 + a] += extent_information
    force_information = optimizer.prior_force_information[i]
    if force_information > 0.0:
        for k in range(3):
            d = optimizer.force[i, k] - optimizer.prior_force[i, k]
            for a in range(3):
                g[at + a] += force_information * d * G[k, at + a]
                for b in range(a + 1):
                    H[at + a, at + b] += force_information * G[k, at + a] * G[k, at + b]
