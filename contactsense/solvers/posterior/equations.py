"""Energy of the posterior of one contact on one primitive, in numbers instead of arrays.

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
to the covariance, u = (0, n x f). The 6x6 Gauss-Newton matrix at the mode
(`contactsense.solvers.posterior.gauss_newton`) gives the evidence (Laplace approximation) and the covariance
(`contactsense.solvers.posterior.friction_tails`).

The functions are inlined and have no branches: `contactsense.solvers.posterior.energy` calls them
for one contact, `contactsense.solvers.posterior.simd` in loops that are vectorized.
"""

from contactsense.kinematics.logarithm import logarithm
from contactsense.kinematics.spatial import Six
from contactsense.kinematics.wrench_information import (
    Block,
    dot,
    matvec,
    transposed_matvec,
)
from contactsense.robots.jit.kernel import inlined_fused_kernel
from contactsense.solvers.posterior.contact_prior import STUDENT_DOF, Contact

Information = tuple[Block, Block, Block]
"""An information matrix, as `contactsense.kinematics.wrench_information.blocks` splits it."""
Inflation = tuple[Six, float, float]
"""Result of `inflate`."""


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
    return energy + energy_of_force(log_force, squared_ratio, friction_ratio), normal_force, log_force


@inlined_fused_kernel
def energy_of_force(log_force: float, squared_ratio: float, friction_ratio: float) -> float:
    """The energy's terms of log(F / F0) and of the friction ratio's square rho^2."""
    # The sum of (nu + 2) / 2 = 3 and -FORCE_POWER / 2 = -2 logarithms is one logarithm.
    tail = 1.0 + squared_ratio / STUDENT_DOF
    share = tail / (1.0 + squared_ratio * friction_ratio * friction_ratio)
    return float(0.5 * log_force * log_force + logarithm(tail * share * share))
