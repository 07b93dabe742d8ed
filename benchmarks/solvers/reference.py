"""The contact that a wrench has in exact arithmetic, and its condition number: Newton's method in mpmath."""

from dataclasses import dataclass
from importlib import import_module
from typing import Any

import numpy as np

from contactsense.benchmarks.solvers.level_sets import DIGITS, Number, Patch, Vector, numbers, vector

_STEPS = 40
EPS = float(np.finfo(float).eps)


@dataclass(frozen=True)
class Reference:
    """An exact contact."""

    centroid: Vector
    """Contact centroid [m]."""
    normal: Vector
    """Outward unit normal there."""
    torsion: Number
    """Moment about it [Nm]."""
    cosine: float
    """Of the angle between force and inward normal."""
    condition: float
    """|f| over the smallest singular value of M (`contactsense.solvers.solution`): the shift of the contact
    for a small shift of the force's line."""
    margin: float
    """Smallest change of the moment, relative to it, that makes f.m zero, where the twin contact begins."""


def dot(a: Vector, b: Vector) -> Number:
    """Inner product."""
    return sum(x * y for x, y in zip(a, b, strict=True))


def cross(a: Vector, b: Vector) -> Vector:
    """Cross product."""
    return [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]


def normal_at(patch: Patch, c: Vector) -> Vector:
    """Outward unit normal of a patch at a point."""
    gradient = patch.level(c)[1]
    size = numbers().sqrt(dot(gradient, gradient))
    return [g / size for g in gradient]


def refine(patch: Patch, force: Any, moment: Any, start: Vector, torsion: Number = 0) -> Reference | None:
    """The contact on a patch that balances a wrench exactly.

    Args:
        patch: The patch.
        force, moment: The wrench, three floats each; they are taken as exact.
        start: A point nearby.
        torsion: About the torsion there.

    Returns:
        The contact; None if the iteration leaves the patch, or ends where the force does not push.
    """
    mp = numbers()
    f, m = vector(force), vector(moment)
    # A moment that outweighs force times distance by so much hides it by as many digits.
    outweighs = dot(m, m) / dot(f, f) / dot(start, start) if dot(start, start) > 0 else mp.mpf(0)
    extra = max(0, int(mp.log10(outweighs))) if outweighs > 0 else 0
    with mp.workdps(DIGITS + extra):
        return _newton(patch, f, m, list(start), torsion)


def _newton(patch: Patch, f: Vector, m: Vector, c: Vector, torsion: Number) -> Reference | None:
    mp = import_module("mpmath")
    _, gradient, _ = patch.level(c)
    k = torsion / mp.sqrt(dot(gradient, gradient))
    force_size, moment_size = mp.sqrt(dot(f, f)), mp.sqrt(dot(m, m))
    last = None
    for _ in range(_STEPS):
        value, g, h = patch.level(c)
        arm = cross(c, f)
        rest = [m[i] - k * g[i] - arm[i] for i in range(3)]
        skew = [[0, -f[2], f[1]], [f[2], 0, -f[0]], [-f[1], f[0], 0]]
        # In units in which all are of order one.
        scale = force_size * mp.sqrt(dot(c, c)) + moment_size
        if scale == 0:
            scale = force_size
        unit = scale / force_size
        size = mp.sqrt(dot(g, g))
        rows = [
            [(skew[i][j] - k * h[i][j]) / force_size for j in range(3)] + [-g[i] / size] for i in range(3)
        ]
        rows.append([x / size for x in g] + [mp.mpf(0)])
        step = mp.lu_solve(mp.matrix(rows), mp.matrix([-x / scale for x in rest] + [-value / size / unit]))
        c = [c[i] + unit * step[i] for i in range(3)]
        k += scale / size * step[3]
        moved = mp.sqrt(sum(step[i] ** 2 for i in range(3)))
        if moved < mp.mpf(10) ** -30 and last is not None:
            break
        last = moved
    else:
        return None
    _, g, h = patch.level(c)
    size = mp.sqrt(dot(g, g))
    n = [x / size for x in g]
    push = dot(f, n)
    if not patch.holds(c, n) or push >= 0:
        return None
    xi = k * size
    tangent = cross(n, [mp.mpf(abs(x) == min(abs(y) for y in n)) for x in n])
    length = mp.sqrt(dot(tangent, tangent))
    t1 = [x / length for x in tangent]
    t2 = cross(n, t1)
    w = [[dot(a, [dot(row, b) for row in h]) / size for b in (t1, t2)] for a in (t1, t2)]
    M = ((-xi * w[0][0], -push - xi * w[0][1]), (push - xi * w[1][0], -xi * w[1][1]))
    det = M[0][0] * M[1][1] - M[0][1] * M[1][0]
    squares = sum(x * x for row in M for x in row)
    # Half the difference of the eigenvalues of M^T M as a sum of squares.
    spread = mp.sqrt(
        ((M[0][0] - M[1][1]) ** 2 + (M[0][1] + M[1][0]) ** 2)
        * ((M[0][0] + M[1][1]) ** 2 + (M[0][1] - M[1][0]) ** 2)
    )
    largest = mp.sqrt((squares + spread) / 2)
    t = dot(f, m)
    return Reference(
        c,
        n,
        xi,
        float(-push / force_size),
        float(force_size * largest / abs(det)),
        float(abs(t) / (force_size * moment_size)) if moment_size > 0 else 0.0,
    )


def error_in_ulps(
    found: np.ndarray, reference: Reference, force: Any, moment: Any, origin: Any = (0, 0, 0)
) -> float:
    """Distance of a solution from the exact contact, relative to its distance from the origin, in ulps times
    the relative condition number.

    Args:
        found: The solution [m], shape (3,).
        reference: The exact contact.
        force, moment: The wrench.
        origin: Of the reference's frame in that of the solution.
    """
    mp = numbers()
    f, m, o = vector(force), vector(moment), vector(origin)
    c = [x + y for x, y in zip(reference.centroid, o, strict=True)]
    difference = [x - y for x, y in zip(vector(found), c, strict=True)]
    distance = mp.sqrt(dot(c, c))
    lever = mp.sqrt(dot(m, m)) / mp.sqrt(dot(f, f))
    condition = 1 + reference.condition * (1 + lever / distance)
    return float(mp.sqrt(dot(difference, difference)) / distance / condition / EPS)
