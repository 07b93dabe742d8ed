"""Gauss-Newton equations of a contact in one surface cell, see
`contactsense.localization.surface_search.laplace_evidence`.

All wrenches are about the cell's centre, in its axes (n, t1, t2). The contact's wrench is

    w = F (-1, alpha, beta, chi + beta v1 - alpha v2, -v2, v1),

with the derivatives w by log F, and F times the following by the other unknowns:

    alpha: (0, 1, 0, -v2, 0, 0),    beta: (0, 0, 1, v1, 0, 0),    chi: (0, 0, 0, 1, 0, 0),
    v1: (0, 0, 0, beta, 0, 1),      v2: (0, 0, 0, -alpha, -1, 0).

With the information matrix A and the residual d = w - measured, the energy is half of

    d . A d + phi^2 + chi^2 / lever^2 + |v|^2 / spread^2 + (dof + 2) log(1 + rho^2 / dof),

the last term being that of Student's t for the friction ratio, rho^2 = (alpha^2 + beta^2) / its variance.
"""

from typing import NamedTuple

from contactsense.kinematics.linalg.ldl import UpperTriangle
from contactsense.kinematics.logarithm import logarithm
from contactsense.kinematics.spatial import Six
from contactsense.robots.jit.kernel import inlined_fused_kernel
from contactsense.solvers.posterior.contact_prior import STUDENT_DOF


class CellContact(NamedTuple):
    """The unknowns of a contact in a cell."""

    log_force: float
    """phi = log(F / median of the prior)."""
    force: float
    """Normal force F [N]."""
    alpha: float
    """Friction ratio along the first tangent."""
    beta: float
    """That along the second."""
    chi: float
    """Torsion ratio xi / F [m]."""
    v1: float
    """Shift from the cell's centre along the first tangent [m]."""
    v2: float
    """That along the second [m]."""


class CellPrior(NamedTuple):
    """Inverse variances of the unknowns; that of the logarithm of the force is 1."""

    ratio: float
    """Of the friction ratio, the squared scale of its Student's t distribution."""
    torsion: float
    """Of the torsion ratio [1/m^2]."""
    shift: float
    """Of the shift [1/m^2]."""


@inlined_fused_kernel
def cell_equations(
    A: UpperTriangle, measured: Six, prior: CellPrior, contact: CellContact
) -> tuple[float, UpperTriangle, Six]:
    """Energy of a contact, its Gauss-Newton matrix and its gradient, for (phi, alpha, beta, chi, v1, v2).

    Args:
        A: Information matrix of the wrench.
        measured: The measured wrench [N, Nm].
        prior: Inverse variances of the prior.
        contact: The contact.
    """
    phi, F, alpha, beta, chi, v1, v2 = contact
    w = (-F, F * alpha, F * beta, F * (chi + beta * v1 - alpha * v2), -F * v2, F * v1)
    d = (
        w[0] - measured[0], w[1] - measured[1], w[2] - measured[2],
        w[3] - measured[3], w[4] - measured[4], w[5] - measured[5],
    )  # fmt: skip
    y = _product(A, d)
    squared_ratio = (alpha * alpha + beta * beta) * prior.ratio
    # The factor that gives a quadratic the gradient of Student's t.
    ratio_weight = (STUDENT_DOF + 2.0) / (STUDENT_DOF + squared_ratio) * prior.ratio
    energy = 0.5 * (
        _dot(d, y)
        + phi * phi
        + chi * chi * prior.torsion
        + (v1 * v1 + v2 * v2) * prior.shift
        + (STUDENT_DOF + 2.0) * logarithm(1.0 + squared_ratio / STUDENT_DOF)
    )
    gradient = (
        _dot(w, y) + phi,
        F * (y[1] - v2 * y[3]) + ratio_weight * alpha,
        F * (y[2] + v1 * y[3]) + ratio_weight * beta,
        F * y[3] + chi * prior.torsion,
        F * (beta * y[3] + y[5]) + v1 * prior.shift,
        -F * (alpha * y[3] + y[4]) + v2 * prior.shift,
    )
    return energy, _matrix(A, w, contact, CellPrior(ratio_weight, prior.torsion, prior.shift)), gradient


@inlined_fused_kernel
def _matrix(A: UpperTriangle, w: Six, contact: CellContact, prior: CellPrior) -> UpperTriangle:
    """The Gauss-Newton matrix. `prior.ratio` is the weight of the quadratic in the friction ratio."""
    _, _, _, _, _, _, a11, a12, a13, a14, a15, a22, a23, a24, a25, a33, a34, a35, a44, a45, a55 = A
    _, F, alpha, beta, _, v1, v2 = contact
    z = _product(A, w)
    FF = F * F
    # The moment rows of A times the derivatives by alpha (b), beta (c), v1 (p) and v2 (q).
    b3, b4, b5 = a13 - v2 * a33, a14 - v2 * a34, a15 - v2 * a35
    c3, c4, c5 = a23 + v1 * a33, a24 + v1 * a34, a25 + v1 * a35
    p3, p4, p5 = beta * a33 + a35, beta * a34 + a45, beta * a35 + a55
    q3, q4 = -alpha * a33 - a34, -alpha * a34 - a44
    return (
        _dot(w, z) + 1.0,
        F * (z[1] - v2 * z[3]),
        F * (z[2] + v1 * z[3]),
        F * z[3],
        F * (beta * z[3] + z[5]),
        -F * (alpha * z[3] + z[4]),
        FF * (a11 - v2 * (a13 + b3)) + prior.ratio,
        FF * (a12 - v2 * a23 + v1 * b3),
        FF * b3,
        FF * (beta * b3 + b5),
        -FF * (alpha * b3 + b4),
        FF * (a22 + v1 * (a23 + c3)) + prior.ratio,
        FF * c3,
        FF * (beta * c3 + c5),
        -FF * (alpha * c3 + c4),
        FF * a33 + prior.torsion,
        FF * p3,
        FF * q3,
        FF * (beta * p3 + p5) + prior.shift,
        -FF * (alpha * p3 + p4),
        -FF * (alpha * q3 + q4) + prior.shift,
    )


@inlined_fused_kernel
def _product(A: UpperTriangle, x: Six) -> Six:
    """A x."""
    (
        a00, a01, a02, a03, a04, a05, a11, a12, a13, a14, a15, a22, a23, a24, a25, a33, a34, a35,
        a44, a45, a55,
    ) = A  # fmt: skip
    x0, x1, x2, x3, x4, x5 = x
    return (
        a00 * x0 + a01 * x1 + a02 * x2 + a03 * x3 + a04 * x4 + a05 * x5,
        a01 * x0 + a11 * x1 + a12 * x2 + a13 * x3 + a14 * x4 + a15 * x5,
        a02 * x0 + a12 * x1 + a22 * x2 + a23 * x3 + a24 * x4 + a25 * x5,
        a03 * x0 + a13 * x1 + a23 * x2 + a33 * x3 + a34 * x4 + a35 * x5,
        a04 * x0 + a14 * x1 + a24 * x2 + a34 * x3 + a44 * x4 + a45 * x5,
        a05 * x0 + a15 * x1 + a25 * x2 + a35 * x3 + a45 * x4 + a55 * x5,
    )


@inlined_fused_kernel
def _dot(a: Six, b: Six) -> float:
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2] + a[3] * b[3] + a[4] * b[4] + a[5] * b[5]
