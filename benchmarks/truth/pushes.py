"""How a finger pushes: normal force, friction, torsion."""

import numpy as np

from .surface import tangents

NORMAL_FORCES = (5.0, 60.0)
"""Range, log-uniform [N]."""
FRICTION = 0.5
"""Radius of the disc of tangential forces, in parts of the normal force."""
TORSION = 0.005
"""Largest ratio of torsion to normal force [m]."""


def normal_force(rng: np.random.Generator) -> float:
    """Log-uniform [N]."""
    return float(np.exp(rng.uniform(*np.log(NORMAL_FORCES))))


def tangential(rng: np.random.Generator, normal: np.ndarray) -> np.ndarray:
    """Uniform over the disc of friction, in parts of the normal force, shape (3,)."""
    across, up = tangents(normal)
    angle = rng.uniform(0.0, 2.0 * np.pi)
    return np.asarray(FRICTION * np.sqrt(rng.random()) * (np.cos(angle) * across + np.sin(angle) * up))


def torsion_ratio(rng: np.random.Generator) -> float:
    """Torsion about the outward normal in parts of the normal force, uniform [m]."""
    return float(rng.uniform(-TORSION, TORSION))
