"""Shapes that show a contact: an arrow for its force, and the region of places on the link's surface.

The covariance of a place is that of steps along the surface. A region is the part of the link's mesh that
such steps reach: the mesh is refined around the contact, and cut off where the Gaussian's 90 % ellipse ends.
"""

import numpy as np

from contactsense.robots.surface.union import distances
from contactsense.scene import Scene
from contactsense.service.drawing.link_geometry import geometry_of
from contactsense.service.drawing.mesh import Mesh
from contactsense.service.drawing.triangles import cut_off, merged, refined
from contactsense.solvers.posterior.region import REGION_90

ARROW_SCALE = 0.008
"""Length of an arrow per force [m/N]."""
ARROW_LENGTHS = (0.08, 0.45)
"""Shortest and longest arrow [m]."""
ARROW_MEANING = (
    f"{1e3 * ARROW_SCALE:g} mm long for each newton, "
    f"{1e3 * ARROW_LENGTHS[0]:g} to {1e3 * ARROW_LENGTHS[1]:g} mm"
)
"""What the length of an arrow means, for legends."""
LIFT = 0.0006
"""Height of a region above the surface [m], so that the surface does not shine through."""
_SMALLEST = 0.001
"""Smallest semi-axis of a region [m]: a smaller one cannot be seen."""
_EDGES = (0.0006, 0.004)
"""Shortest and longest edge of a region's triangles [m], but for regions larger than any link's width."""
_TURNED = -0.5
"""Cosine between normals beyond which a place is on the far side of the link."""


def arrow_ends(point: np.ndarray, force: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Tail and head of the arrow of a force, which ends at the contact.

    Its length is `ARROW_SCALE` times the force, within `ARROW_LENGTHS`.

    Args:
        point: Contact point, shape (3,) [m].
        force: Force on the robot, same axes, shape (3,) [N].

    Returns:
        Tail and head, shape (3,) each [m]; both are the point where the force is zero or not finite.
    """
    head = np.array(point, dtype=np.float64)
    size = float(np.linalg.norm(force))
    if not (np.isfinite(size) and size > 0.0):
        return head.copy(), head
    length = float(np.clip(ARROW_SCALE * size, *ARROW_LENGTHS))
    return head - length * np.asarray(force) / size, head


def region_patch(
    scene: Scene, link: int, point: np.ndarray, normal: np.ndarray, covariance: np.ndarray
) -> Mesh:
    """The region of a link's surface that holds a contact with a probability of 90 %, as a thin mesh.

    It never leaves the link, and does not include the link's far side unless it is as large as the link. A
    semi-axis below 1 mm is drawn as 1 mm.

    Args:
        scene: The scene.
        link: Index of the link in `scene.link_names`.
        point: Contact point, link frame, shape (3,) [m].
        normal: Outward unit normal there, link frame, shape (3,).
        covariance: Covariance of the point, link frame, shape (3, 3) [m^2].

    Returns:
        The mesh in the link's frame, `LIFT` above the surface; empty where an argument is not finite or the
        link has no surface.
    """
    whole = geometry_of(scene)
    triangles = whole.triangles[link]
    numbers = np.concatenate((point, normal, np.ravel(covariance)))
    if not np.isfinite(numbers).all() or len(triangles) == 0:
        return Mesh.empty()
    extent = float(np.linalg.norm(np.ptp(triangles.reshape(-1, 3), axis=0)))
    lengths, axes = _ellipse(np.asarray(normal), np.asarray(covariance), 2.0 * extent)
    reach, narrow = float(lengths.max()), float(lengths.min())
    edge = max(float(np.clip(narrow / 4.0, *_EDGES)), min(reach, extent) / 40.0)

    def radius(places: np.ndarray) -> np.ndarray:
        """Distance from the contact in units of the ellipse, for places (..., 3)."""
        return np.asarray(np.linalg.norm(_steps(places - point, normal) @ axes.T / lengths, axis=-1))

    def place(triangles: np.ndarray) -> np.ndarray:
        middle = triangles.mean(axis=1)
        size = np.linalg.norm(triangles - middle[:, None], axis=2).max(axis=1)
        # A step along the surface is at most pi / 2 times as long as the straight line.
        within, margin = radius(middle), 0.5 * np.pi * size / narrow
        return np.asarray((within + margin < 1.0).astype(np.int64) - (within - margin > 1.0))

    if reach < extent:
        triangles = triangles[_facing(triangles) @ normal > _TURNED]
    triangles = refined(triangles, edge, place)
    patch = merged(cut_off(triangles, 1.0 - radius(triangles)))
    distance, _, outward = distances(whole.surfaces, patch.vertices, link)
    return Mesh(patch.vertices + (LIFT - distance[:, None]) * outward, patch.faces)


def _facing(triangles: np.ndarray) -> np.ndarray:
    """Unit normals of triangles (T, 3, 3), shape (T, 3)."""
    across = np.cross(triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0])
    return np.asarray(across / np.linalg.norm(across, axis=1, keepdims=True))


def _ellipse(normal: np.ndarray, covariance: np.ndarray, longest: float) -> tuple[np.ndarray, np.ndarray]:
    """Semi-axes (2,) [m] of the 90 % ellipse in the tangent plane, and their directions, as rows (2, 3)."""
    first = np.cross(normal, np.eye(3)[int(np.argmin(np.abs(normal)))])
    first /= np.linalg.norm(first)
    tangents = np.stack((first, np.cross(normal, first)))
    # Clipped, so that the eigenvalues of a huge covariance are finite; the link limits the region anyway.
    flat = tangents @ np.clip(covariance, -1e6, 1e6) @ tangents.T
    values, vectors = np.linalg.eigh((flat + flat.T) / 2.0)
    lengths = np.clip(np.sqrt(REGION_90 * np.maximum(values, 0.0)), _SMALLEST, longest)
    return lengths, vectors.T @ tangents


def _steps(offset: np.ndarray, normal: np.ndarray) -> np.ndarray:
    """Steps along the surface that lead to offsets (..., 3) from a place with that normal [m].

    A step is as long as the arc of a circle that touches the surface in the place; on planes and spheres, and
    around cylinders, that is exact.
    """
    height = offset @ normal
    flat = offset - height[..., None] * normal
    across = np.linalg.norm(flat, axis=-1)
    half = np.arctan2(np.abs(height), across)
    chord = np.hypot(height, across)
    arc = chord / np.maximum(np.sinc(half / np.pi), 1e-9)
    # Straight behind the place, every direction is as good as any other.
    aside = np.cross(normal, np.eye(3)[int(np.argmin(np.abs(normal)))])
    flat = np.where((across > 1e-9)[..., None], flat, 1e-9 * aside / np.linalg.norm(aside))
    return np.asarray(flat * (arc / np.maximum(across, 1e-9))[..., None])
