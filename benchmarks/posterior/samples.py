"""Dense samples of the links' surfaces, from primitives or meshes, each with a small patch."""

from pathlib import Path
from typing import NamedTuple

import numpy as np

from contactsense import Scene
from contactsense.localization.surface.surface_samples import is_on_mounting_face
from contactsense.robots import Robot
from contactsense.robots.decomposition.mesh_sources import read_arm
from contactsense.robots.decomposition.outer_skin import outer_skin
from contactsense.robots.decomposition.surface_error import on_union, surface_points
from contactsense.robots.link_poses import joint_pose
from contactsense.robots.surface.convex_primitives import Surfaces
from contactsense.robots.surface.union import distances
from contactsense.scene_model.constants import build_constants

SPACING = 0.004
"""Approximate edge of a patch [m]."""
DENSITY = 16
"""Approximate number of points per patch of a primitive."""
MESH_DENSITY = 5
"""The same for a mesh, where each point costs two hundred rays."""
ANGLES = 120
"""Number of positions of a joint at which the accessibility next to neighbouring links is tabulated."""
CLEARANCE = 0.005
"""Points with less clearance to a neighbouring link cannot be touched [m]."""


class Samples(NamedTuple):
    """S patches of all links of an arm, link by link."""

    point: np.ndarray
    """Centre of each patch, link frame, shape (S, 3) [m]."""
    normal: np.ndarray
    """Outward unit normal there, shape (S, 3)."""
    area: np.ndarray
    """Area of each patch, shape (S,) [m^2]."""
    spread: np.ndarray
    """Standard deviation of points on the patch about `point`, along each tangent, shape (S,) [m]."""
    covered: np.ndarray
    """Whether the previous (0) or next (1) link covers the patch, by the angle of the joint from -pi to
    pi, shape (S, 2, ANGLES), bool."""
    start: np.ndarray
    """First sample of each link, then the total number, shape (links + 1,), int64."""


def of_primitives(scene: Scene, spacing: float = SPACING, seed: int = 0) -> Samples:
    """Surface of each link's union of primitives, at the scene's level of detail."""
    rng = np.random.default_rng(seed)
    surfaces = build_constants(scene).surfaces
    return _assemble(
        scene.robot,
        surfaces,
        [_union_points(surfaces, link, spacing, rng) for link in range(len(scene.link_names))],
        spacing,
    )


def of_meshes(scene: Scene, folder: Path) -> Samples:
    """Outer skin of each link's mesh, see `contactsense.robots.decomposition.outer_skin`.

    Neighbouring links are represented by their primitives.

    Args:
        scene: Of an arm without tool.
        folder: Meshes, LINK.ply.
    """
    robot, meshes = read_arm(scene.robot.name, folder)
    parts = []
    for link in robot.link_names:
        mesh = meshes[link]
        skin = outer_skin(mesh, count=int(MESH_DENSITY * mesh.area / SPACING**2), seed=0)
        parts.append((skin.points, skin.normals, skin.area / len(skin.points)))
    return _assemble(scene.robot, build_constants(scene).surfaces, parts, SPACING)


def _union_points(
    surfaces: Surfaces, link: int, spacing: float, rng: np.random.Generator
) -> tuple[np.ndarray, np.ndarray, float]:
    """Points uniform by area on the union of a link's primitives, their normals, and the area of each."""
    per_point = spacing**2 / DENSITY
    points = []
    for p in range(surfaces.start[link], surfaces.start[link + 1]):
        area = surface_points(int(surfaces.kind[p]), surfaces.size[p], 1, rng)[1]
        count = int(area / per_point)
        local = surface_points(int(surfaces.kind[p]), surfaces.size[p], count // 2 + 1, rng)[0][:count]
        points.append(local @ surfaces.rotation[p].T + surfaces.origin[p])
    if not points:
        return np.zeros((0, 3)), np.zeros((0, 3)), per_point
    return *on_union(surfaces, np.concatenate(points), link), per_point


def _assemble(
    robot: Robot,
    surfaces: Surfaces,
    parts: list[tuple[np.ndarray, np.ndarray, float]],
    spacing: float,
) -> Samples:
    (points, normals, area), *others = parts
    free = ~is_on_mounting_face(points, normals)
    parts = [(points[free], normals[free], area), *others]
    patches = [_patches(points, normals, area, spacing) for points, normals, area in parts]
    covered = [_is_covered(robot, surfaces, link, patch[0], patch[1]) for link, patch in enumerate(patches)]
    return Samples(
        point=np.concatenate([patch[0] for patch in patches]),
        normal=np.concatenate([patch[1] for patch in patches]),
        area=np.concatenate([patch[2] for patch in patches]),
        spread=np.concatenate([patch[3] for patch in patches]),
        covered=np.concatenate(covered),
        start=np.concatenate(([0], np.cumsum([len(patch[0]) for patch in patches]))).astype(np.int64),
    )


def _patches(
    points: np.ndarray, normals: np.ndarray, area: float, spacing: float
) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Group points that lie in one cube and have similar normals; the point nearest to their mean represents
    them.

    Returns:
        Points, normals, areas and standard deviations of the patches.
    """
    if len(points) == 0:
        return points, normals, np.zeros(0), np.zeros(0)
    axis = np.argmax(np.abs(normals), axis=1)
    facing = 2 * axis + (np.take_along_axis(normals, axis[:, None], axis=1)[:, 0] > 0.0)
    cell = np.column_stack((np.floor(points / spacing).astype(np.int64), facing))
    _, patch, count = np.unique(cell, axis=0, return_inverse=True, return_counts=True)
    patch = patch.ravel()
    mean = np.stack([np.bincount(patch, points[:, i]) for i in range(3)], axis=1) / count[:, None]
    away = np.linalg.norm(points - mean[patch], axis=1)
    order = np.lexsort((away, patch))
    middle = order[np.concatenate(([0], np.cumsum(count)[:-1]))]
    offset = points - points[middle][patch]
    height = (offset * normals[middle][patch]).sum(axis=1)
    across = (offset**2).sum(axis=1) - height**2
    spread = np.sqrt(np.bincount(patch, across) / count / 2.0)
    return points[middle], normals[middle], area * count, spread


def _is_covered(
    robot: Robot, surfaces: Surfaces, link: int, points: np.ndarray, normals: np.ndarray
) -> np.ndarray:
    """See `Samples.covered`; links beyond the last joint have no neighbours."""
    covered = np.zeros((len(points), 2, ANGLES), dtype=bool)
    above = points + CLEARANCE * normals
    reach = np.linalg.norm(surfaces.origin, axis=1) + surfaces.radius
    for k in range(ANGLES):
        angle = (k + 0.5) * 2.0 * np.pi / ANGLES - np.pi
        for side, neighbour in enumerate((link - 1, link + 1)):
            if not 0 <= neighbour < len(robot.links) or link >= len(robot.links):
                continue
            pose = joint_pose(robot.joints[min(link, neighbour)], angle)
            # Seen from the neighbour: the joint moves the distal one of the two.
            seen = pose if side == 0 else np.linalg.inv(pose)
            own = slice(surfaces.start[neighbour], surfaces.start[neighbour + 1])
            if own.start == own.stop:
                continue
            there = above @ seen[:3, :3].T + seen[:3, 3]
            near = np.flatnonzero(np.linalg.norm(there, axis=1) <= reach[own].max())
            covered[near, side, k] = distances(surfaces, there[near], neighbour)[0] < 0.0
    return covered
