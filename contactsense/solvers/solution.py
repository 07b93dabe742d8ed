"""Return value of every solver kernel, and the functions that compute it.

A kernel is `solve_<surface>(wrench, <size of the surface>) -> Answer`; the wrench is given in the frame in
which the surface is described. Kernels are total: they never raise and never return NaN.
"""

from enum import IntEnum
from math import inf, sqrt
from typing import NamedTuple

import numpy as np

from contactsense.robots.jit.kernel import kernel
from contactsense.robots.vectors import Vector, add, cross, dot, rotate, scale, subtract
from contactsense.solvers.wrench import Wrench, invariant, moment_about

OK, PULLING, MISS, TANGENT, PARALLEL, NO_FORCE, NOT_FINITE, NOT_CONVERGED, SHARP = range(9)


class Status(IntEnum):
    """Outcome of a solver. From `TANGENT` on the problem is degenerate, for the reason given by the name."""

    OK = OK
    """The contact centroid: pushing, on the surface, in balance with the wrench."""
    PULLING = PULLING
    """Only a force that pulls at the surface balances the wrench; the answer is the point where it pulls."""
    MISS = MISS
    """No contact balances the wrench; the answer is the surface point nearest to the force's line."""
    TANGENT = TANGENT
    """The force's line touches the surface without entering; the answer is that point."""
    PARALLEL = PARALLEL
    """The force lies along the surface everywhere: in a plane, or along a cylinder's axis."""
    NO_FORCE = NO_FORCE
    """There is no force, so no contact point is defined."""
    NOT_FINITE = NOT_FINITE
    """A component of the wrench is infinite or NaN."""
    NOT_CONVERGED = NOT_CONVERGED
    """The iteration did not converge; the answer is its best point, `residual` its error."""
    SHARP = SHARP
    """The force enters at a sharp edge or corner, where there is no normal and so no torsion."""

    @property
    def degenerate(self) -> bool:
        """Whether the wrench has no well-defined contact."""
        return self >= TANGENT and self != SHARP


class Answer(NamedTuple):
    """What a kernel returns: `contactsense.solvers.solve_wrench.Solution` without the wrench."""

    status: int
    """One of `Status`."""
    centroid: Vector
    """Contact centroid."""
    normal: Vector
    """Outward unit normal there; zero if there is no point."""
    torsion: float
    """Moment about the normal."""
    residual: float
    """Unbalanced moment, relative to moment and lever."""
    condition: float
    """Condition number, see `_grazing`."""


TINY = 1e-300
"""Squares below this are zero."""

FAR = 1e300
"""Distance of what is not there."""

PATCH_TOLERANCE = 1e-9
"""How far outside of its patch, relative to the size of the body, a contact may lie by rounding."""


@kernel
def _grazing(ff: float, fn: float, xi: float, trace: float, det: float) -> float:
    """Condition number: largest shift on the surface per lever of a moment error, |f| times the norm of
    M^-1.

    M = fn J - xi W with the shape operator W, trace and determinant given. The condition number is 1
    for a contact perpendicular to a flat surface, 1 / cos(angle between force and normal) without
    torsion, and it diverges if the force grazes.

    Where xi^2 det W > fn^2, M is regular even at fn = 0. But as f.m changes its sign, which takes a shift of
    the line by |xi fn| / |f|^2, the contact jumps to its twin on the other side of the line. On a sphere with
    that Gaussian curvature the twin is 2 (s / (det W (s + |f|^2)))^(1/2) away, with s = xi^2 det W - fn^2.
    The condition number is the larger of both ratios.
    """
    bend = xi * trace
    spread = xi * xi * (trace * trace - 4.0 * det)
    stretch = 0.5 * (sqrt(4.0 * fn * fn + bend * bend) + sqrt(max(spread, 0.0)))
    torsional = xi * xi * det
    condition = sqrt(ff) * stretch / (fn * fn + torsional)
    beyond = torsional - fn * fn
    if beyond > 0.0:
        jump = 2.0 * sqrt(beyond / (beyond + ff)) / sqrt(det)
        condition = max(condition, jump / abs(xi) * (ff / abs(fn)))
    return condition if condition >= 0.0 else inf


@kernel
def is_contact(t: float, xi: float, fn: float, det: float) -> bool:
    """Whether a balanced wrench pushes, decided by the larger of the two that obey xi fn = t.

    Args:
        t: `invariant` of the wrench.
        xi: Torsion, from the normal's part of the moment.
        fn: f.n.
        det: Determinant of the shape operator.
    """
    if fn * fn > xi * xi * det:
        return fn < 0.0
    return (t > 0.0 and xi < 0.0) or (t < 0.0 and xi > 0.0)


@kernel
def torsion(wrench: Wrench, c: Vector, n: Vector) -> float:
    """Torsion at a contact at c with the normal n.

    f.m / f.n is accurate for small torsion, the normal part of m - c x f if the force grazes.
    """
    f = wrench.force
    push = dot(f, n)
    if push * push > 1e-3 * dot(f, f):
        return invariant(wrench) / push
    return dot(n, moment_about(wrench, c))


@kernel
def no_contact(status: int) -> Answer:
    """Answer without a contact point."""
    return Answer(status, (0.0, 0.0, 0.0), (0.0, 0.0, 0.0), 0.0, inf, inf)


@kernel
def has_point(answer: Answer) -> bool:
    """Whether an answer has a point, be it that of a contact or of a miss."""
    n = answer.normal
    return n[0] != 0.0 or n[1] != 0.0 or n[2] != 0.0


@kernel
def with_status(answer: Answer, status: int) -> Answer:
    """The same answer with another status."""
    return Answer(status, answer.centroid, answer.normal, answer.torsion, answer.residual, answer.condition)


@kernel
def placed(answer: Answer, rotation: np.ndarray, origin: Vector) -> Answer:
    """An answer in a frame with that orientation, shape (3, 3), and origin, outside of it."""
    return Answer(
        answer.status,
        add(origin, rotate(rotation, answer.centroid)),
        rotate(rotation, answer.normal),
        answer.torsion,
        answer.residual,
        answer.condition,
    )


@kernel
def make_answer(
    status: int, wrench: Wrench, c: Vector, n: Vector, xi: float, trace: float, det: float
) -> Answer:
    """Put an answer together: how well it balances the wrench, and how grazing it is.

    Args:
        status: One of `Status`.
        wrench: The wrench.
        c, n, xi: Contact centroid, outward unit normal, torsion.
        trace, det: Of the surface's shape operator there: sum and product of its principal curvatures.

    Returns:
        The answer; `residual` is |m - xi n - c x f| over the root of |m|^2 + |c|^2 |f|^2.
    """
    f, m = wrench
    r = subtract(subtract(m, scale(xi, n)), cross(c, f))
    ff = dot(f, f)
    lever = dot(m, m) + dot(c, c) * ff
    residual = 0.0 if lever <= TINY else sqrt(dot(r, r) / lever)
    condition = inf
    if status <= PULLING:
        condition = _grazing(ff, dot(f, n), xi, trace, det)
    if not residual >= 0.0:
        # Out of the range of floats.
        return no_contact(MISS)
    return Answer(status, c, n, xi, residual, condition)


@kernel
def input_status(wrench: Wrench) -> int:
    """`NOT_FINITE` or `NO_FORCE` if the wrench is invalid, else `OK`."""
    f, m = wrench
    if 0.0 * f[0] + 0.0 * f[1] + 0.0 * f[2] + 0.0 * m[0] + 0.0 * m[1] + 0.0 * m[2] != 0.0:
        return NOT_FINITE
    if f[0] == 0.0 and f[1] == 0.0 and f[2] == 0.0:
        return NO_FORCE
    return OK
