"""Mean shift: from the mean of weighted places to a place near it where they are dense.

Each step moves to the mean of all places, weighted by a normal kernel about the present one. It climbs the
density that the kernel estimates (D. Comaniciu and P. Meer, "Mean shift: a robust approach toward feature
space analysis", 2002).
"""

import math

import numpy as np

from contactsense.kinematics.exponential import exponential
from contactsense.robots.jit.kernel import fused_kernel
from contactsense.robots.vectors import Vector

BANDWIDTH = 0.03
"""Standard deviation of the kernel [m]: about the size of a cell, so that single cells are not places where
the density is highest."""
MAX_STEPS = 8
"""Maximum number of steps."""
CONVERGED = 1e-3
"""Converged if a step is shorter than this [m]."""
LEAST_EXPONENT = -40.0
"""Least exponent of the kernel, as far as it is computed: zero."""


@fused_kernel
def mean_shift(places: np.ndarray, start: Vector) -> Vector:
    """The place that mean shift reaches, in the frame of the places [m].

    Args:
        places: Coordinates x, y, z [m] and weights of N places, shape (4, N).
        start: Where it begins [m].
    """
    x, y, z = start
    factor = -0.5 / (BANDWIDTH * BANDWIDTH)
    for _ in range(MAX_STEPS):
        total, sx, sy, sz = 0.0, 0.0, 0.0, 0.0
        for i in range(places.shape[1]):
            dx, dy, dz = places[0, i] - x, places[1, i] - y, places[2, i] - z
            weight = places[3, i] * exponential(max(factor * (dx * dx + dy * dy + dz * dz), LEAST_EXPONENT))
            total += weight
            sx += weight * dx
            sy += weight * dy
            sz += weight * dz
        if not total > 0.0:
            break
        sx, sy, sz = sx / total, sy / total, sz / total
        x, y, z = x + sx, y + sy, z + sz
        if math.sqrt(sx * sx + sy * sy + sz * sz) < CONVERGED:
            break
    return x, y, z
