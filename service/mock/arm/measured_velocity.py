"""Joint velocities as a controller reports them."""

import numpy as np

MOVES = 1e-3
"""Speed above which the velocity of a joint has noise [rad/s]."""
REST = 1e-6
"""Speed below which a joint rests [rad/s]: its servo goes on to settle for a while, in ever smaller
fractions of what a controller reports."""


def measured_velocity(qd: np.ndarray, deviation: float, chance: np.random.Generator) -> np.ndarray:
    """Velocities with white noise in those of joints that move; a joint at rest reports none.

    Args:
        qd: True velocities, any shape [rad/s].
        deviation: Standard deviation of the noise [rad/s]; 0: the true velocities.
        chance: Source of the noise.
    """
    if deviation == 0.0:
        return qd
    noise = deviation * chance.standard_normal(qd.shape) * (np.abs(qd) > MOVES)
    return np.where(np.abs(qd) < REST, 0.0, qd + noise)
