"""Where the surface of a scene is how far from its primitives, for the kernels."""

import numpy as np

from contactsense.localization.local_prior import DeviationCells, no_cells
from contactsense.robots.surface.convex_primitives import Surfaces
from contactsense.scene import Scene

LONG_TAILS = 1.1
"""Factor on the root mean square of a cell. Distances have longer tails than a Gaussian; with this one,
regions of 90 % hold their share of the contacts that it was tuned on (`contactsense bench calibration`: UR5e
of own truth, first half of the given UR10e)."""
LEAST_OFFSET = 1e-4
"""Smallest standard deviation of the offset [m]: the real arm differs from its mesh."""


def deviation_cells(scene: Scene, surfaces: Surfaces) -> DeviationCells:
    """Cells of the arm's primitives, as its surface file has them; none if the scene states one error.

    Tool, bodies of the cell and coarse primitives have no cells. Cells of coarse primitives were tried:
    regions hold 2 to 3 % more of the contacts, but errors grow, and without noise 3 % instead of 2 % of the
    contacts have no answer.
    """
    points, ratios, tilts, owners = [], [], [], []
    measured = scene.surface_error is None and scene.detail != "coarse"
    for number, link in enumerate(scene.robot.links if measured else ()):
        first = int(surfaces.start[number])
        if link.name not in scene.touchable_links or first == surfaces.start[number + 1]:
            continue
        for cell in link.deviation:
            p = first + cell.primitive
            points.append((np.array(cell.point) - surfaces.origin[p]) @ surfaces.rotation[p])
            ratios.append(max(LONG_TAILS * cell.offset, LEAST_OFFSET) / scene.surface_deviation)
            tilts.append(cell.tilt)
            owners.append(p)
    if not points:
        return no_cells(len(surfaces.kind))
    owner, ratio = np.array(owners), np.array(ratios)
    largest = np.zeros(len(surfaces.kind))
    np.maximum.at(largest, owner, ratio)
    largest[largest == 0.0] = 1.0
    order = np.argsort(owner, kind="stable")
    return DeviationCells(
        point=np.array(points)[order],
        ratio=ratio[order],
        tilt=np.array(tilts)[order],
        start=np.searchsorted(owner[order], np.arange(len(surfaces.kind) + 1)).astype(np.int64),
        largest=largest,
    )
