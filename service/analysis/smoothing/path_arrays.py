"""Arrays that the search for a path of places shares with its kernels."""

from typing import NamedTuple

import numpy as np

STEPS = 8
"""Steps into which the chord between two knots is divided to follow the surface."""


class WindowSums(NamedTuple):
    """Information of each window about the wrench in the link's frame: sums over its measurements, in units
    of the noise."""

    information: np.ndarray
    """A^T A, shape (W, 6, 6)."""
    value: np.ndarray
    """A^T y, shape (W, 6)."""
    bias: np.ndarray
    """A^T D, shape (W, 6, B)."""


class PathArrays(NamedTuple):
    """A path in the form that the kernels use."""

    places: np.ndarray
    """Knots, shape (K, 3) [m]."""
    offset: np.ndarray
    """Offset h of the real surface at each, shape (K,) [m]."""
    frames: np.ndarray
    """Two tangents of each, shape (K, 2, 3)."""
    knot: np.ndarray
    """Knot before each window, shape (W,), int64."""
    fraction: np.ndarray
    """Fraction of the way to the next one, shape (W,)."""
    chord: np.ndarray
    """The same as a fraction of the chord between them, filled by `eliminate_forces`, shape (W,)."""
    way: np.ndarray
    """Scratch: way along the surface after each step of a chord, shape (STEPS + 1,) [m]."""


class EliminationArrays(NamedTuple):
    """Output of `eliminate_forces` for W windows, B biases, s = 3 K + B unknowns, followed by its scratch
    arrays."""

    point: np.ndarray
    """Places on the surface, shape (W, 3)."""
    normal: np.ndarray
    """Normals, shape (W, 3)."""
    u: np.ndarray
    """Force and torsion, shape (W, 4)."""
    matrix: np.ndarray
    """Gauss-Newton matrix, shape (s, s)."""
    gradient: np.ndarray
    """Gradient, shape (s,)."""
    total: np.ndarray
    """Sum of the windows' matrices of u, lower triangle, shape (4, 4)."""
    G: np.ndarray
    """From u to the wrench, shape (6, 4); the first three rows are those of (1 0)."""
    LG: np.ndarray
    """L G, shape (6, 4)."""
    H: np.ndarray
    """Matrix of u in one window, shape (4, 4)."""
    Y: np.ndarray
    """Coupling of u with the other unknowns of a window, shape (4, 6 + B)."""
    E: np.ndarray
    """Derivative of the moment by the unknowns of the two knots, shape (6, 3)."""
    rhs: np.ndarray
    """A^T times the residuals, shape (6,)."""
    r: np.ndarray
    """Right-hand side of the equations for u, shape (4,)."""
    wrench: np.ndarray
    """G u, shape (6,)."""
    unknown: np.ndarray
    """Index of each unknown of a window, shape (6 + B,), int64."""
