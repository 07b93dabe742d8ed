"""Where a finger can touch the arm: the exposed part of its visual meshes in a posture.

A point is exposed if the ray along its outward normal is free for 20 mm, at least 40 % of the cosine-weighted
hemisphere above it is free for 40 mm, and it lies neither in a shell nor on the mounting plane. All links are
obstacles, and so is the mounting plane.
"""

import mujoco
import numpy as np

from .arm import Arm, Link
from .simulation import add_mesh, with_shapes
from .surface import tangents

NEAR = 0.02
"""Length of the ray along the normal that must be free [m]."""
AROUND = 0.04
"""Length of the other rays [m]."""
OPEN = 0.4
"""Share of them that must be free."""
LEAVING = 0.1
"""Share of rays of any length that must be free: from the inside of a shell none or few leave."""
_LIFT = 2e-5
"""Rays start this far above their facet, so as not to hit it [m]."""
_RAYS = 64
_ON_PLANE = 1e-3
"""Points that are no higher lie on the mounting plane [m]."""


def _hemisphere() -> np.ndarray:
    """Cosine-weighted directions about +z, above an even spiral on the unit disc, shape (rays, 3)."""
    i = np.arange(_RAYS)
    radius, angle = np.sqrt((i + 0.5) / _RAYS), np.pi * (1.0 + np.sqrt(5.0)) * i
    return np.column_stack((radius * np.cos(angle), radius * np.sin(angle), np.sqrt(1.0 - radius**2)))


class Exposure:
    """Rays against all visual meshes of an arm that stands on its mounting plane."""

    def __init__(self, arm: Arm) -> None:
        self._model = with_shapes(arm, _two_sided)
        self._data = mujoco.MjData(self._model)
        self._directions = _hemisphere()

    def place(self, q: np.ndarray) -> None:
        """Bring the arm into a posture, shape (n,) [rad]."""
        self._data.qpos[:] = q
        mujoco.mj_kinematics(self._model, self._data)

    def exposed(self, link: int, point: np.ndarray, normal: np.ndarray) -> bool:
        """Whether a point of a link can be touched in this posture.

        Args:
            link: 0 to n.
            point, normal: Shape (3,) each, in the link's frame [m].
        """
        origin, rotation = self._data.xpos[link + 1], self._data.xmat[link + 1].reshape(3, 3)
        up = rotation @ normal
        start = origin + rotation @ point + _LIFT * up
        if (
            start[2] <= _ON_PLANE
            or start[2] + NEAR * up[2] <= 0.0
            or self._lengths(start, up[None])[0] <= NEAR
        ):
            return False
        # Axes of the ray pattern that depend on the normal in the link's frame alone: the answer does, too.
        axes = rotation @ np.column_stack((*tangents(normal), normal))
        directions = self._directions @ axes.T
        lengths = self._lengths(start, directions)
        free = (lengths > AROUND) & (start[2] + AROUND * directions[:, 2] > 0.0)
        return bool(free.mean() >= OPEN and np.isinf(lengths).mean() >= LEAVING)

    def _lengths(self, start: np.ndarray, directions: np.ndarray) -> np.ndarray:
        """Length of each ray up to the link that it hits, infinite if none, shape (rays,) [m]."""
        lengths, geom = np.empty(len(directions)), np.empty(len(directions), dtype=np.int32)
        mujoco.mj_multiRay(
            self._model, self._data, start, directions.ravel(), None, True, -1, geom, lengths, None,
            len(directions), mujoco.mjMAXVAL,
        )  # fmt: skip
        lengths[geom < 0] = np.inf
        return lengths


def _two_sided(spec: mujoco.MjSpec, body: mujoco.MjsBody, link: Link) -> None:
    """A link's mesh with every facet twice: MuJoCo's rays pass a facet from behind."""
    if not len(link.faces):
        return
    faces = np.concatenate((link.faces, link.faces[:, ::-1]))
    add_mesh(spec, body, link.name, link.vertices, faces, collides=False)
