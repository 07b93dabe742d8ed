"""Joint velocities as a controller reports them."""

import numpy as np

MOVES = 1e-3
"""Speed above which a joint moves [rad/s]; one at rest reports no velocity, so no noise either."""


def measured_velocity(qd: np.ndarray, deviation: float, chance: np.random.Generator) -> np.ndarray:
    """Velocities with white noise in those of joints that move.

    Args:
        qd: True velocities, any shape [rad/s].
        deviation: Standard deviation of the noise [rad/s]; 0 draws no random numbers.
        chance: Source of the noise.
    """
    if deviation == 0.0:
        return qd
    return np.asarray(qd + deviation * chance.standard_normal(qd.shape) * (np.abs(qd) > MOVES))
