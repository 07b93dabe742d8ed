"""Return value of every solver kernel, and the functions that compute it.

A kernel is `solve_<surface>(fx, fy, fz, mx, my, mz, <size of the surface>) -> Answer`: it takes the
wrench on the body, moment about the origin of the frame in which the surface is described, and returns a
flat tuple of numbers. Kernels are total: they never raise and never return NaN.
"""

from enum import IntEnum
from math import frexp, inf, ldexp, sqrt

from contactsense.solvers.typed_kernel import kernel

Answer = tuple[int, float, float, float, float, float, float, float, float, float]
"""status, cx, cy, cz, nx, ny, nz, xi, residual, condition."""

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


SMALL, LARGE = 1e-120, 1e120
"""Squares between these can be squared again without leaving the range of floats."""

TINY = 1e-300

_SPLIT = 134217729.0
"""2^27 + 1 splits a float into two halves whose products are exact."""

_CANCELLED = 1e-3
"""Sum relative to its terms below which its rounding errors are added."""


@kernel
def _grazing(ff: float, fn: float, xi: float, trace: float, det: float) -> float:
    """Condition number: largest shift on the surface per lever of a moment error, |f| times the norm of
    M^-1.

    M = fn J - xi W with the shape operator W, trace and determinant given (theory, section 4). It is 1
    for a contact perpendicular to a flat surface, 1 / cos(angle between force and normal) without
    torsion, and it diverges if the force grazes.

    Where xi^2 det W > fn^2, M is regular even at fn = 0. But as f.m changes its sign, which takes a shift of
    the line by |xi fn| / |f|^2, the contact jumps to its twin on the other side of the line. On a sphere with
    that
    Gaussian curvature the twin is 2 (s / (det W (s + |f|^2)))^(1/2) away, with s = xi^2 det W - fn^2. The
    condition number is the larger of both ratios.
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
def _product_error(x: float, y: float, product: float) -> float:
    """x y - product, exactly (Dekker 1971), unless it leaves the range of floats."""
    a = _SPLIT * x
    a = a - (a - x)
    b = _SPLIT * y
    b = b - (b - y)
    return ((a * b - product) + a * (y - b) + (x - a) * b) + (x - a) * (y - b)


@kernel
def sum_error(x: float, y: float, total: float) -> float:
    """x + y - total, exactly (Knuth 1969)."""
    back = total - x
    return (x - (total - back)) + (y - back)


@kernel
def invariant(fx: float, fy: float, fz: float, mx: float, my: float, mz: float) -> float:
    """f.m = xi (f.n), which is the same about any origin.

    Its sign decides between a contact and its twin, and zero is a pure force. So where the products cancel,
    it is summed as in twice the precision (Ogita, Rump & Oishi 2005).
    """
    x, y, z = fx * mx, fy * my, fz * mz
    half = x + y
    total = half + z
    if abs(total) > _CANCELLED * (abs(x) + abs(y) + abs(z)):
        return total
    error = _product_error(fx, mx, x) + _product_error(fy, my, y) + _product_error(fz, mz, z)
    return total + (error + (sum_error(x, y, half) + sum_error(half, z, total)))


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
def torsion(
    fx: float,
    fy: float,
    fz: float,
    mx: float,
    my: float,
    mz: float,
    cx: float,
    cy: float,
    cz: float,
    nx: float,
    ny: float,
    nz: float,
) -> float:
    """Torsion at a contact.

    f.m / f.n is accurate for small torsion, the normal part of m - c x f if the force grazes.
    """
    push = fx * nx + fy * ny + fz * nz
    if push * push > 1e-3 * (fx * fx + fy * fy + fz * fz):
        return invariant(fx, fy, fz, mx, my, mz) / push
    return nx * (mx - (cy * fz - cz * fy)) + ny * (my - (cz * fx - cx * fz)) + nz * (mz - (cx * fy - cy * fx))


@kernel
def no_contact(status: int) -> Answer:
    """Answer without a contact point."""
    return status, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, inf, inf


@kernel
def make_answer(
    status: int,
    fx: float,
    fy: float,
    fz: float,
    mx: float,
    my: float,
    mz: float,
    cx: float,
    cy: float,
    cz: float,
    nx: float,
    ny: float,
    nz: float,
    xi: float,
    trace: float,
    det: float,
) -> Answer:
    """Put an answer together: how well it balances the wrench, and how grazing it is.

    Args:
        status: One of `Status`.
        fx, fy, fz, mx, my, mz: The wrench.
        cx, cy, cz, nx, ny, nz, xi: Contact centroid, outward unit normal, torsion.
        trace, det: Of the surface's shape operator there: sum and product of its principal curvatures.

    Returns:
        The answer; `residual` is |m - xi n - c x f| over the root of |m|^2 + |c|^2 |f|^2.
    """
    rx = mx - xi * nx - (cy * fz - cz * fy)
    ry = my - xi * ny - (cz * fx - cx * fz)
    rz = mz - xi * nz - (cx * fy - cy * fx)
    ff = fx * fx + fy * fy + fz * fz
    scale = mx * mx + my * my + mz * mz + (cx * cx + cy * cy + cz * cz) * ff
    residual = 0.0 if scale <= TINY else sqrt((rx * rx + ry * ry + rz * rz) / scale)
    condition = inf
    if status <= PULLING:
        condition = _grazing(ff, fx * nx + fy * ny + fz * nz, xi, trace, det)
    if not residual >= 0.0:
        # Out of the range of floats.
        return no_contact(MISS)
    return status, cx, cy, cz, nx, ny, nz, xi, residual, condition


@kernel
def input_status(fx: float, fy: float, fz: float, mx: float, my: float, mz: float) -> int:
    """`NOT_FINITE` or `NO_FORCE` if the wrench is invalid, else `OK`."""
    if 0.0 * fx + 0.0 * fy + 0.0 * fz + 0.0 * mx + 0.0 * my + 0.0 * mz != 0.0:
        return NOT_FINITE
    if fx == 0.0 and fy == 0.0 and fz == 0.0:
        return NO_FORCE
    return OK


_FAINT = 300
"""A force weaker than the moment by more than 2^300 does not move the contact; the kernels take it as this
weak."""


@kernel
def unit_exponents(
    fx: float, fy: float, fz: float, mx: float, my: float, mz: float, length: float
) -> tuple[int, int, int]:
    """Exponents to bring a wrench and a surface of size `length` to order one without rounding.

    Returns:
        Exponents of the unit of force to use for the force, of that for the moment (over length), and of the
        length. The first two differ only where the force is too faint to matter.
    """
    k = frexp(length)[1]
    force = frexp(max(abs(fx), abs(fy), abs(fz)))[1]
    moment = max(abs(mx), abs(my), abs(mz))
    e = max(force, frexp(moment)[1] - k) if moment > 0.0 else force
    return (e if force > e - _FAINT else force + _FAINT), e, k


@kernel
def scaled(
    fx: float, fy: float, fz: float, mx: float, my: float, mz: float, force: int, moment: int, k: int
) -> tuple[float, float, float, float, float, float]:
    """The wrench in the units of `unit_exponents`."""
    lever = moment + k
    return (
        ldexp(fx, -force),
        ldexp(fy, -force),
        ldexp(fz, -force),
        ldexp(mx, -lever),
        ldexp(my, -lever),
        ldexp(mz, -lever),
    )


@kernel
def rescaled(answer: Answer, force: int, moment: int, k: int) -> Answer:
    """Convert an answer from the units of `unit_exponents` to those of the input."""
    status, cx, cy, cz, nx, ny, nz, xi, residual, condition = answer
    return (
        status,
        ldexp(cx, k),
        ldexp(cy, k),
        ldexp(cz, k),
        nx,
        ny,
        nz,
        ldexp(xi, moment + k),
        residual,
        ldexp(condition, force - moment),
    )
