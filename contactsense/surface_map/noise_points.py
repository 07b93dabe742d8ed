"""Residuals of a push at fixed points of the noise's distribution: a quasi-Monte Carlo rule with few points.

A median over such points is far more accurate than one over as many random draws if the first two dimensions
of the sequence, which it fills most evenly, are those that move the answer: the two directions of the noise
that change the place to first order (R. E. Caflisch, W. Morokoff, A. Owen, "Valuation of mortgage-backed
securities using Brownian bridges to reduce effective dimension", 1997).
"""

from functools import cache

import numpy as np
from scipy.special import ndtri
from scipy.stats import qmc

POINTS = 64
"""Number of points per place; a power of two, as Sobol points need."""


def noisy_residuals(push: np.ndarray, gain: np.ndarray, inclination: float) -> np.ndarray:
    """Residuals of one push with noise, in units of the noise.

    Args:
        push: `contactsense.surface_map.place_gain.push_jacobian` at the place, shape (rows, 4); its first
            column is the mean residual of a push along the inward normal.
        gain: `contactsense.surface_map.place_gain.place_gain` at the place, shape (2, rows).
        inclination: Largest ratio of tangential to normal force, in units of its prior, uniform on the disc;
            with it comes torsion as in its prior. 0: along the inward normal.

    Returns:
        Shape (POINTS, rows).
    """
    noise, disc, torsion, others = _points(len(push))
    axes, triangle = np.linalg.qr(np.concatenate((gain.T, others), axis=1)[:, : len(push)])
    # With these signs the axes are unique, and a rounding error of the gain cannot turn them.
    axes = axes * np.where(np.diag(triangle) < 0.0, -1.0, 1.0)
    found = push[:, 0] + noise @ axes.T
    if inclination > 0.0:
        found = found + inclination * disc @ push[:, 1:3].T + np.outer(torsion, push[:, 3])
    return np.asarray(found)


@cache
def _points(rows: int) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Standard normal noise, shape (POINTS, rows); points of the unit disc, shape (POINTS, 2); a standard
    normal variable, shape (POINTS,); directions that complete two to a basis, shape (rows, rows)."""
    dimensions = max(rows, 2) + 3
    # The shift keeps the points evenly spread, and none of them is at the border of the cube.
    rng = np.random.default_rng(0)
    shift, others = rng.random(dimensions), rng.standard_normal((rows, rows))
    uniform = (qmc.Sobol(dimensions, scramble=False).random(POINTS) + shift) % 1.0
    normal = ndtri(uniform)
    # In polar coordinates each dimension is one of the plane: its radius is as even as the sequence.
    normal[:, :2] = _on_disc(np.sqrt(-2.0 * np.log1p(-uniform[:, 0])), uniform[:, 1])
    noise = normal[:, :rows] - normal[:, :rows].mean(axis=0)
    # Exact mean and covariance; a triangular factor leaves the first two dimensions among themselves.
    noise = np.linalg.solve(np.linalg.cholesky(noise.T @ noise / POINTS), noise.T).T
    disc = _on_disc(np.sqrt(uniform[:, -3]), uniform[:, -2])
    return noise, disc, normal[:, -1], others


def _on_disc(radius: np.ndarray, turn: np.ndarray) -> np.ndarray:
    angle = 2.0 * np.pi * turn
    return np.stack((radius * np.cos(angle), radius * np.sin(angle)), axis=1)
