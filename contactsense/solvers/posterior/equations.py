"""Equations of the posterior of one contact on one primitive: energy, gradient and Gauss-Newton matrix, in
numbers instead of arrays.

The unknowns are the force f (3), the torsion xi and the contact centroid c on the surface (2). With the
fused wrench w_k of the link hypothesis, its information matrix L, and the residual d = (f, c x f + xi n)
- w_k, the energy (negative log posterior) is

    E = 1/2 d^T L' d + 1/2 (xi / (lever F))^2 + (nu + 2)/2 log(1 + rho^2 / nu) + 1/2 log(F / F0)^2
        - 2 log(1 + |f_t|^2 / F^2)

with the normal force F = -f . n and the friction ratio rho = |f_t| / (friction_ratio F).

The second term limits the torsion that a contact patch transmits. The third limits the friction: a force
that is uniform on the friction disc has the standard deviation friction_ratio = mu / 2 along each tangent.
The distribution is Student's t with nu degrees of freedom; its heavy tail allows for ribs, steps and screw
heads that the primitives do not model and where the real normal differs. The fourth term is a log-normal
prior of the normal force with median F0 and log standard deviation 1. It matters only if the sensors do
not determine the force. These are densities of log F, xi / F and f_t / F; that of f and xi is 1 / F^4 times
as high, (1 + |f_t|^2 / F^2)^2 / |f|^4: hence the last term. Without it the mode would be up to half a
standard deviation from the mean on a round link, where F changes with the place.

L' is L with the uncertainty of the surface: an offset of standard deviation s along the normal adds s^2 u u^T
to the covariance, u = (0, n x f). The 6x6 Gauss-Newton matrix at the mode gives the evidence (Laplace
approximation) and the covariance (`contactsense.solvers.posterior.friction_tails`).

The functions are inlined and have no branches: `contactsense.solvers.posterior.energy` calls them
for one contact, `contactsense.solvers.posterior.simd` in loops that are vectorized.
"""

import math

from contactsense.kinematics.logarithm import logarithm
from contactsense.kinematics.spatial import Six
from contactsense.kinematics.wrench_information import (
    Block,
    dot,
    matvec,
    shift_information,
    shift_vector,
    transposed_matvec,
)
from contactsense.robots.jit.kernel import inlined_fused_kernel
from contactsense.robots.vectors import Vector, tangents
from contactsense.solvers.posterior.contact_prior import FORCE_POWER, STUDENT_DOF, Contact

LEAST_WEIGHT = 0.1
"""Lower bound of the weight of the friction ratio, for coefficients of friction above 1.2."""
Information = tuple[Block, Block, Block]
"""An information matrix, as `contactsense.kinematics.wrench_information.blocks` splits it."""
Inflation = tuple[Six, float, float]
"""Result of `inflate`."""
UpperTriangle = tuple[
    float, float, float, float, float, float, float, float, float, float, float,
    float, float, float, float, float, float, float, float, float, float,
]  # fmt: skip
"""Upper triangle of a symmetric 6x6 matrix, row by row."""


@inlined_fused_kernel
def inflate(information: Information, offset_variance: float, contact: Contact) -> Inflation:
    """Low-rank change of the information by the surface's offset: L' = L - s^2 v v^T / (1 + s^2 u . v), v
    = L u.

    By the Sherman-Morrison formula, with u = (0, n x f) and `offset_variance` s^2 [m^2].

    Returns:
        v (tuple of 6 floats), s^2 / (1 + s^2 u . v), and the determinant ratio 1 + s^2 u . v.
    """
    _, (nx, ny, nz), (fx, fy, fz), _ = contact
    u = (ny * fz - nz * fy, nz * fx - nx * fz, nx * fy - ny * fx)
    _, D, M = information
    force, moment = transposed_matvec(D, u), matvec(M, u)
    variance_ratio = 1.0 + offset_variance * dot(u, moment)
    v = (force[0], force[1], force[2], moment[0], moment[1], moment[2])
    return v, offset_variance / variance_ratio, variance_ratio


@inlined_fused_kernel
def energy_of(
    w: Six,
    information: Information,
    friction_ratio: float,
    torsion_lever: float,
    median_force: float,
    inflation: Inflation,
    contact: Contact,
) -> tuple[float, float, float]:
    """Energy of a contact, if its force pushes.

    Args:
        w, information: Fused wrench and its information matrix, body frame.
        friction_ratio, torsion_lever: See `contactsense.solvers.posterior.contact_prior.Prior`.
        median_force: F0, see `force` there [N].
        inflation: Result of `inflate`.
        contact: The contact, body frame.

    Returns:
        The energy; normal force F [N], of which only a positive one pushes; log(F / F0).
    """
    (cx, cy, cz), (nx, ny, nz), (fx, fy, fz), xi = contact
    normal_force = -(fx * nx + fy * ny + fz * nz)
    df = (fx - w[0], fy - w[1], fz - w[2])
    dm = (
        cy * fz - cz * fy + xi * nx - w[3],
        cz * fx - cx * fz + xi * ny - w[4],
        cx * fy - cy * fx + xi * nz - w[5],
    )
    F, D, M = information
    v, gain, _ = inflation
    vd = v[0] * df[0] + v[1] * df[1] + v[2] * df[2] + v[3] * dm[0] + v[4] * dm[1] + v[5] * dm[2]
    dLd = dot(df, matvec(F, df)) + 2.0 * dot(dm, matvec(D, df)) + dot(dm, matvec(M, dm))
    inverse = 1.0 / normal_force
    torsion_ratio = xi * inverse / torsion_lever
    ratio_unit = inverse / friction_ratio
    squared_ratio = (fx * fx + fy * fy + fz * fz - normal_force * normal_force) * ratio_unit * ratio_unit
    log_force = logarithm(normal_force / median_force)
    energy = 0.5 * (dLd - gain * vd * vd + torsion_ratio * torsion_ratio)
    return energy + _energy_of_force(log_force, squared_ratio, friction_ratio), normal_force, log_force


@inlined_fused_kernel
def _energy_of_force(log_force: float, squared_ratio: float, friction_ratio: float) -> float:
    """The energy's terms of log(F / F0) and of the friction ratio's square rho^2."""
    # The sum of (nu + 2) / 2 = 3 and -FORCE_POWER / 2 = -2 logarithms is one logarithm.
    tail = 1.0 + squared_ratio / STUDENT_DOF
    share = tail / (1.0 + squared_ratio * friction_ratio * friction_ratio)
    return float(0.5 * log_force * log_force + logarithm(tail * share * share))


@inlined_fused_kernel
def gauss_newton_equations(
    w: Six,
    information: Information,
    friction_ratio: float,
    torsion_lever: float,
    inflation: Inflation,
    W: Six,
    contact: Contact,
    log_force: float,
) -> tuple[UpperTriangle, Six, tuple[Vector, Vector], float]:
    """Gauss-Newton matrix and gradient of the energy of a contact that pushes.

    Args:
        w, information, friction_ratio, torsion_lever, inflation, contact: As for
            `energy_of`.
        W: Shape operator of the surface at c (upper triangle) [1/m].
        log_force: log(F / F0).

    Returns:
        The matrix and the gradient, for (f, xi, v1, v2); the tangents of v1 and v2; and the energy.
    """
    (cx, cy, cz), (nx, ny, nz), (fx, fy, fz), xi = contact
    t1, t2 = tangents(contact.normal)
    (t1x, t1y, t1z), (t2x, t2y, t2z) = t1, t2
    # How the normal turns with a step along each tangent, and the curvature in the tangent plane.
    w1x = W[0] * t1x + W[1] * t1y + W[2] * t1z
    w1y = W[1] * t1x + W[3] * t1y + W[4] * t1z
    w1z = W[2] * t1x + W[4] * t1y + W[5] * t1z
    w2x = W[0] * t2x + W[1] * t2y + W[2] * t2z
    w2y = W[1] * t2x + W[3] * t2y + W[4] * t2z
    w2z = W[2] * t2x + W[4] * t2y + W[5] * t2z
    k11 = t1x * w1x + t1y * w1y + t1z * w1z
    k12 = t1x * w2x + t1y * w2y + t1z * w2z
    k22 = t2x * w2x + t2y * w2y + t2z * w2z
    # Change of the moment about c by xi, v1, v2.
    b0 = (nx, ny, nz)
    b1 = (t1y * fz - t1z * fy + xi * w1x, t1z * fx - t1x * fz + xi * w1y, t1x * fy - t1y * fx + xi * w1z)
    b2 = (t2y * fz - t2z * fy + xi * w2x, t2z * fx - t2x * fz + xi * w2y, t2x * fy - t2y * fx + xi * w2z)
    # H = G^T A G and g = G^T A d with A the information about c, G = diag(1, (b0 b1 b2)) and d the residual
    # wrench about c.
    F, D, M = shift_information(*information, cx, cy, cz)
    p0, p1, p2 = matvec(M, b0), matvec(M, b1), matvec(M, b2)
    c0, c1, c2 = transposed_matvec(D, b0), transposed_matvec(D, b1), transposed_matvec(D, b2)
    df = (fx - w[0], fy - w[1], fz - w[2])
    dm = (
        xi * nx - w[3] + cy * w[2] - cz * w[1],
        xi * ny - w[4] + cz * w[0] - cx * w[2],
        xi * nz - w[5] + cx * w[1] - cy * w[0],
    )
    af, am = matvec(F, df), matvec(D, df)
    bf, bm = transposed_matvec(D, dm), matvec(M, dm)
    m = (am[0] + bm[0], am[1] + bm[1], am[2] + bm[2])
    # Inflation by the surface's offset. u is a pure moment, so v = L u becomes X^T v about c.
    v, s, _ = inflation
    vm = (v[3], v[4], v[5])
    vf = shift_vector((v[0], v[1], v[2]), vm, cx, cy, cz)
    vb = (dot(b0, vm), dot(b1, vm), dot(b2, vm))
    vd = dot(vf, df) + dot(vm, dm)
    # Priors: torsion ratio xi / (lever F), log(F / F0) and friction ratios (t . f) / (friction_ratio F).
    # Their derivatives by (f, xi, v) are q1 u + (0, 1 / (lever F), 0), -u / F and, for each tangent,
    # q u + p a, with u = (n, 0, u4, u5) and a = (t, 0, k F): dF = -n . df - sum_a f_a k_ai dv_i, and the
    # tangents turn by k_ai F dv_i.
    normal_force = -(fx * nx + fy * ny + fz * nz)
    f1 = t1x * fx + t1y * fy + t1z * fz
    f2 = t2x * fx + t2y * fy + t2z * fz
    u4, u5 = f1 * k11 + f2 * k12, f1 * k12 + f2 * k22
    inverse = 1.0 / normal_force
    torsion_unit = inverse / torsion_lever
    r1 = xi * torsion_unit
    # Weight of the terms of the friction ratio: the factor that gives a quadratic the same gradient.
    ratio_unit = inverse / friction_ratio
    squared_ratio = (f1 * f1 + f2 * f2) * ratio_unit * ratio_unit
    squared_friction = friction_ratio * friction_ratio
    tail, density = STUDENT_DOF + squared_ratio, 1.0 + squared_friction * squared_ratio
    weight = ((STUDENT_DOF + 2.0) * density - FORCE_POWER * squared_friction * tail) / (tail * density)
    p = ratio_unit * math.sqrt(max(weight, LEAST_WEIGHT))
    r3, r4 = f1 * p, f2 * p
    q1, q3, q4 = r1 * inverse, r3 * inverse, r4 * inverse
    k11, k12, k22 = k11 * normal_force, k12 * normal_force, k22 * normal_force
    pp = p * p
    # The sum of their squares is u h^T + h u^T + p^2 (a1 a1^T + a2 a2^T) and the terms of xi.
    half = 0.5 * (q1 * q1 + inverse * inverse + q3 * q3 + q4 * q4)
    s3, s4 = p * q3, p * q4
    h0 = half * nx + s3 * t1x + s4 * t2x
    h1 = half * ny + s3 * t1y + s4 * t2y
    h2 = half * nz + s3 * t1z + s4 * t2z
    h4 = half * u4 + s3 * k11 + s4 * k12
    h5 = half * u5 + s3 * k12 + s4 * k22
    # In the force, a1 a1^T + a2 a2^T = 1 - n n^T.
    e0, e1, e2 = h0 - 0.5 * pp * nx, h1 - 0.5 * pp * ny, h2 - 0.5 * pp * nz
    qx = q1 * torsion_unit
    a, b, c = s * vf[0], s * vf[1], s * vf[2]
    h00 = F[0][0] - a * vf[0] + pp + 2.0 * nx * e0
    h01 = F[0][1] - a * vf[1] + nx * e1 + ny * e0
    h02 = F[0][2] - a * vf[2] + nx * e2 + nz * e0
    h03 = c0[0] - a * vb[0] + qx * nx
    h04 = c1[0] - a * vb[1] + nx * h4 + u4 * h0 + pp * (t1x * k11 + t2x * k12)
    h05 = c2[0] - a * vb[2] + nx * h5 + u5 * h0 + pp * (t1x * k12 + t2x * k22)
    h11 = F[1][1] - b * vf[1] + pp + 2.0 * ny * e1
    h12 = F[1][2] - b * vf[2] + ny * e2 + nz * e1
    h13 = c0[1] - b * vb[0] + qx * ny
    h14 = c1[1] - b * vb[1] + ny * h4 + u4 * h1 + pp * (t1y * k11 + t2y * k12)
    h15 = c2[1] - b * vb[2] + ny * h5 + u5 * h1 + pp * (t1y * k12 + t2y * k22)
    h22 = F[2][2] - c * vf[2] + pp + 2.0 * nz * e2
    h23 = c0[2] - c * vb[0] + qx * nz
    h24 = c1[2] - c * vb[1] + nz * h4 + u4 * h2 + pp * (t1z * k11 + t2z * k12)
    h25 = c2[2] - c * vb[2] + nz * h5 + u5 * h2 + pp * (t1z * k12 + t2z * k22)
    a, b, c = s * vb[0], s * vb[1], s * vb[2]
    h33 = dot(b0, p0) - a * vb[0] + torsion_unit * torsion_unit
    h34 = dot(b0, p1) - a * vb[1] + qx * u4
    h35 = dot(b0, p2) - a * vb[2] + qx * u5
    h44 = dot(b1, p1) - b * vb[1] + 2.0 * u4 * h4 + pp * (k11 * k11 + k12 * k12)
    h45 = dot(b1, p2) - b * vb[2] + u4 * h5 + u5 * h4 + pp * (k11 * k12 + k12 * k22)
    h55 = dot(b2, p2) - c * vb[2] + 2.0 * u5 * h5 + pp * (k12 * k12 + k22 * k22)
    r = s * vd
    along_u = r1 * q1 - log_force * inverse + r3 * q3 + r4 * q4
    r3, r4 = p * r3, p * r4
    g0 = af[0] + bf[0] - r * vf[0] + along_u * nx + r3 * t1x + r4 * t2x
    g1 = af[1] + bf[1] - r * vf[1] + along_u * ny + r3 * t1y + r4 * t2y
    g2 = af[2] + bf[2] - r * vf[2] + along_u * nz + r3 * t1z + r4 * t2z
    g3 = dot(b0, m) - r * vb[0] + r1 * torsion_unit
    g4 = dot(b1, m) - r * vb[1] + along_u * u4 + r3 * k11 + r4 * k12
    g5 = dot(b2, m) - r * vb[2] + along_u * u5 + r3 * k12 + r4 * k22
    force = (af[0] + bf[0], af[1] + bf[1], af[2] + bf[2])
    energy = 0.5 * (dot(df, force) + dot(dm, m) - r * vd + r1 * r1)
    matrix = (
        h00, h01, h02, h03, h04, h05, h11, h12, h13, h14, h15,
        h22, h23, h24, h25, h33, h34, h35, h44, h45, h55,
    )  # fmt: skip
    energy += _energy_of_force(log_force, squared_ratio, friction_ratio)
    return matrix, (g0, g1, g2, g3, g4, g5), (t1, t2), energy
