"""The force with the smallest residual within the friction cone: a small non-negative least-squares problem.

Coulomb's cone is replaced by a pyramid of four edges about it, so that every force in the cone is a sum of
edge forces with weights of at least zero: minimise |A x - b|^2 for x >= 0. Solved on the Gram matrix A^T A by
the active-set method of Lawson & Hanson (1974) in the form of Bro & de Jong (1997): at most a dozen unknowns,
no iteration to a tolerance, about half a microsecond. `scipy.optimize.nnls` is the oracle of its test.
"""

from math import fabs, sqrt

import numpy as np

from contactsense.robots.jit.kernel import kernel

EDGES = 4
"""Edges of the pyramid."""

_DEPENDENT = 1e-10
"""Fraction of a column's square that must remain after projection on the others for it to count as
independent."""


@kernel
def edges(nx: float, ny: float, nz: float, friction: float, out: np.ndarray) -> None:
    """Edge forces of the pyramid about the friction cone, each with unit normal force.

    Args:
        nx, ny, nz: Outward unit normal.
        friction: Coefficient of friction; at an edge a force leans sqrt(2) times further.
        out: Filled, shape (4, 3).
    """
    # A tangent perpendicular to the axis of the normal's smallest component.
    ax, ay, az = fabs(nx), fabs(ny), fabs(nz)
    if ax <= ay and ax <= az:
        tx, ty, tz = 0.0, nz, -ny
    elif ay <= az:
        tx, ty, tz = -nz, 0.0, nx
    else:
        tx, ty, tz = ny, -nx, 0.0
    norm = sqrt(tx * tx + ty * ty + tz * tz)
    tx, ty, tz = tx / norm, ty / norm, tz / norm
    bx, by, bz = ny * tz - nz * ty, nz * tx - nx * tz, nx * ty - ny * tx
    slope = sqrt(2.0) * friction
    for k in range(4):
        sign = 1.0 if k < 2 else -1.0
        if k % 2 == 0:
            out[k, 0], out[k, 1], out[k, 2] = sign * tx, sign * ty, sign * tz
        else:
            out[k, 0], out[k, 1], out[k, 2] = sign * bx, sign * by, sign * bz
        out[k, 0] = slope * out[k, 0] - nx
        out[k, 1] = slope * out[k, 1] - ny
        out[k, 2] = slope * out[k, 2] - nz


@kernel
def columns(rows: np.ndarray, directions: np.ndarray, out: np.ndarray, first: int) -> None:
    """Effect of each edge force on the sensors: columns `first`.. of the problem.

    Args:
        rows: Measurement by force, shape (m, 3).
        directions: Edge forces, shape (4, 3).
        out: Shape (columns, m); rows `first` to `first` + 3 are filled.
        first: First of the four.
    """
    for k in range(4):
        for i in range(rows.shape[0]):
            out[first + k, i] = (
                rows[i, 0] * directions[k, 0] + rows[i, 1] * directions[k, 1] + rows[i, 2] * directions[k, 2]
            )


@kernel
def gram(A: np.ndarray, b: np.ndarray, first: int, last: int, G: np.ndarray, h: np.ndarray) -> None:
    """Fill rows and columns `first` to `last` - 1 of the Gram matrix, with respect to all columns below
    `last`.

    Args:
        A: Columns of the problem as rows, shape (columns, m).
        b: Measurement, shape (m,).
        first, last: Columns that are new.
        G: Gram matrix, shape (columns, columns).
        h: A^T b, shape (columns,).
    """
    m = b.shape[0]
    for i in range(first, last):
        total = 0.0
        for r in range(m):
            total += A[i, r] * b[r]
        h[i] = total
        for k in range(i + 1):
            total = 0.0
            for r in range(m):
                total += A[i, r] * A[k, r]
            G[i, k] = total
            G[k, i] = total


@kernel
def _solve_passive(
    G: np.ndarray, h: np.ndarray, order: np.ndarray, count: int, L: np.ndarray, s: np.ndarray
) -> bool:
    """Least squares on the columns in `order`: fills `s`, or returns False if the last of them depends on the
    others."""
    for i in range(count):
        p = order[i]
        for k in range(i + 1):
            total = G[p, order[k]]
            for r in range(k):
                total -= L[i, r] * L[k, r]
            if k == i:
                if total <= _DEPENDENT * G[p, p]:
                    return False
                L[i, i] = sqrt(total)
            else:
                L[i, k] = total / L[k, k]
    for i in range(count):
        total = h[order[i]]
        for r in range(i):
            total -= L[i, r] * s[r]
        s[i] = total / L[i, i]
    for i in range(count - 1, -1, -1):
        total = s[i]
        for r in range(i + 1, count):
            total -= L[r, i] * s[r]
        s[i] = total / L[i, i]
    return True


@kernel
def solve(
    G: np.ndarray,
    h: np.ndarray,
    square: float,
    count: int,
    x: np.ndarray,
    L: np.ndarray,
    s: np.ndarray,
    order: np.ndarray,
) -> float:
    """Least squares with non-negative weights.

    Args:
        G: Gram matrix; its first `count` rows and columns count.
        h: A^T b.
        square: b^T b.
        count: Number of columns.
        x: Filled: the weights.
        L, s, order: Scratch: shapes (columns, columns), (columns,), (columns,) int64.

    Returns:
        Squared residual |A x - b|^2, at least zero.
    """
    largest = 0.0
    for i in range(count):
        x[i] = 0.0
        largest = max(largest, fabs(h[i]))
    passive = 0
    for _ in range(3 * count):
        chosen = _steepest(G, h, 1e-12 * largest, x, order, passive, count)
        if chosen < 0:
            break
        order[passive] = chosen
        if not _solve_passive(G, h, order, passive + 1, L, s):
            # Depends on the active columns: any gain would be rounding error.
            break
        passive += 1
        while _step_towards(x, s, order, passive):
            passive -= 1
            if passive == 0 or not _solve_passive(G, h, order, passive, L, s):
                break
    cost = square
    for k in range(passive):
        cost -= h[order[k]] * x[order[k]]
    return max(cost, 0.0)


@kernel
def _steepest(
    G: np.ndarray, h: np.ndarray, least: float, x: np.ndarray, order: np.ndarray, passive: int, count: int
) -> int:
    """Column whose weight, now zero, reduces the residual most, -1 if no slope exceeds `least`. The weights
    of the first `passive` columns in `order` are positive."""
    best, chosen = least, -1
    for i in range(count):
        if _contains(order, passive, i):
            continue
        slope = h[i]
        for k in range(passive):
            slope -= G[i, order[k]] * x[order[k]]
        if slope > best:
            best, chosen = slope, i
    return chosen


@kernel
def _contains(order: np.ndarray, count: int, i: int) -> bool:
    """Whether i is one of the first `count` entries of `order`."""
    found = False
    for k in range(count):
        found = found or order[k] == i
    return found


@kernel
def _step_towards(x: np.ndarray, s: np.ndarray, order: np.ndarray, passive: int) -> bool:
    """Move the weights x of the first `passive` columns in `order` towards the solution s, as far as none
    becomes negative. The one that becomes zero, if any, is taken out of `order`: returns whether there is
    one."""
    step, leaving = 1.0, -1
    for k in range(passive):
        if s[k] <= 0.0:
            part = x[order[k]] / (x[order[k]] - s[k]) if x[order[k]] > s[k] else 0.0
            if part < step or leaving < 0:
                step, leaving = part, k
    for k in range(passive):
        x[order[k]] += step * (s[k] - x[order[k]])
    if leaving < 0:
        return False
    x[order[leaving]] = 0.0
    for k in range(leaving, passive - 1):
        order[k] = order[k + 1]
    return True
