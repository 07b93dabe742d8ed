"""A wrench in another frame, about another point."""

import numpy as np

from contactsense.robots.rotations import cross_matrix


def wrench_transform(rotation: np.ndarray, translation: np.ndarray) -> np.ndarray:
    """6x6 matrix that transforms a wrench from a sensor's frame to base axes about the base origin.

    Args:
        rotation: Orientation of the sensor's frame in the base frame, shape (3, 3).
        translation: Its origin in the base frame, shape (3,) [m].
    """
    found = np.zeros((6, 6))
    found[:3, :3] = found[3:, 3:] = rotation
    found[3:, :3] = cross_matrix(translation) @ rotation
    return found
