"""Covariance of a contact's place where the direction of the force helps to determine it.

On a round surface the normal changes with the place, and the friction ratio with it. The prior of the
friction ratio is Student's t. Laplace's approximation takes its curvature at the mode, where it is highest:
1.5 times that of a normal distribution of the same scale, although its tails are wider. So regions of 90 %
would hold too little wherever the friction ratio determines the place as much as the measurement does. Here
it counts as much as at the edge of the region of 90 %.
"""

from contactsense.kinematics.spatial import Six
from contactsense.kinematics.wrench_information import matvec
from contactsense.robots.jit.kernel import fused_kernel
from contactsense.robots.vectors import Vector, dot
from contactsense.solvers.posterior.contact_prior import STUDENT_DOF, Contact
from contactsense.solvers.posterior.region import REGION_90

Variances = tuple[float, float, float]
"""Covariance along two tangents: v11, v12, v22."""
LEAST_SPREAD = 0.05
"""Without effect if the variance of the friction ratio over the region is below this share of its prior's."""
ITERATIONS = 2
"""The region becomes wider, so that the friction ratio counts less; that often."""


@fused_kernel
def curvature_along(shape_operator: Six, tangents: tuple[Vector, Vector]) -> tuple[float, float, float]:
    """Curvature of a surface along two tangents, k11, k12, k22 [1/m]; `shape_operator`: upper triangle."""
    (xx, xy, xz, yy, yz, zz), (s, t) = shape_operator, tangents
    S = (xx, xy, xz), (xy, yy, yz), (xz, yz, zz)
    u, v = matvec(S, s), matvec(S, t)
    return dot(s, u), dot(t, u), dot(t, v)


@fused_kernel
def with_friction_tails(
    variances: Variances, curvature: tuple[float, float, float], contact: Contact, friction_ratio: float
) -> Variances:
    """Covariance of a contact's place along two tangents, with the tails of the friction ratio's prior [m^2].

    Args:
        variances: Of Laplace's approximation [m^2].
        curvature: Of the surface, along the same tangents [1/m].
        contact: At the mode, in any frame.
        friction_ratio: See `contactsense.solvers.posterior.contact_prior.Prior`.
    """
    v11, v12, v22 = variances
    k11, k12, k22 = curvature
    unit = 1.0 / (friction_ratio * friction_ratio)
    # A step c changes the ratio by k c: its square is c^T m c in units of the prior.
    m11, m12, m22 = unit * (k11 * k11 + k12 * k12), unit * k12 * (k11 + k22), unit * (k12 * k12 + k22 * k22)
    det = v11 * v22 - v12 * v12
    if not (det > 0.0 and m11 * v11 + 2.0 * m12 * v12 + m22 * v22 > 2.0 * LEAST_SPREAD):
        return variances
    push = dot(contact.force, contact.normal)
    squared_ratio = unit * (dot(contact.force, contact.force) / (push * push) - 1.0)
    at_mode = (STUDENT_DOF + 2.0) / (STUDENT_DOF + squared_ratio)
    l11, l12, l22 = v22 / det, -v12 / det, v11 / det
    for _ in range(ITERATIONS):
        spread = 0.5 * (m11 * v11 + 2.0 * m12 * v12 + m22 * v22)
        less = at_mode - (STUDENT_DOF + 2.0) / (STUDENT_DOF + squared_ratio + REGION_90 * spread)
        b11, b12, b22 = l11 - less * m11, l12 - less * m12, l22 - less * m22
        det = b11 * b22 - b12 * b12
        # The force may be too uncertain for the friction ratio to count as much as that.
        if not (det > 0.0 and b11 > 0.0):
            break
        v11, v12, v22 = b22 / det, -b12 / det, b11 / det
    return v11, v12, v22
