"""Prior of how a contact moves between the knots of its path.

Its velocity between two knots is normally distributed with a standard deviation of `speed` in each tangential
direction. What slides over a link drags it along (Coulomb), as in `contactsense.tracking.sliding`: the
component of the velocity along the tangential force is positive, as the absolute value of a normal variable,
and the one across it is zero, both as far as the normal is known. The first one is taken as a normal variable
of the same mean and variance.
"""

import math
from typing import NamedTuple

import numpy as np

from contactsense.tracking.sliding import NORMAL_ERROR


class IncrementPrior(NamedTuple):
    """Normal distribution of the increments between K knots."""

    mean: np.ndarray
    """Means, link frame, shape (K - 1, 3) [m]."""
    precision: np.ndarray
    """Inverse covariances, shape (K - 1, 3, 3) [1/m^2]."""
    log_scale: float
    """Logarithm of the product of all standard deviations along the surface [m]."""

    def energy(self, knots: np.ndarray) -> float:
        """Half the squared deviations from the prior; `knots`: shape (K, 3) [m]."""
        away = np.diff(knots, axis=0) - self.mean
        return 0.5 * float(np.einsum("ki,kij,kj->", away, self.precision, away))

    def add_derivatives(
        self, knots: np.ndarray, frames: np.ndarray, matrix: np.ndarray, gradient: np.ndarray
    ) -> None:
        """Add those of the energy by the knots' coordinates to `matrix` and `gradient`.

        Args:
            knots: Shape (K, 3) [m].
            frames: Two tangents of each, shape (K, 2, 3).
            matrix: Three rows and columns for each knot come first: tangents and offset.
            gradient: Likewise.
        """
        K = len(knots)
        pull = np.einsum("kij,kj->ki", self.precision, np.diff(knots, axis=0) - self.mean)
        moved = np.zeros((K - 1, 3, 3 * K))
        for k in range(K - 1):
            moved[k, :, 3 * k : 3 * k + 2] = -frames[k].T
            moved[k, :, 3 * k + 3 : 3 * k + 5] = frames[k + 1].T
        matrix[: 3 * K, : 3 * K] += np.einsum("kis,kij,kjr->sr", moved, self.precision, moved)
        gradient[: 3 * K] += np.einsum("kis,ki->s", moved, pull)


def drag_prior(force: np.ndarray, normal: np.ndarray, knot: np.ndarray, sigma: np.ndarray) -> IncrementPrior:
    """The prior, given the forces.

    Args:
        force: Force on the robot in each window, link frame, shape (W, 3) [N].
        normal: Outward normals, shape (W, 3).
        knot: Knot before each window, shape (W,).
        sigma: Standard deviation of each increment in each tangential direction, the direction of the motion
            unknown, shape (K - 1,) [m].
    """
    push = -np.einsum("wi,wi->w", force, normal)
    between = (knot == np.arange(len(sigma))[:, None]).astype(np.float64)
    tangential = between @ (force + push[:, None] * normal)
    square = np.einsum("ki,ki->k", tangential, tangential)
    error = np.maximum((NORMAL_ERROR * (between @ push)) ** 2, 1e-12)
    known, unknown = square / (square + error), error / (square + error)
    # Moments of the absolute value of a normal variable with the variance of both components together.
    share = np.sqrt(known * 4.0 / math.pi)
    along, across = (1.0 + known - share**2) * sigma**2, np.maximum(unknown, 1e-3) * sigma**2
    direction = tangential / np.sqrt(np.maximum(square, 1e-24))[:, None]
    lines = direction[:, :, None] * direction[:, None, :]
    precision = np.eye(3) / across[:, None, None] + (1.0 / along - 1.0 / across)[:, None, None] * lines
    return IncrementPrior(
        (share * sigma)[:, None] * direction, precision, 0.5 * float(np.sum(np.log(along * across)))
    )


def undirected_prior(sigma: np.ndarray) -> IncrementPrior:
    """The prior as long as no force is known; `sigma`: see `drag_prior`."""
    count = len(sigma)
    return IncrementPrior(
        np.zeros((count, 3)), np.eye(3) / sigma[:, None, None] ** 2, 2.0 * float(np.sum(np.log(sigma)))
    )
