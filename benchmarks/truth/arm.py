"""An arm from the package index: its chain of links with frames, limits, visual meshes and inertia.

Frames: joint j connects link j-1 to link j and turns about an axis of link j. The base frame is that of the
first link.
"""

from functools import cache
from importlib import import_module
from typing import NamedTuple

import numpy as np

from . import ROBOTS

AXIS = np.array([0.0, 0.0, 1.0])
"""Of a joint that turns about z of its link."""


class Link(NamedTuple):
    """One rigid body; lengths in m, everything but the joint in its own frame."""

    name: str
    origin: np.ndarray
    """Of its joint in the link before, shape (3,); zero for the base."""
    rotation: np.ndarray
    """Of its joint in the link before, shape (3, 3)."""
    axis: np.ndarray
    """Unit vector that its joint turns about, shape (3,); of no meaning for the base."""
    vertices: np.ndarray
    """Of the visual mesh, shape (V, 3)."""
    faces: np.ndarray
    """Rows of three vertices, counterclockwise seen from outside, shape (F, 3)."""
    mass: float
    """[kg]"""
    com: np.ndarray
    """Centre of mass, shape (3,)."""
    tensor: np.ndarray
    """Inertia about the centre of mass, shape (3, 3) [kg m^2]."""


class Arm(NamedTuple):
    """A chain of n + 1 links and the n joints between them."""

    name: str
    links: tuple[Link, ...]
    limits: np.ndarray
    """Lowest and highest positions of the joints, shape (2, n) [rad]."""
    speeds: np.ndarray
    """Limits of the joint speeds, shape (n,) [rad/s]."""
    package: str | None
    """Python package that the meshes come from; None: the user's own file."""

    @property
    def mass(self) -> float:
        """Of all links, with the base [kg]."""
        return float(sum(link.mass for link in self.links))


@cache
def read(name: str) -> Arm:
    """One of `ROBOTS`.

    Raises:
        ValueError: there is no such arm, or a mesh has no facets.
        ImportError: its package is not installed.
    """
    if name not in ROBOTS:
        raise ValueError(f"{name}: no such arm; expected {', '.join(ROBOTS)}")
    # Each arm needs a package of its own.
    arm: Arm = import_module(f".{ROBOTS[name]}", __package__).read(name)
    return arm
