"""Regions of places on a curved surface: how far the surface leaves the tangent plane.

An error of several millimetres along the surface of a link with a radius of a few centimetres is an error
along the normal as well. Its mean square comes from the distances of the surface from the tangent plane, by
Gauss-Hermite quadrature with three nodes along each principal direction of the covariance, which is exact for
constant curvature (Särkkä and Svensson, Bayesian Filtering and Smoothing, 2nd edition, section 6.3).
"""

import numpy as np

from contactsense.robots.surface.convex_primitives import Surfaces
from contactsense.robots.surface.signed_distance_grid import Grids, sample
from contactsense.robots.surface.union import distances
from contactsense.robots.vectors import vector

_ROOTS, _SHARES = np.array([-1.0, 0.0, 1.0]) * np.sqrt(3.0), np.array([1.0, 4.0, 1.0]) / 6.0
_NODES = np.array([(a, b) for a in _ROOTS for b in _ROOTS])
_WEIGHTS = np.array([a * b for a in _SHARES for b in _SHARES])


def curvature_covariance(
    surfaces: Surfaces,
    skin: Grids,
    link: int,
    point: np.ndarray,
    normal: np.ndarray,
    covariance: np.ndarray,
) -> np.ndarray:
    """What the curvature of the surface adds to the covariance of places.

    Args:
        surfaces: Primitives of all links.
        skin: Grids of the links' skin; used instead of the primitives where there are any.
        link: The link.
        point: Places, link frame, shape (W, 3) [m].
        normal: Outward unit normals of the primitives there, shape (W, 3).
        covariance: Their covariance, shape (W, 3, 3) [m^2].

    Returns:
        Covariance along each normal, shape (W, 3, 3) [m^2].
    """
    tangential = np.eye(3) - normal[:, :, None] * normal[:, None, :]
    # Ascending eigenvalues; the first belongs to the normal.
    values, vectors = np.linalg.eigh(tangential @ covariance @ tangential)
    deviation = np.sqrt(np.maximum(values[:, 1:], 0.0))
    around = point[:, None] + (_NODES * deviation[:, None]) @ np.swapaxes(vectors[:, :, 1:], 1, 2)
    nodes = around.reshape(-1, 3)
    distance, _, outward = distances(surfaces, nodes, link)
    if link < len(skin.shape):
        for i, node in enumerate(nodes):
            d, gradient = sample(skin, link, vector(node))
            if np.isfinite(d):
                distance[i], outward[i] = d, gradient
    along = np.einsum("wki,wi->wk", outward.reshape(around.shape), normal)
    height = distance.reshape(along.shape) * along
    middle = len(_WEIGHTS) // 2
    square = (height - height[:, middle : middle + 1]) ** 2 @ _WEIGHTS
    return np.asarray(square[:, None, None] * normal[:, :, None] * normal[:, None, :])
