"""Where the surface of a scene is how far from its primitives, for the kernels."""

import math
from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from contactsense.localization.surface.local_prior import LONG_TAILS, DeviationCells, no_cells
from contactsense.localization.surface.mean_surface import CELL_SPREAD
from contactsense.robots.robot import LocalDeviation
from contactsense.robots.rotations import rotation_from_rpy, rotation_from_vector
from contactsense.robots.surface.convex_primitives import Surfaces, project
from contactsense.robots.surface.deviation_table import read_cells
from contactsense.scene import Scene

CELL_RADIUS = math.sqrt(6.0) * CELL_SPREAD
"""Distance of a cell's corners from its centre [m]."""
LEAST_OFFSET = 1e-4
"""Smallest standard deviation of the offset [m]: the real arm differs from its mesh."""


def deviation_cells(scene: Scene, surfaces: Surfaces) -> DeviationCells:
    """Cells of the primitives of arm, tool and pedestals; none if the scene states one error.

    Args:
        scene: The scene.
        surfaces: Of `contactsense.scene_model.scene_surfaces.scene_surfaces`.
    """
    found = [
        _in_body_frame(surfaces, table.first + cell.primitive, cell, table)
        for table in (_tables(scene, surfaces) if scene.surface_error is None else ())
        for cell in table.cells
    ]
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


class _Table(NamedTuple):
    """Cells of one body, and where the surfaces have its primitives."""

    cells: tuple[LocalDeviation, ...]
    first: int
    """Number of its first primitive."""
    rotation: np.ndarray = np.eye(3)
    """Axes of its cells in the frame of the surfaces' link, shape (3, 3)."""
    translation: np.ndarray = np.zeros(3)
    """Origin of its cells in that frame, shape (3,) [m]."""


def _tables(scene: Scene, surfaces: Surfaces) -> Iterator[_Table]:
    """The tables of all bodies whose primitives are among the surfaces."""
    robot, start, coarse = scene.robot, surfaces.start, scene.detail == "coarse"
    pedestals = [body for body in scene.bodies if body.role == "pedestal"]
    first = int(start[1]) - sum(len(body.primitives) for body in pedestals)
    for number, link in enumerate(robot.links):
        end = first if number == 0 else start[number + 1]
        if link.name in scene.touchable_links and start[number] < end:
            level = link.coarse_deviation if coarse and link.coarse else link.deviation
            yield _Table(level, int(start[number]))
    for body in pedestals:
        cells = read_cells(body.deviation, len(body.primitives))
        yield _Table(cells, first, rotation_from_rpy(body.rpy), np.array(body.translation))
        first += len(body.primitives)
    tool = scene.tool
    if tool is not None and tool.name in scene.touchable_links:
        cells = read_cells(tool.deviation, len(tool.primitives))
        yield _Table(cells, int(start[len(robot.links)]), robot.flange_rotation, robot.flange_translation)


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


def _in_body_frame(surfaces: Surfaces, p: int, cell: LocalDeviation, table: _Table) -> _Cell:
    """A cell of primitive p, which its table has in another frame."""
    R = table.rotation.T @ surfaces.rotation[p]
    origin = (surfaces.origin[p] - table.translation) @ table.rotation
    point = (np.array(cell.point) - origin) @ R
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
