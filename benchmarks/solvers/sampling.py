"""Constructed contacts, the ground truth of the measurements."""

from dataclasses import dataclass

import numpy as np

from contactsense.robots.jit.kernel import kernel
from contactsense.robots.surface.convex_primitives import BOX, REVOLVED, project
from contactsense.solvers import Box, Revolved


@dataclass(frozen=True)
class Contacts:
    """Constructed contacts, one per row."""

    centroid: np.ndarray
    """Contact centroids [m], shape (N, 3)."""
    normal: np.ndarray
    """Outward unit normals, shape (N, 3)."""
    force: np.ndarray
    """Forces [N], shape (N, 3)."""
    moment: np.ndarray
    """Moments [Nm], shape (N, 3)."""
    torsion: np.ndarray
    """Moments about the normals [Nm], shape (N,)."""

    def relative_condition(self, condition: np.ndarray) -> np.ndarray:
        """Relative shift of the centroid for a small relative change of the wrench, shape (N,).

        `condition`: as the solver states it, shape (N,).
        """
        lever = np.linalg.norm(self.moment, axis=1) / np.linalg.norm(self.force, axis=1)
        return np.asarray(1.0 + condition * (1.0 + lever / np.linalg.norm(self.centroid, axis=1)))


def unit(vectors: np.ndarray) -> np.ndarray:
    """Rows normalized to length one."""
    return np.asarray(vectors / np.linalg.norm(vectors, axis=-1, keepdims=True))


def press(
    rng: np.random.Generator,
    centroid: np.ndarray,
    normal: np.ndarray,
    torsion: float,
    friction: float | None = None,
) -> Contacts:
    """Random pushing forces at given points.

    Args:
        rng: Random number generator.
        centroid: Points [m], shape (N, 3).
        normal: Outward normals there, shape (N, 3).
        torsion: Typical moment about the normal, relative to force times the largest distance of a point.
        friction: Largest tangential force over normal force; none: any direction that pushes.
    """
    count = len(centroid)
    force = 10.0 * unit(rng.normal(size=(count, 3))) * rng.lognormal(size=(count, 1))
    push = np.sum(force * normal, axis=1, keepdims=True)
    force *= -np.sign(push)
    if friction is not None:
        across = force + np.abs(push) * normal
        slip = np.linalg.norm(across, axis=1, keepdims=True) / (friction * np.abs(push))
        force = across / np.maximum(slip, 1.0) - np.abs(push) * normal
    size = float(np.abs(centroid).max())
    xi = torsion * size * rng.normal(size=(count, 1)) * np.linalg.norm(force, axis=1, keepdims=True)
    return Contacts(centroid, normal, force, np.cross(centroid, force) + xi * normal, xi[:, 0])


@kernel
def _project(kind: int, size: tuple[float, ...], points: np.ndarray, out: np.ndarray) -> None:
    for i in range(points.shape[0]):
        _, out[i, 0], out[i, 1], out[i, 2], out[i, 3], out[i, 4], out[i, 5] = project(
            kind, size, points[i, 0], points[i, 1], points[i, 2]
        )


def points_on_packed(
    body: Revolved | Box, rng: np.random.Generator, count: int
) -> tuple[np.ndarray, np.ndarray]:
    """Random surface points and normals of a body that `contactsense.robots.surface.convex_primitives` knows,
    shapes (N, 3)."""
    if isinstance(body, Revolved):
        kind, size = REVOLVED, (body.half, body.lower, body.upper, body.rounding)
        extent = np.array((size[1] + size[2] + size[3],) * 2 + (size[0] + size[3],))
    else:
        kind, size = BOX, (body.bx, body.by, body.bz, body.rounding)
        extent = np.array(size[:3]) + size[3]
    out = np.empty((count, 6))
    _project(kind, size, 1.5 * extent * rng.normal(size=(count, 3)), out)
    # Project again from far outside, where the normal is exact.
    _project(kind, size, out[:, :3] + sum(size) * out[:, 3:], out)
    return out[:, :3].copy(), out[:, 3:].copy()
