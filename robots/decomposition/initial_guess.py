"""Guesses for a further primitive where the union does not yet fit the skin."""

from collections.abc import Iterator

import numpy as np

from contactsense.robots.decomposition.least_squares_fit import Bodies
from contactsense.robots.rotations import frame_along
from contactsense.robots.surface.convex_primitives import BOX, REVOLVED

FEWEST = 20
"""A guess is made from at least as many samples of the skin."""
_TRIES = 1000
"""The guesses end after as many tries without one: the samples are too few, or too far apart. On the skin of
a link, about every second try gives a guess."""


def one(kind: int, rotation: np.ndarray, origin: np.ndarray, size: tuple[float, ...]) -> Bodies:
    """A single body of that kind, with its axes as columns (3, 3), its middle (3,) [m] and its size [m]."""
    full = np.zeros((1, 8))
    full[0, : len(size)] = size
    return Bodies(
        np.array([kind], dtype=np.int64), rotation[None].copy(), np.array(origin)[None].copy(), full
    )


def revolved(points: np.ndarray, normals: np.ndarray, axis: np.ndarray, least: float) -> Bodies | None:
    """A rounded cylinder along a unit vector through oriented points; None if the surface is not curved about
    that axis.

    `points`, `normals`: shapes (N, 3), `axis`: (3,), all in one frame [m]. `least`: smallest radius [m].
    """
    frame = frame_along(axis)
    local, local_normals = points @ frame, normals @ frame
    side = np.abs(local_normals[:, 2]) < 0.5
    if side.sum() < 12:
        return None
    # p = c + rho n in the plane perpendicular to the axis, by least squares in c and rho.
    q, n = local[side, :2], local_normals[side, :2]
    n = n / np.linalg.norm(n, axis=1, keepdims=True)
    rows = np.zeros((2 * len(q), 3))
    rows[0::2, 0], rows[1::2, 1] = 1.0, 1.0
    rows[0::2, 2], rows[1::2, 2] = n[:, 0], n[:, 1]
    (cx, cy, rho), *_ = np.linalg.lstsq(rows, q.reshape(-1), rcond=None)
    if not least < rho < 0.5:
        return None
    low, high = np.percentile(local[:, 2], (1.0, 99.0))
    middle, half = (low + high) / 2.0, (high - low) / 2.0
    ball = float(np.clip(0.25 * rho, least, max(half, least)))
    origin = frame @ np.array([cx, cy, middle])
    return one(
        REVOLVED, frame, origin, (max(half - ball, 0.0), max(rho - ball, 0.0), max(rho - ball, 0.0), ball)
    )


def box(points: np.ndarray, frame: np.ndarray, least: float) -> Bodies:
    """A rounded box around points (N, 3) [m], along the columns of `frame` (3, 3). `least`: smallest radius
    of its edges [m]."""
    local = points @ frame
    low, high = np.percentile(local, (2.0, 98.0), axis=0)
    half = np.maximum((high - low) / 2.0, 2.0 * least)
    ball = float(max(least, 0.3 * half.min()))
    return one(BOX, frame, frame @ ((low + high) / 2.0), (*(half - ball), ball))


def additions(
    points: np.ndarray,
    normals: np.ndarray,
    misfit: np.ndarray,
    axes: np.ndarray,
    least: float,
    boxes: bool,
    rng: np.random.Generator,
) -> Iterator[Bodies]:
    """Guesses for one more body, without end unless the skin has too few samples.

    Args:
        points, normals: Skin, shape (N, 3) each.
        misfit: Misfit at each point, shape (N,), not negative.
        axes: Candidate directions, shape (M, 3): those of joints.
        least: Minimum radius of a ball [m].
        boxes: Whether to guess boxes as well.
        rng: Random number generator.
    """
    probability = misfit / misfit.sum()
    extent = float(np.linalg.norm(points.max(axis=0) - points.min(axis=0)))

    def guess() -> Bodies | None:
        seed = int(rng.choice(len(points), p=probability))
        reach = rng.uniform(0.05, 0.6) * extent
        near = np.linalg.norm(points - points[seed], axis=1) < reach
        if rng.random() < 0.5:  # only points that are not yet fitted
            near &= misfit > np.percentile(misfit, 60.0)
        if near.sum() < FEWEST:
            return None
        p, n = points[near], normals[near]
        choice = rng.integers(6)
        if choice == 0:
            axis = np.linalg.eigh(n.T @ n)[1][:, 0]
        elif choice == 1:
            axis = np.linalg.eigh(np.cov(p.T))[1][:, 2]
        elif choice == 2:
            a, b = rng.choice(len(n), size=2, replace=False)
            axis = np.cross(n[a], n[b])
            if np.linalg.norm(axis) < 0.2:
                return None
        else:
            axis = axes[rng.integers(len(axes))]
        if boxes and rng.random() < 0.25:
            spread = np.linalg.eigh(n.T @ n)[1] if rng.random() < 0.5 else frame_along(axis)
            return box(p, spread * np.sign(np.linalg.det(spread)), least)
        if rng.random() < 0.15:
            ball = rng.uniform(0.2, 0.5) * reach
            return one(
                REVOLVED, frame_along(axis), points[seed] - ball * normals[seed], (0.0, 0.0, 0.0, ball)
            )
        return revolved(p, n, axis, least)

    failed = 0
    while failed < _TRIES:
        body = guess()
        if body is None:
            failed += 1
        else:
            failed = 0
            yield body


def splits(bodies: Bodies, rng: np.random.Generator) -> Iterator[Bodies]:
    """An endless sequence of guesses in which one body is split in two along its longest dimension."""
    while True:
        k = int(rng.integers(len(bodies.kind)))
        first, second = bodies.only(np.array([k])), bodies.only(np.array([k]))
        axis = 2 if bodies.kind[k] == REVOLVED else int(np.argmax(bodies.size[k, :3]))
        slot = 0 if bodies.kind[k] == REVOLVED else axis
        half = bodies.size[k, slot]
        cut = rng.uniform(-0.6, 0.6) * half
        direction = bodies.rotation[k][:, axis]
        for part, low, high in ((first, -half, cut), (second, cut, half)):
            part.origin[0] += direction * (low + high) / 2.0
            part.size[0, slot] = (high - low) / 2.0
        rest = bodies.only(np.arange(len(bodies.kind)) != k)
        yield rest.joined(first).joined(second)
