"""Postures in which the arm meets neither itself nor the plane on which it is mounted.

Each link is a row of convex pieces: the hulls of slices of its visual mesh across its longest side. Together
they contain the mesh. The hull of a whole link would also fill the bends of upper arm and forearm, which are
up to 50 mm deep.
"""

from itertools import pairwise

import mujoco
import numpy as np
from scipy.spatial import ConvexHull

from .arm import Arm, Link
from .simulation import add_mesh, with_shapes

_SLICE = 0.05
"""Thickness of a slice [m]."""
_FIXED = 2
"""Base and shoulder cannot come below the mounting plane."""


class Postures:
    """Draws and tests postures of an arm."""

    def __init__(self, arm: Arm) -> None:
        self._arm = arm
        self._model = with_shapes(arm, _convex_pieces)
        self._data = mujoco.MjData(self._model)
        self._vertices = [_extreme(link.vertices) for link in arm.links]

    def draw(self, rng: np.random.Generator) -> np.ndarray:
        """A free posture, uniform within the limits, shape (n,) [rad]."""
        low, high = self._arm.limits
        while True:
            q = np.asarray(rng.uniform(low, high))
            if self.free(q):
                return q

    def free(self, q: np.ndarray) -> bool:
        """Whether no link meets another one, neighbours excepted, or is below the mounting plane."""
        self._data.qpos[:] = q
        mujoco.mj_kinematics(self._model, self._data)
        for link, vertices in enumerate(self._vertices):
            if link < _FIXED or not len(vertices):
                continue
            up = self._data.xmat[link + 1].reshape(3, 3)[2]
            if self._data.xpos[link + 1, 2] + (vertices @ up).min() < 0.0:
                return False
        mujoco.mj_collision(self._model, self._data)
        return bool(self._data.ncon == 0)


def _extreme(vertices: np.ndarray) -> np.ndarray:
    """Those of the vertices that are on their convex hull; none of none."""
    return vertices[ConvexHull(vertices).vertices] if len(vertices) else vertices


def slices(link: Link) -> list[np.ndarray]:
    """Points whose convex hulls together contain the visual mesh, shape (K, 3) each, link frame [m]."""
    if not len(link.vertices):
        return []
    low, high = link.vertices.min(axis=0), link.vertices.max(axis=0)
    axis = int(np.argmax(high - low))
    cuts = np.linspace(low[axis], high[axis], max(2, round((high[axis] - low[axis]) / _SLICE) + 1))
    corners = link.vertices[link.faces]
    start, end = corners.reshape(-1, 3), np.roll(corners, -1, axis=1).reshape(-1, 3)
    parts = []
    for below, above in pairwise(cuts):
        inside = (link.vertices[:, axis] >= below) & (link.vertices[:, axis] <= above)
        # A hull of vertices alone would lose the parts of long facets between the cuts.
        points = [link.vertices[inside], *(_crossings(start, end, axis, cut) for cut in (below, above))]
        parts.append(np.concatenate(points))
    return parts


def _crossings(start: np.ndarray, end: np.ndarray, axis: int, cut: float) -> np.ndarray:
    """Points where edges cross a plane at right angles to an axis, shape (K, 3)."""
    ahead, behind = start[:, axis] - cut, end[:, axis] - cut
    crossing = ahead * behind < 0.0
    share = ahead[crossing] / (ahead[crossing] - behind[crossing])
    return np.asarray(start[crossing] + share[:, None] * (end[crossing] - start[crossing]))


def _convex_pieces(spec: mujoco.MjSpec, body: mujoco.MjsBody, link: Link) -> None:
    for number, points in enumerate(slices(link)):
        add_mesh(spec, body, f"{link.name}_{number}", points, None, collides=True)
