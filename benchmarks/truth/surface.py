"""Points uniform by area on triangle meshes, and the normals of their facets."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from .arm import Link


class Place(NamedTuple):
    """A point on the visual mesh of a link; vectors of shape (3,) in the link's frame."""

    link: int
    """0 to n."""
    facet: int
    """Row of the link's faces."""
    point: np.ndarray
    """[m]"""
    normal: np.ndarray
    """Outward unit normal of the facet."""


class Surface:
    """The visual meshes of an arm."""

    def __init__(self, links: Sequence[Link]) -> None:
        self.faces = [link.faces for link in links]
        """Of each link, shape (F, 3)."""
        self.corners = [link.vertices[link.faces] for link in links]
        """Of each facet of each link, shape (F, 3, 3) [m]."""
        crosses = [np.cross(c[:, 1] - c[:, 0], c[:, 2] - c[:, 0]) for c in self.corners]
        twice = [np.linalg.norm(cross, axis=1) for cross in crosses]
        self.normals = [cross / area[:, None] for cross, area in zip(crosses, twice, strict=True)]
        """Unit normals of each link's facets, shape (F, 3)."""
        self._summed = [np.cumsum(area) for area in twice]

    def draw(self, rng: np.random.Generator, link: int | None = None) -> Place:
        """A random place, uniform by area over all links or over one of them."""
        if link is None:
            ends = np.cumsum([summed[-1] if len(summed) else 0.0 for summed in self._summed])
            link = int(np.searchsorted(ends, rng.random() * ends[-1], side="right"))
        summed = self._summed[link]
        facet = int(np.searchsorted(summed, rng.random() * summed[-1], side="right"))
        u, v = rng.random(2)
        if u + v > 1.0:
            u, v = 1.0 - u, 1.0 - v
        a, b, c = self.corners[link][facet]
        return Place(link, facet, a + u * (b - a) + v * (c - a), self.normals[link][facet])


def tangents(normal: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Two unit vectors, shape (3,) each, that form a right-handed frame with a unit normal as the third."""
    across = np.cross(np.eye(3)[np.argmin(np.abs(normal))], normal)
    across /= np.linalg.norm(across)
    return across, np.cross(normal, across)
