"""Triangle meshes of links for drawing."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True, eq=False)
class Mesh:
    """Triangles of one link, in the link's frame; V vertices, F faces."""

    vertices: np.ndarray
    """Shape (V, 3) [m]."""
    faces: np.ndarray
    """Vertex indices, counterclockwise seen from outside, shape (F, 3), int64."""

    @classmethod
    def empty(cls) -> "Mesh":
        """A mesh without triangles."""
        return cls(np.empty((0, 3)), np.empty((0, 3), dtype=np.int64))

    @classmethod
    def joined(cls, parts: Sequence["Mesh"]) -> "Mesh":
        """Several meshes as one."""
        if not parts:
            return cls.empty()
        offsets = np.cumsum([0, *(len(part.vertices) for part in parts[:-1])])
        return cls(
            np.concatenate([part.vertices for part in parts]),
            np.concatenate([part.faces + offset for part, offset in zip(parts, offsets, strict=True)]),
        )

    def with_faces(self, kept: np.ndarray) -> "Mesh":
        """The mesh with only some of its faces and their vertices.

        Args:
            kept: Whether each face remains, shape (F,), bool.
        """
        faces = self.faces[kept]
        used, index = np.unique(faces, return_inverse=True)
        return Mesh(self.vertices[used], index.reshape(-1, 3).astype(np.int64))
