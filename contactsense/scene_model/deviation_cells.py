"""Where the surface of a scene is how far from its primitives, for the kernels."""

import math
from typing import NamedTuple

import numpy as np

from contactsense.localization.local_prior import LONG_TAILS, DeviationCells, no_cells
from contactsense.localization.mean_surface import CELL_SPREAD
from contactsense.robots.robot import LocalDeviation
from contactsense.robots.rotations import rotation_from_vector
from contactsense.robots.surface.convex_primitives import Surfaces, project
from contactsense.scene import Scene

CELL_RADIUS = math.sqrt(6.0) * CELL_SPREAD
"""Distance of a cell's corners from its centre [m]."""
LEAST_OFFSET = 1e-4
"""Smallest standard deviation of the offset [m]: the real arm differs from its mesh."""


def deviation_cells(scene: Scene, surfaces: Surfaces) -> DeviationCells:
    """Cells of the arm's primitives, as its surface file has them; none if the scene states one error.

    Tool and bodies of the cell have no cells.
    """
    coarse = scene.detail == "coarse"
    found: list[_Cell] = []
    for number, link in enumerate(scene.robot.links if scene.surface_error is None else ()):
        first = int(surfaces.start[number])
        if link.name in scene.touchable_links and first < surfaces.start[number + 1]:
            level = link.coarse_deviation if coarse and link.coarse else link.deviation
            found += [_in_body_frame(surfaces, first + cell.primitive, cell) for cell in level]
    primitives = len(surfaces.kind)
    if not found:
        return no_cells(primitives)
    found.sort(key=lambda cell: cell.primitive)
    owner = np.array([cell.primitive for cell in found])
    ratio = np.array([cell.offset for cell in found]) / scene.surface_deviation
    tilt = np.array([cell.tilt for cell in found])
    displacement = _largest(owner, np.array([cell.displacement for cell in found]), primitives)
    largest = _largest(owner, ratio, primitives)
    largest[largest == 0.0] = 1.0
    return DeviationCells(
        point=np.array([cell.point for cell in found]),
        ratio=ratio,
        tilt=tilt,
        start=np.searchsorted(owner, np.arange(primitives + 1)).astype(np.int64),
        largest=largest,
        rotation=np.array([cell.rotation for cell in found]),
        translation=np.array([cell.translation for cell in found]),
        mean_point=np.array([cell.mean_point for cell in found]),
        mean_normal=np.array([cell.mean_normal for cell in found]),
        displacement=displacement,
        largest_displacement=float(displacement.max()),
    )


class _Cell(NamedTuple):
    """One cell in the body frame of its primitive; fields as in `DeviationCells`."""

    primitive: int
    point: np.ndarray
    offset: float
    """Standard deviation of the surface's offset [m]."""
    tilt: float
    rotation: np.ndarray
    translation: np.ndarray
    mean_point: np.ndarray
    mean_normal: np.ndarray
    displacement: float
    """Largest displacement of points in the cell [m]."""


def _in_body_frame(surfaces: Surfaces, p: int, cell: LocalDeviation) -> _Cell:
    """A cell of primitive p, which the file has in the link's frame."""
    R = surfaces.rotation[p]
    point = (np.array(cell.point) - surfaces.origin[p]) @ R
    shift, rotation = np.array(cell.shift) @ R, rotation_from_vector(np.array(cell.turn) @ R)
    # Turned about the centre of the cell, then shifted.
    translation = point + shift - rotation @ point
    _, *projected = project(surfaces.kind[p], surfaces.size[p], *point)
    mean_point = rotation @ projected[:3] + translation
    # A point turns about the centre.
    turned = 2.0 * math.sin(0.5 * float(np.linalg.norm(cell.turn))) * CELL_RADIUS
    return _Cell(
        primitive=p,
        point=point,
        offset=max(LONG_TAILS * cell.offset, LEAST_OFFSET),
        tilt=LONG_TAILS * cell.tilt,
        rotation=rotation,
        translation=translation,
        mean_point=mean_point,
        mean_normal=rotation @ projected[3:],
        displacement=float(np.linalg.norm(cell.shift)) + turned,
    )


def _largest(owner: np.ndarray, values: np.ndarray, primitives: int) -> np.ndarray:
    """Largest value of each primitive's cells, 0 without any."""
    largest = np.zeros(primitives)
    np.maximum.at(largest, owner, values)
    return largest
