"""Gauss-Newton equations of the posterior of one contact on one primitive, whose energy is derived in
`contactsense.solvers.posterior.equations`.

The unknowns are the force f (3), the torsion xi, and a step v (2) of the contact centroid along two tangents
of the surface. Everything is taken about the centroid. With the information matrix A = [F D^T; D M] there,
the residual wrench d, and G = diag(1, (b0 b1 b2)), whose columns b are the moments of unit changes of xi, v1
and v2, the likelihood has

    H = G^T A G,    g = G^T A d.

The priors of the ratios xi / (lever F), t1 . f / F and t2 . f / F, and of log F, add the outer products of
their derivatives by (f, xi, v). With u = (n, 0, u4, u5), these are q u plus

    (0, 1 / (lever F), 0),    p a1,    p a2,    and -u / F alone.

As dF = -n . df - sum_a f_a k_ai dv_i and the tangents turn by k_ai F dv_i, a_i = (t_i, 0, k_i F). The sum of
the outer products is u h^T + h u^T + p^2 (a1 a1^T + a2 a2^T), and the terms of xi.
"""

import math
from typing import NamedTuple

from contactsense.kinematics.linalg.ldl import UpperTriangle
from contactsense.kinematics.spatial import Six
from contactsense.kinematics.wrench_information import (
    cross,
    dot,
    matvec,
    shift_information,
    shift_vector,
    symmetric_matvec,
    transposed_matvec,
)
from contactsense.robots.jit.kernel import inlined_fused_kernel
from contactsense.robots.vectors import Vector, tangents
from contactsense.solvers.posterior.contact_prior import FORCE_POWER, STUDENT_DOF, Contact
from contactsense.solvers.posterior.equations import Inflation, Information, energy_of_force

LEAST_WEIGHT = 0.1
"""Lower bound of the weight of the friction ratio, for coefficients of friction above 1.2."""
_Pair = tuple[float, float]
_Columns = tuple[Vector, Vector, Vector]


class _Offset(NamedTuple):
    """The change of the likelihood by the surface's offset: H - s v v^T and g - s (v . d) v."""

    gain: float
    """s."""
    force: Vector
    """Part of v along the force."""
    along: Vector
    """Parts of v along xi, v1 and v2."""
    product: float
    """v . d."""


class _PriorTerms(NamedTuple):
    """What the priors contribute, in the terms of the module's docstring."""

    u: _Pair
    """u4 and u5."""
    k1: _Pair
    """The parts of a1 along v1 and v2."""
    k2: _Pair
    """Those of a2."""
    squared_weight: float
    """p^2."""
    h: Vector
    """The part of h along the force."""
    h_along: _Pair
    """Its parts along v1 and v2."""
    torsion_unit: float
    """1 / (lever F)."""
    torsion_ratio: float
    """xi / (lever F)."""
    torsion_slope: float
    """q of the ratio of xi, times `torsion_unit`."""
    along_u: float
    """The gradient is this times u, ..."""
    along_a: _Pair
    """... plus these times a1 and a2, and the ratio of xi times its derivative."""
    squared_ratio: float
    """Squared friction ratio rho^2."""


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
            `contactsense.solvers.posterior.equations.energy_of`.
        W: Shape operator of the surface at c (upper triangle) [1/m].
        log_force: log(F / F0).

    Returns:
        The matrix and the gradient, for (f, xi, v1, v2); the tangents of v1 and v2; and the energy.
    """
    (cx, cy, cz), normal, _, _ = contact
    t1, t2 = tangents(normal)
    # How the normal turns with a step along each tangent.
    w1, w2 = symmetric_matvec(W, t1), symmetric_matvec(W, t2)
    columns = (normal, _moment_of_step(contact, t1, w1), _moment_of_step(contact, t2, w2))
    F, D, M = shift_information(*information, cx, cy, cz)
    df, dm = _residual(w, contact)
    force, moment = _weighted((F, D, M), df, dm)
    offset = _offset_about(contact.point, inflation, columns, df, dm)
    curvature = (dot(t1, w1), dot(t1, w2), dot(t2, w2))
    prior = _prior_terms(contact, (t1, t2), curvature, friction_ratio, torsion_lever, log_force)
    matrix = _matrix((F, D, M), columns, offset, normal, (t1, t2), prior)
    gradient = _gradient(force, moment, columns, offset, normal, (t1, t2), prior)
    misfit = dot(df, force) + dot(dm, moment) - offset.gain * offset.product * offset.product
    energy = 0.5 * (misfit + prior.torsion_ratio * prior.torsion_ratio)
    energy += energy_of_force(log_force, prior.squared_ratio, friction_ratio)
    return matrix, gradient, (t1, t2), energy


@inlined_fused_kernel
def _moment_of_step(contact: Contact, t: Vector, turn: Vector) -> Vector:
    """Change of the moment by a step along a tangent, with which the normal turns: t x f + xi W t."""
    m, xi = cross(t, contact.force), contact.torsion
    return m[0] + xi * turn[0], m[1] + xi * turn[1], m[2] + xi * turn[2]


@inlined_fused_kernel
def _residual(w: Six, contact: Contact) -> tuple[Vector, Vector]:
    """Force and moment of the residual wrench about the contact centroid: those of the contact minus the
    measured ones."""
    (cx, cy, cz), (nx, ny, nz), (fx, fy, fz), xi = contact
    return (fx - w[0], fy - w[1], fz - w[2]), (
        xi * nx - w[3] + cy * w[2] - cz * w[1],
        xi * ny - w[4] + cz * w[0] - cx * w[2],
        xi * nz - w[5] + cx * w[1] - cy * w[0],
    )


@inlined_fused_kernel
def _weighted(information: Information, df: Vector, dm: Vector) -> tuple[Vector, Vector]:
    """Force and moment of A d."""
    F, D, M = information
    af, am, bf, bm = matvec(F, df), matvec(D, df), transposed_matvec(D, dm), matvec(M, dm)
    return (
        (af[0] + bf[0], af[1] + bf[1], af[2] + bf[2]),
        (am[0] + bm[0], am[1] + bm[1], am[2] + bm[2]),
    )


@inlined_fused_kernel
def _offset_about(c: Vector, inflation: Inflation, columns: _Columns, df: Vector, dm: Vector) -> _Offset:
    """The inflation by the surface's offset about the centroid. Its u is a pure moment, so that v = L u
    becomes X^T v."""
    v, gain, _ = inflation
    moment = (v[3], v[4], v[5])
    force = shift_vector((v[0], v[1], v[2]), moment, c[0], c[1], c[2])
    along = (dot(columns[0], moment), dot(columns[1], moment), dot(columns[2], moment))
    return _Offset(gain, force, along, dot(force, df) + dot(moment, dm))


@inlined_fused_kernel
def _prior_terms(
    contact: Contact,
    tangent: tuple[Vector, Vector],
    curvature: Vector,
    friction_ratio: float,
    torsion_lever: float,
    log_force: float,
) -> _PriorTerms:
    """What the priors contribute. `curvature` is that in the tangent plane, (k11, k12, k22) [1/m]."""
    (t1x, t1y, t1z), (t2x, t2y, t2z) = tangent
    (nx, ny, nz), (k11, k12, k22) = contact.normal, curvature
    normal_force = -dot(contact.force, contact.normal)
    f1, f2 = dot(tangent[0], contact.force), dot(tangent[1], contact.force)
    u4, u5 = f1 * k11 + f2 * k12, f1 * k12 + f2 * k22
    k11, k12, k22 = k11 * normal_force, k12 * normal_force, k22 * normal_force
    inverse = 1.0 / normal_force
    torsion_unit = inverse / torsion_lever
    r1 = contact.torsion * torsion_unit
    # Weight of the terms of the friction ratio: the factor that gives a quadratic the same gradient.
    ratio_unit = inverse / friction_ratio
    squared_ratio = (f1 * f1 + f2 * f2) * ratio_unit * ratio_unit
    squared_friction = friction_ratio * friction_ratio
    tail, density = STUDENT_DOF + squared_ratio, 1.0 + squared_friction * squared_ratio
    weight = ((STUDENT_DOF + 2.0) * density - FORCE_POWER * squared_friction * tail) / (tail * density)
    p = ratio_unit * math.sqrt(max(weight, LEAST_WEIGHT))
    r3, r4 = f1 * p, f2 * p
    q1, q3, q4 = r1 * inverse, r3 * inverse, r4 * inverse
    half = 0.5 * (q1 * q1 + inverse * inverse + q3 * q3 + q4 * q4)
    s3, s4 = p * q3, p * q4
    h = (
        half * nx + s3 * t1x + s4 * t2x,
        half * ny + s3 * t1y + s4 * t2y,
        half * nz + s3 * t1z + s4 * t2z,
    )
    return _PriorTerms(
        (u4, u5),
        (k11, k12),
        (k12, k22),
        p * p,
        h,
        (half * u4 + s3 * k11 + s4 * k12, half * u5 + s3 * k12 + s4 * k22),
        torsion_unit,
        r1,
        q1 * torsion_unit,
        r1 * q1 - log_force * inverse + r3 * q3 + r4 * q4,
        (p * r3, p * r4),
        squared_ratio,
    )


@inlined_fused_kernel
def _matrix(
    information: Information,
    columns: _Columns,
    offset: _Offset,
    normal: Vector,
    tangent: tuple[Vector, Vector],
    prior: _PriorTerms,
) -> UpperTriangle:
    """The Gauss-Newton matrix: of the likelihood, minus the offset's, plus that of the priors."""
    F, D, M = information
    c0 = transposed_matvec(D, columns[0])
    c1 = transposed_matvec(D, columns[1])
    c2 = transposed_matvec(D, columns[2])
    p0, p1, p2 = matvec(M, columns[0]), matvec(M, columns[1]), matvec(M, columns[2])
    s, vf, vb, _ = offset
    (nx, ny, nz), ((t1x, t1y, t1z), (t2x, t2y, t2z)) = normal, tangent
    (u4, u5), (k11, k12), (_, k22), pp = prior.u, prior.k1, prior.k2, prior.squared_weight
    (h0, h1, h2), (h4, h5), qx = prior.h, prior.h_along, prior.torsion_slope
    # In the force, a1 a1^T + a2 a2^T = 1 - n n^T.
    e0, e1, e2 = h0 - 0.5 * pp * nx, h1 - 0.5 * pp * ny, h2 - 0.5 * pp * nz
    a, b, c = s * vf[0], s * vf[1], s * vf[2]
    d, e, f = s * vb[0], s * vb[1], s * vb[2]
    return (
        F[0][0] - a * vf[0] + pp + 2.0 * nx * e0,
        F[0][1] - a * vf[1] + nx * e1 + ny * e0,
        F[0][2] - a * vf[2] + nx * e2 + nz * e0,
        c0[0] - a * vb[0] + qx * nx,
        c1[0] - a * vb[1] + nx * h4 + u4 * h0 + pp * (t1x * k11 + t2x * k12),
        c2[0] - a * vb[2] + nx * h5 + u5 * h0 + pp * (t1x * k12 + t2x * k22),
        F[1][1] - b * vf[1] + pp + 2.0 * ny * e1,
        F[1][2] - b * vf[2] + ny * e2 + nz * e1,
        c0[1] - b * vb[0] + qx * ny,
        c1[1] - b * vb[1] + ny * h4 + u4 * h1 + pp * (t1y * k11 + t2y * k12),
        c2[1] - b * vb[2] + ny * h5 + u5 * h1 + pp * (t1y * k12 + t2y * k22),
        F[2][2] - c * vf[2] + pp + 2.0 * nz * e2,
        c0[2] - c * vb[0] + qx * nz,
        c1[2] - c * vb[1] + nz * h4 + u4 * h2 + pp * (t1z * k11 + t2z * k12),
        c2[2] - c * vb[2] + nz * h5 + u5 * h2 + pp * (t1z * k12 + t2z * k22),
        dot(columns[0], p0) - d * vb[0] + prior.torsion_unit * prior.torsion_unit,
        dot(columns[0], p1) - d * vb[1] + qx * u4,
        dot(columns[0], p2) - d * vb[2] + qx * u5,
        dot(columns[1], p1) - e * vb[1] + 2.0 * u4 * h4 + pp * (k11 * k11 + k12 * k12),
        dot(columns[1], p2) - e * vb[2] + u4 * h5 + u5 * h4 + pp * (k11 * k12 + k12 * k22),
        dot(columns[2], p2) - f * vb[2] + 2.0 * u5 * h5 + pp * (k12 * k12 + k22 * k22),
    )


@inlined_fused_kernel
def _gradient(
    force: Vector,
    moment: Vector,
    columns: _Columns,
    offset: _Offset,
    normal: Vector,
    tangent: tuple[Vector, Vector],
    prior: _PriorTerms,
) -> Six:
    """The gradient: of the likelihood, minus the offset's, plus that of the priors.

    `force` and `moment` are A d.
    """
    r, (vf, vb) = offset.gain * offset.product, (offset.force, offset.along)
    t1, t2 = tangent
    along, (a1, a2), (u4, u5) = prior.along_u, prior.along_a, prior.u
    return (
        force[0] - r * vf[0] + along * normal[0] + a1 * t1[0] + a2 * t2[0],
        force[1] - r * vf[1] + along * normal[1] + a1 * t1[1] + a2 * t2[1],
        force[2] - r * vf[2] + along * normal[2] + a1 * t1[2] + a2 * t2[2],
        dot(columns[0], moment) - r * vb[0] + prior.torsion_ratio * prior.torsion_unit,
        dot(columns[1], moment) - r * vb[1] + along * u4 + a1 * prior.k1[0] + a2 * prior.k2[0],
        dot(columns[2], moment) - r * vb[2] + along * u5 + a1 * prior.k1[1] + a2 * prior.k2[1],
    )
