"""Posterior of one contact on one primitive (theory, section 5): energy, gradient and Gauss-Newton
matrix.

The unknowns are the force f (3), the torsion xi and the contact centroid c on the surface (2). With the
fused wrench w_k of the link hypothesis, its information matrix L, and the residual d = (f, c x f + xi n)
- w_k, the energy (negative log posterior) is

    E = 1/2 d^T L' d + 1/2 (xi / (lever F))^2 + (nu + 2)/2 log(1 + rho^2 / nu) + 1/2 log(F / F0)^2

with the normal force F = -f . n and the friction ratio rho = |f_t| / (friction_ratio F).

The second term limits the torsion that a contact patch transmits. The third limits the friction: a force
that is uniform on the friction disc has the standard deviation friction_ratio = mu / 2 along each tangent.
The distribution is Student's t with nu degrees of freedom; its heavy tail allows for ribs, steps and screw
heads that the primitives do not model and where the real normal differs. The last term is a log-normal
prior of the normal force with median F0 and log standard deviation 1. It matters only if the sensors do
not determine the force. L' is L with the uncertainty of the surface: an offset of standard deviation s
along the normal adds s^2 u u^T to the covariance, u = (0, n x f). The 6x6 Gauss-Newton matrix at the mode
gives the covariance and the evidence (Laplace approximation).
"""

import math
from typing import Annotated, NamedTuple

import numpy as np

from contactsense.kinematics.spatial import Six
from contactsense.kinematics.wrench_information import blocks, dot, matvec, shift_information
from contactsense.robots.jit.declaration import Floats
from contactsense.robots.jit.kernel import fused_kernel
from contactsense.robots.vectors import Vector, tangents

STUDENT_DOF = 4.0
"""Degrees of freedom nu of the Student t distribution of the friction ratio."""
MIN_INITIAL_FORCE = 1e-3
"""Initial force of a search if the fused wrench has none [N]."""
Inflation = tuple[Six, float, float]
"""Result of `inflate_by_surface_deviation`."""


class Prior(NamedTuple):
    """Prior of a contact, before any measurement."""

    friction_ratio: float
    """Standard deviation of tangential over normal force along each tangent: half the friction
    coefficient."""
    torsion_lever: float
    """Standard deviation of torsion over normal force [m]."""
    surface_deviation: float
    """Standard deviation of the real surface's offset from the primitive [m]."""
    force: float
    """Median of the normal force [N]; its logarithm has standard deviation 1."""
    clearance: float
    """Free height above the surface that a touching object needs [m]."""
    area: float
    """Area of the touchable surface [m^2]."""
    log_link_density: Annotated[Floats, "links"]
    """Log of the density of places on each link relative to 1 / `area`, that of places uniform by area. It is
    the same on the whole surface of a link."""


class Contact(NamedTuple):
    """A contact on a surface, in the frame of the wrench."""

    point: Vector
    """Contact centroid on the surface [m]."""
    normal: Vector
    """Outward unit normal there."""
    force: Vector
    """Force on the body [N]."""
    torsion: float
    """Moment on the body about the normal [Nm]."""


class SearchBuffers(NamedTuple):
    """Scratch arrays of `find_posterior_mode`, and its matrix results."""

    normal_equations: Annotated[Floats, "6, 6"]
    """Upper triangle: Gauss-Newton matrix of (f, xi, v1, v2)."""
    gradient: Annotated[Floats, "6"]
    """Gradient of the energy, then the step."""
    frame: Annotated[Floats, "3, 3"]
    """Columns: outward normal and two tangents, body axes."""


@fused_kernel
def inflate_by_surface_deviation(L: np.ndarray, prior: Prior, contact: Contact) -> Inflation:
    """Low-rank change of the information by the surface's offset: L' = L - s^2 v v^T / (1 + s^2 u . v), v
    = L u.

    By the Sherman-Morrison formula, with u = (0, n x f) and s the offset's standard deviation.

    Returns:
        v (tuple of 6 floats), s^2 / (1 + s^2 u . v), and the determinant ratio 1 + s^2 u . v.
    """
    _, (nx, ny, nz), (fx, fy, fz), _ = contact
    ux, uy, uz = ny * fz - nz * fy, nz * fx - nx * fz, nx * fy - ny * fx
    v = (
        L[0, 3] * ux + L[0, 4] * uy + L[0, 5] * uz,
        L[1, 3] * ux + L[1, 4] * uy + L[1, 5] * uz,
        L[2, 3] * ux + L[2, 4] * uy + L[2, 5] * uz,
        L[3, 3] * ux + L[3, 4] * uy + L[3, 5] * uz,
        L[4, 3] * ux + L[4, 4] * uy + L[4, 5] * uz,
        L[5, 3] * ux + L[5, 4] * uy + L[5, 5] * uz,
    )
    offset_variance = prior.surface_deviation * prior.surface_deviation
    variance_ratio = 1.0 + offset_variance * (ux * v[3] + uy * v[4] + uz * v[5])
    return v, offset_variance / variance_ratio, variance_ratio


@fused_kernel
def log_prior(prior: Prior, normal_force: float) -> float:
    """Log of the prior density at its peak for a normal force [N], times (2 pi)^3.

    The place is uniform by area here: `Prior.log_link_density` belongs to the link. The factor is that of
    Laplace's integral over force, torsion and place.
    """
    return math.log(
        2.0 * math.pi / (prior.friction_ratio * prior.friction_ratio * prior.torsion_lever * prior.area)
    ) - 4.0 * math.log(normal_force)


@fused_kernel
def energy_at(w: np.ndarray, L: np.ndarray, prior: Prior, inflation: Inflation, contact: Contact) -> float:
    """Energy of a contact; infinite if the force does not push.

    `inflation` is the result of `inflate_by_surface_deviation`. Other arguments as in
    `contactsense.solvers.posterior_mode.find_posterior_mode`.
    """
    (cx, cy, cz), (nx, ny, nz), (fx, fy, fz), xi = contact
    normal_force = -(fx * nx + fy * ny + fz * nz)
    if normal_force <= 0.0:
        return math.inf
    d = (
        fx - w[0],
        fy - w[1],
        fz - w[2],
        cy * fz - cz * fy + xi * nx - w[3],
        cz * fx - cx * fz + xi * ny - w[4],
        cx * fy - cy * fx + xi * nz - w[5],
    )
    v, gain, _ = inflation
    dLd = 0.0
    vd = 0.0
    for i in range(6):
        Ld = (
            L[i, 0] * d[0]
            + L[i, 1] * d[1]
            + L[i, 2] * d[2]
            + L[i, 3] * d[3]
            + L[i, 4] * d[4]
            + L[i, 5] * d[5]
        )
        dLd += d[i] * Ld
        vd += v[i] * d[i]
    torsion_ratio = xi / (prior.torsion_lever * normal_force)
    squared_ratio = (fx * fx + fy * fy + fz * fz - normal_force * normal_force) / (
        prior.friction_ratio * normal_force
    ) ** 2
    log_force = math.log(normal_force / prior.force)
    return 0.5 * (
        dLd
        - gain * vd * vd
        + torsion_ratio * torsion_ratio
        + log_force * log_force
        + (STUDENT_DOF + 2.0) * math.log(1.0 + squared_ratio / STUDENT_DOF)
    )


@fused_kernel
def pushing_force(force: Vector, normal: Vector) -> Vector:
    """The force, with its normal part raised until it pushes: a valid initial value for the search [N]."""
    (fx, fy, fz), (nx, ny, nz) = force, normal
    normal_force = -(fx * nx + fy * ny + fz * nz)
    min_normal_force = 0.1 * max(math.sqrt(fx * fx + fy * fy + fz * fz), MIN_INITIAL_FORCE)
    missing = max(min_normal_force - normal_force, 0.0)
    return fx - missing * nx, fy - missing * ny, fz - missing * nz


@fused_kernel
def linearize(
    w: np.ndarray,
    L: np.ndarray,
    prior: Prior,
    inflation: Inflation,
    W: Six,
    contact: Contact,
    buffers: SearchBuffers,
) -> float:
    """Compute gradient and Gauss-Newton matrix of the energy, written to `buffers`; returns the energy of a
    contact that pushes.

    W: shape operator of the surface at c (upper triangle, six floats) [1/m]. Other arguments as in
    `energy_at`.
    """
    (cx, cy, cz), (nx, ny, nz), (fx, fy, fz), xi = contact
    (t1x, t1y, t1z), (t2x, t2y, t2z) = tangents(contact.normal)
    frame, H, g = buffers.frame, buffers.normal_equations, buffers.gradient
    frame[0, 0], frame[1, 0], frame[2, 0] = nx, ny, nz
    frame[0, 1], frame[1, 1], frame[2, 1] = t1x, t1y, t1z
    frame[0, 2], frame[1, 2], frame[2, 2] = t2x, t2y, t2z
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
    F, D, M = blocks(L)
    F, D, M = shift_information(F, D, M, cx, cy, cz)
    p0, p1, p2 = matvec(M, b0), matvec(M, b1), matvec(M, b2)
    c0, c1, c2 = _transposed_matvec(D, b0), _transposed_matvec(D, b1), _transposed_matvec(D, b2)
    df = (fx - w[0], fy - w[1], fz - w[2])
    dm = (
        xi * nx - w[3] + cy * w[2] - cz * w[1],
        xi * ny - w[4] + cz * w[0] - cx * w[2],
        xi * nz - w[5] + cx * w[1] - cy * w[0],
    )
    af, am = matvec(F, df), matvec(D, df)
    bf, bm = _transposed_matvec(D, dm), matvec(M, dm)
    m = (am[0] + bm[0], am[1] + bm[1], am[2] + bm[2])
    # Inflation by the surface's offset. u is a pure moment, so v = L u becomes X^T v about c.
    v, s, _ = inflation
    vf = (v[0] + v[4] * cz - v[5] * cy, v[1] + v[5] * cx - v[3] * cz, v[2] + v[3] * cy - v[4] * cx)
    vm = (v[3], v[4], v[5])
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
    torsion_unit = inverse / prior.torsion_lever
    r1 = xi * torsion_unit
    r2 = math.log(normal_force / prior.force)
    # Weight of the Student t term: the factor that gives a quadratic the same gradient.
    ratio_unit = inverse / prior.friction_ratio
    squared_ratio = (f1 * f1 + f2 * f2) * ratio_unit * ratio_unit
    p = ratio_unit * math.sqrt((STUDENT_DOF + 2.0) / (STUDENT_DOF + squared_ratio))
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
    H[0, 0] = F[0][0] - a * vf[0] + pp + 2.0 * nx * e0
    H[0, 1] = F[0][1] - a * vf[1] + nx * e1 + ny * e0
    H[0, 2] = F[0][2] - a * vf[2] + nx * e2 + nz * e0
    H[0, 3] = c0[0] - a * vb[0] + qx * nx
    H[0, 4] = c1[0] - a * vb[1] + nx * h4 + u4 * h0 + pp * (t1x * k11 + t2x * k12)
    H[0, 5] = c2[0] - a * vb[2] + nx * h5 + u5 * h0 + pp * (t1x * k12 + t2x * k22)
    H[1, 1] = F[1][1] - b * vf[1] + pp + 2.0 * ny * e1
    H[1, 2] = F[1][2] - b * vf[2] + ny * e2 + nz * e1
    H[1, 3] = c0[1] - b * vb[0] + qx * ny
    H[1, 4] = c1[1] - b * vb[1] + ny * h4 + u4 * h1 + pp * (t1y * k11 + t2y * k12)
    H[1, 5] = c2[1] - b * vb[2] + ny * h5 + u5 * h1 + pp * (t1y * k12 + t2y * k22)
    H[2, 2] = F[2][2] - c * vf[2] + pp + 2.0 * nz * e2
    H[2, 3] = c0[2] - c * vb[0] + qx * nz
    H[2, 4] = c1[2] - c * vb[1] + nz * h4 + u4 * h2 + pp * (t1z * k11 + t2z * k12)
    H[2, 5] = c2[2] - c * vb[2] + nz * h5 + u5 * h2 + pp * (t1z * k12 + t2z * k22)
    a, b, c = s * vb[0], s * vb[1], s * vb[2]
    H[3, 3] = dot(b0, p0) - a * vb[0] + torsion_unit * torsion_unit
    H[3, 4] = dot(b0, p1) - a * vb[1] + qx * u4
    H[3, 5] = dot(b0, p2) - a * vb[2] + qx * u5
    H[4, 4] = dot(b1, p1) - b * vb[1] + 2.0 * u4 * h4 + pp * (k11 * k11 + k12 * k12)
    H[4, 5] = dot(b1, p2) - b * vb[2] + u4 * h5 + u5 * h4 + pp * (k11 * k12 + k12 * k22)
    H[5, 5] = dot(b2, p2) - c * vb[2] + 2.0 * u5 * h5 + pp * (k12 * k12 + k22 * k22)
    r = s * vd
    along_u = r1 * q1 - r2 * inverse + r3 * q3 + r4 * q4
    r3, r4 = p * r3, p * r4
    g[0] = af[0] + bf[0] - r * vf[0] + along_u * nx + r3 * t1x + r4 * t2x
    g[1] = af[1] + bf[1] - r * vf[1] + along_u * ny + r3 * t1y + r4 * t2y
    g[2] = af[2] + bf[2] - r * vf[2] + along_u * nz + r3 * t1z + r4 * t2z
    g[3] = dot(b0, m) - r * vb[0] + r1 * torsion_unit
    g[4] = dot(b1, m) - r * vb[1] + along_u * u4 + r3 * k11 + r4 * k12
    g[5] = dot(b2, m) - r * vb[2] + along_u * u5 + r3 * k12 + r4 * k22
    force = (af[0] + bf[0], af[1] + bf[1], af[2] + bf[2])
    return 0.5 * (
        dot(df, force)
        + dot(dm, m)
        - r * vd
        + r1 * r1
        + r2 * r2
        + (STUDENT_DOF + 2.0) * math.log(1.0 + squared_ratio / STUDENT_DOF)
    )


@fused_kernel
def _transposed_matvec(B: tuple[Vector, Vector, Vector], a: Vector) -> Vector:
    """B^T a, for a 3x3 block B given as a tuple of rows."""
    return (
        B[0][0] * a[0] + B[1][0] * a[1] + B[2][0] * a[2],
        B[0][1] * a[0] + B[1][1] * a[1] + B[2][1] * a[2],
        B[0][2] * a[0] + B[1][2] * a[1] + B[2][2] * a[2],
    )
