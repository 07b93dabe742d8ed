"""Fourier trajectories: sums of harmonics, smooth, periodic, from rest to rest.

J. Swevers et al., "Optimal robot excitation and identification", IEEE Trans. Robotics and Automation 1997.
The amplitudes are constrained such that velocity and acceleration vanish at both ends.
"""

from dataclasses import dataclass
from typing import Self

import numpy as np


@dataclass(frozen=True)
class FourierTrajectory:
    """q_j(t) = center_j + sum_k (sine_jk sin(k w t) - cosine_jk cos(k w t)) / (k w), w = 2 pi / period."""

    center: np.ndarray
    """Mean joint positions [rad], shape (n,)."""
    sine: np.ndarray
    cosine: np.ndarray
    """Amplitudes of velocity [rad/s], shape (n, K)."""
    period: float
    """Length of the motion [s]."""

    @classmethod
    def draw(
        cls, rng: np.random.Generator, center: np.ndarray, speed: np.ndarray, count: int, period: float
    ) -> Self:
        """A random trajectory.

        Args:
            rng: Random number generator.
            center: Mean joint positions [rad], shape (n,).
            speed: Approximate root mean square of each joint's velocity [rad/s], shape (n,).
            count: Number of harmonics, at least 3.
            period: Duration [s].
        """
        size = speed[:, None] / np.sqrt(count)
        sine, cosine = (size * rng.standard_normal((len(center), count)) for _ in range(2))
        order = np.arange(1.0, count + 1.0)
        sine -= sine.mean(axis=1, keepdims=True)  # no velocity at the ends
        cosine -= np.outer(cosine @ order / (order @ order), order)  # no acceleration
        return cls(np.array(center, dtype=float), sine, cosine, period)

    def at(self, t: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Positions [rad], velocities [rad/s] and accelerations [rad/s^2] at times t, shape (N, n) each."""
        w = 2.0 * np.pi / self.period * np.arange(1, self.sine.shape[1] + 1)
        s, c = np.sin(np.outer(t, w)), np.cos(np.outer(t, w))
        q = self.center + (s / w) @ self.sine.T - (c / w) @ self.cosine.T
        return q, c @ self.sine.T + s @ self.cosine.T, -(s * w) @ self.sine.T + (c * w) @ self.cosine.T
