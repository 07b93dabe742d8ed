"""Readings under a setup as linear equations, and their products for least squares."""

from collections.abc import Mapping
from typing import NamedTuple

import numpy as np


class Equations(NamedTuple):
    """Readings under a setup as linear functions of P nuisances. C' channels are measured."""

    error: np.ndarray
    """Readings minus prediction without nuisances, shape (M, C)."""
    y: np.ndarray
    """The same of the measured channels, shape (C', M)."""
    A: np.ndarray
    """Derivatives of their prediction by the nuisances, shape (C', M, P)."""
    G: np.ndarray
    """A^T A of each channel, shape (C', P, P)."""
    b: np.ndarray
    """A^T y of each channel, shape (C', P)."""
    biases: Mapping[str, int]
    """First of the six nuisances of each force/torque sensor's bias."""


def bordered(
    S: np.ndarray, y: np.ndarray, A: np.ndarray, G: np.ndarray, b: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """A, G and b of `Equations` with k further columns S before the others, shape (C, M, k)."""
    k, mixed = S.shape[2], S.transpose(0, 2, 1) @ A
    whole = np.empty((len(G), k + G.shape[1], k + G.shape[1]))
    whole[:, :k, :k], whole[:, k:, k:] = S.transpose(0, 2, 1) @ S, G
    whole[:, :k, k:], whole[:, k:, :k] = mixed, mixed.transpose(0, 2, 1)
    return np.concatenate((S, A), axis=2), whole, np.concatenate((products(S, y), b), axis=1)


def products(A: np.ndarray, y: np.ndarray) -> np.ndarray:
    """A^T y of each channel: shapes (C, M, P) and (C, M), to (C, P)."""
    return np.asarray((y[:, None, :] @ A)[:, 0])
