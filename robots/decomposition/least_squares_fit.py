"""Least-squares fit of a union of primitives to samples of a signed distance (Levenberg-Marquardt).

Each residual is governed by one primitive, the nearest, so the normal equations fall apart into one small
block for each primitive, and a step over thousands of samples costs a fraction of a millisecond.
"""

from typing import NamedTuple

import numpy as np

from contactsense.robots.jit.kernel import allocating_kernel, kernel
from contactsense.robots.surface.convex_primitives import bounding_radius, keep_valid, project
from contactsense.robots.surface.union import nearest

EQUAL, AT_LEAST, AT_MOST = 0, 1, 2
"""What a sample asks of the distance: its value, or only that it be no smaller, or no larger."""

_PARAMETERS = 10  # three of rotation, three of translation, four of size


class Bodies(NamedTuple):
    """Primitives of one link that are being fitted, in the form of
    `contactsense.robots.surface.convex_primitives.Surfaces`."""

    kind: np.ndarray
    rotation: np.ndarray
    origin: np.ndarray
    size: np.ndarray

    def copy(self) -> "Bodies":
        """The same in arrays of its own."""
        return Bodies(*(array.copy() for array in self))

    def joined(self, other: "Bodies") -> "Bodies":
        """All of these and all of `other`."""
        return Bodies(*(np.concatenate(pair) for pair in zip(self, other, strict=True)))

    def only(self, keep: np.ndarray) -> "Bodies":
        """Those that an index or mask selects."""
        return Bodies(*(np.ascontiguousarray(array[keep]) for array in self))


class Target(NamedTuple):
    """Samples of the wanted signed distance."""

    points: np.ndarray
    """Shape (N, 3) [m]."""
    value: np.ndarray
    """Wanted signed distance, shape (N,) [m]."""
    mode: np.ndarray
    """`EQUAL`, `AT_LEAST` or `AT_MOST`, shape (N,), int64."""
    weight: np.ndarray
    """Shape (N,)."""

    def every(self, step: int) -> "Target":
        """Each `step`-th sample: a coarser target."""
        return Target(*(np.ascontiguousarray(array[::step]) for array in self))


@kernel
def _residual(d, value, mode):  # type: ignore[no-untyped-def]
    e = d - value
    if (mode == AT_LEAST and e > 0.0) or (mode == AT_MOST and e < 0.0):
        return 0.0
    return e


@allocating_kernel
def _radii(kind, size):  # type: ignore[no-untyped-def]
    radius = np.empty(kind.shape[0])
    for i in range(kind.shape[0]):
        radius[i] = bounding_radius(kind[i], size[i])
    return radius


@kernel
def cost(kind, rotation, origin, size, points, value, mode, weight, scale, reach):  # type: ignore[no-untyped-def]
    """Weighted sum of pseudo-Huber losses of scale `scale` [m], saturating at `reach` [m]."""
    total = 0.0
    radius = _radii(kind, size)
    for i in range(points.shape[0]):
        d = nearest(
            kind, rotation, origin, size, radius, 0, kind.shape[0], points[i, 0], points[i, 1], points[i, 2]
        )[0]
        e = _residual(d, value[i], mode[i])
        e = min(abs(e), reach)
        total += weight[i] * (np.sqrt(1.0 + (e / scale) ** 2) - 1.0)
    return total


@allocating_kernel
def _normal_equations(kind, rotation, origin, size, points, value, mode, weight, scale, reach, H, g):  # type: ignore[no-untyped-def]
    H[:] = 0.0
    g[:] = 0.0
    row = np.empty(_PARAMETERS)
    changed = np.empty(size.shape[1])
    total = 0.0
    radius = _radii(kind, size)
    for i in range(points.shape[0]):
        x, y, z = points[i, 0], points[i, 1], points[i, 2]
        d, k, _, _, _, nx, ny, nz = nearest(kind, rotation, origin, size, radius, 0, kind.shape[0], x, y, z)
        e = _residual(d, value[i], mode[i])
        if e == 0.0:
            continue
        if abs(e) > reach:
            total += weight[i] * (np.sqrt(1.0 + (reach / scale) ** 2) - 1.0)
            continue
        bend = np.sqrt(1.0 + (e / scale) ** 2)
        total += weight[i] * (bend - 1.0)
        w = weight[i] / (bend * scale * scale)
        dx, dy, dz = x - origin[k, 0], y - origin[k, 1], z - origin[k, 2]
        # Turning the body by a small vector about its origin, then shifting it.
        row[0] = ny * dz - nz * dy
        row[1] = nz * dx - nx * dz
        row[2] = nx * dy - ny * dx
        row[3], row[4], row[5] = -nx, -ny, -nz
        R = rotation[k]
        bx = R[0, 0] * dx + R[1, 0] * dy + R[2, 0] * dz
        by = R[0, 1] * dx + R[1, 1] * dy + R[2, 1] * dz
        bz = R[0, 2] * dx + R[1, 2] * dy + R[2, 2] * dz
        for j in range(4):
            changed[:] = size[k]
            changed[j] += 1e-7
            row[6 + j] = (project(kind[k], changed, bx, by, bz)[0] - d) / 1e-7
        for a in range(_PARAMETERS):
            g[k, a] += w * row[a] * e
            for b in range(a + 1):
                H[k, a, b] += w * row[a] * row[b]
    return total


@allocating_kernel
def _step(kind, rotation, origin, size, H, g, damping, least, new_rotation, new_origin, new_size):  # type: ignore[no-untyped-def]
    A = np.empty((_PARAMETERS, _PARAMETERS))
    for k in range(kind.shape[0]):
        for a in range(_PARAMETERS):
            for b in range(a + 1):
                A[a, b] = H[k, a, b]
                A[b, a] = H[k, a, b]
        for a in range(_PARAMETERS):
            A[a, a] += damping * A[a, a] + 1e-3
        step = np.linalg.solve(A, -g[k])
        turn = np.sqrt(step[0] ** 2 + step[1] ** 2 + step[2] ** 2)
        shift = max(turn / 0.5, np.max(np.abs(step[3:])) / 0.02)
        if shift > 1.0:
            step /= shift
            turn /= shift
        new_rotation[k] = rotation[k]
        if turn > 0.0:
            ax, ay, az = step[0] / turn, step[1] / turn, step[2] / turn
            c, s = np.cos(turn), np.sin(turn)
            for column in range(3):
                vx, vy, vz = rotation[k, 0, column], rotation[k, 1, column], rotation[k, 2, column]
                dot = (ax * vx + ay * vy + az * vz) * (1.0 - c)
                new_rotation[k, 0, column] = vx * c + (ay * vz - az * vy) * s + ax * dot
                new_rotation[k, 1, column] = vy * c + (az * vx - ax * vz) * s + ay * dot
                new_rotation[k, 2, column] = vz * c + (ax * vy - ay * vx) * s + az * dot
        for a in range(3):
            new_origin[k, a] = origin[k, a] + step[3 + a]
        new_size[k] = size[k]
        for a in range(4):
            new_size[k, a] += step[6 + a]
        keep_valid(kind[k], new_size[k], least)


@allocating_kernel
def fit(kind, rotation, origin, size, points, value, mode, weight, scale, reach, least, steps):  # type: ignore[no-untyped-def]
    """Improve `rotation`, `origin` and `size` in place; returns the cost reached.

    Args:
        kind, rotation, origin, size: Arrays of `Bodies`.
        points, value, mode, weight: Arrays of `Target`.
        scale: Where the loss turns from square to linear [m].
        reach: Residuals beyond this have no pull [m].
        least: Least radius of the ball of a primitive, and of an ellipsoid [m].
        steps: Number of steps.
    """
    count = kind.shape[0]
    H = np.empty((count, _PARAMETERS, _PARAMETERS))
    g = np.empty((count, _PARAMETERS))
    new_rotation, new_origin, new_size = np.empty_like(rotation), np.empty_like(origin), np.empty_like(size)
    damping = 1e-2
    now = _normal_equations(kind, rotation, origin, size, points, value, mode, weight, scale, reach, H, g)
    for _ in range(steps):
        _step(kind, rotation, origin, size, H, g, damping, least, new_rotation, new_origin, new_size)
        after = cost(kind, new_rotation, new_origin, new_size, points, value, mode, weight, scale, reach)
        if after < now:
            gain = (now - after) / now
            rotation[:] = new_rotation
            origin[:] = new_origin
            size[:] = new_size
            damping = max(damping * 0.3, 1e-6)
            if gain < 1e-5:
                return after
            now = _normal_equations(
                kind, rotation, origin, size, points, value, mode, weight, scale, reach, H, g
            )
        else:
            damping *= 4.0
            if damping > 1e6:
                break
    return now
