"""Least-squares fit of a union of primitives to samples of a signed distance (Levenberg-Marquardt).

Each residual is governed by one primitive, the nearest, so the normal equations fall apart into one small
block for each primitive, and a step over thousands of samples costs a fraction of a millisecond.
"""

from typing import NamedTuple

import numpy as np

from contactsense.robots.jit.kernel import allocating_kernel, kernel
from contactsense.robots.surface.convex_primitives import bounding_radius, keep_valid, project
from contactsense.robots.surface.union import nearest
from contactsense.robots.vectors import add, cross, divide, dot, rotate_back, subtract, vector
from contactsense.robots.vectors import scale as times

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


class _Bounded(NamedTuple):
    """Bodies with the radii of the balls that hold them."""

    kind: np.ndarray
    rotation: np.ndarray
    origin: np.ndarray
    size: np.ndarray
    radius: np.ndarray


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
def _residual(d: float, value: float, mode: int) -> float:
    e = d - value
    if (mode == AT_LEAST and e > 0.0) or (mode == AT_MOST and e < 0.0):
        return 0.0
    return e


@allocating_kernel
def _bounded(bodies: Bodies) -> _Bounded:
    radius = np.empty(bodies.kind.shape[0])
    for i in range(bodies.kind.shape[0]):
        radius[i] = bounding_radius(bodies.kind[i], bodies.size[i])
    return _Bounded(bodies.kind, bodies.rotation, bodies.origin, bodies.size, radius)


@allocating_kernel
def cost(bodies: Bodies, target: Target, scale: float, reach: float) -> float:
    """Weighted sum of pseudo-Huber losses of scale `scale` [m], saturating at `reach` [m]."""
    total = 0.0
    bounded = _bounded(bodies)
    for i in range(target.points.shape[0]):
        d = nearest(bounded, 0, bounded.kind.shape[0], vector(target.points[i]))[0]
        e = _residual(d, target.value[i], target.mode[i])
        e = min(abs(e), reach)
        total += target.weight[i] * (np.sqrt(1.0 + (e / scale) ** 2) - 1.0)
    return total


@allocating_kernel
def _normal_equations(
    bodies: Bodies, target: Target, scale: float, reach: float, H: np.ndarray, g: np.ndarray
) -> float:
    H[:] = 0.0
    g[:] = 0.0
    row = np.empty(_PARAMETERS)
    changed = np.empty(bodies.size.shape[1])
    total = 0.0
    bounded = _bounded(bodies)
    for i in range(target.points.shape[0]):
        point, weight = vector(target.points[i]), target.weight[i]
        d, k, _, n = nearest(bounded, 0, bounded.kind.shape[0], point)
        e = _residual(d, target.value[i], target.mode[i])
        if e == 0.0:
            continue
        if abs(e) > reach:
            total += weight * (np.sqrt(1.0 + (reach / scale) ** 2) - 1.0)
            continue
        bend = np.sqrt(1.0 + (e / scale) ** 2)
        total += weight * (bend - 1.0)
        w = weight / (bend * scale * scale)
        offset = subtract(point, vector(bodies.origin[k]))
        # Turning the body by a small vector about its origin, then shifting it.
        row[0], row[1], row[2] = cross(n, offset)
        row[3], row[4], row[5] = -n[0], -n[1], -n[2]
        x, y, z = rotate_back(bodies.rotation[k], offset)
        for j in range(4):
            changed[:] = bodies.size[k]
            changed[j] += 1e-7
            row[6 + j] = (project(bodies.kind[k], changed, x, y, z)[0] - d) / 1e-7
        for a in range(_PARAMETERS):
            g[k, a] += w * row[a] * e
            for b in range(a + 1):
                H[k, a, b] += w * row[a] * row[b]
    return total


@allocating_kernel
def _step(bodies: Bodies, H: np.ndarray, g: np.ndarray, damping: float, least: float, new: Bodies) -> None:
    A = np.empty((_PARAMETERS, _PARAMETERS))
    for k in range(bodies.kind.shape[0]):
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
        rotation = bodies.rotation[k]
        new.rotation[k] = rotation
        if turn > 0.0:
            axis = divide(vector(step), turn)
            c, s = np.cos(turn), np.sin(turn)
            for column in range(3):
                v = (rotation[0, column], rotation[1, column], rotation[2, column])
                turned = add(
                    add(times(c, v), times(s, cross(axis, v))), times((1.0 - c) * dot(axis, v), axis)
                )
                new.rotation[k, 0, column], new.rotation[k, 1, column], new.rotation[k, 2, column] = turned
        for a in range(3):
            new.origin[k, a] = bodies.origin[k, a] + step[3 + a]
        new.size[k] = bodies.size[k]
        for a in range(4):
            new.size[k, a] += step[6 + a]
        keep_valid(bodies.kind[k], new.size[k], least)


@allocating_kernel
def fit(bodies: Bodies, target: Target, scale: float, reach: float, least: float, steps: int) -> float:
    """Improve `rotation`, `origin` and `size` of the bodies in place; returns the cost reached.

    Args:
        bodies: The primitives.
        target: What they are fitted to.
        scale: Where the loss turns from square to linear [m].
        reach: Residuals beyond this have no pull [m].
        least: Least radius of the ball of a primitive, and of an ellipsoid [m].
        steps: Number of steps.
    """
    count = bodies.kind.shape[0]
    H = np.empty((count, _PARAMETERS, _PARAMETERS))
    g = np.empty((count, _PARAMETERS))
    new = Bodies(
        bodies.kind, np.empty_like(bodies.rotation), np.empty_like(bodies.origin), np.empty_like(bodies.size)
    )
    damping = 1e-2
    now: float = _normal_equations(bodies, target, scale, reach, H, g)
    for _ in range(steps):
        _step(bodies, H, g, damping, least, new)
        after: float = cost(new, target, scale, reach)
        if after < now:
            gain = (now - after) / now
            bodies.rotation[:] = new.rotation
            bodies.origin[:] = new.origin
            bodies.size[:] = new.size
            damping = max(damping * 0.3, 1e-6)
            if gain < 1e-5:
                return after
            now = _normal_equations(bodies, target, scale, reach, H, g)
        else:
            damping *= 4.0
            if damping > 1e6:
                break
    return now
