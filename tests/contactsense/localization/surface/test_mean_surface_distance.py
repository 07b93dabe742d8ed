"""Distance from the mean surface: zero on it, and covers are where the skin is on average."""

import numpy as np
import pytest

from contactsense import Scene
from contactsense.localization.candidates.accessibility import OWN_CLEARANCE, clearance
from contactsense.localization.surface.local_prior import nearest_cell
from contactsense.localization.surface.mean_surface_distance import mean_surface_distance
from contactsense.robots.surface.convex_primitives import project
from contactsense.scene_model.constants import Constants, build_constants
from contactsense.scene_model.deviation_cells import CELL_RADIUS
from tests.contactsense.localization.placed_arm import placed

HEIGHTS = (0.0, 0.003, 0.006)
"""Of points above the mean surface [m]."""


@pytest.fixture(scope="module")
def coarse() -> Constants:
    return build_constants(Scene(robot="ur5e", detail="coarse"))


def test_above_the_centre_of_a_cell_it_is_the_height(coarse: Constants) -> None:
    surfaces, cells = coarse.surfaces, coarse.deviations
    same = 0
    for p in range(len(surfaces.kind)):
        for i in range(cells.start[p], cells.start[p + 1]):
            for height in HEIGHTS:
                point = cells.mean_point[i] + height * cells.mean_normal[i]
                _, *below = project(surfaces.kind[p], surfaces.size[p], *point)
                # Where the surface leans, a point above one cell may be nearest to another.
                if nearest_cell(cells, p, *below[:3]) != i:
                    continue
                same += 1
                distance = mean_surface_distance(surfaces, cells, p, tuple(point))
                assert distance == pytest.approx(height, abs=1e-4)
    assert same > 0.9 * len(HEIGHTS) * len(cells.point)


def test_it_differs_from_that_of_the_primitive_by_the_displacement_at_most(coarse: Constants) -> None:
    surfaces, cells = coarse.surfaces, coarse.deviations
    moved = 0.0
    for p in range(len(surfaces.kind)):
        for i in range(cells.start[p], cells.start[p + 1]):
            for u in np.random.default_rng(i).uniform(-0.4, 0.4, (8, 3)) * CELL_RADIUS:
                _, *place = project(surfaces.kind[p], surfaces.size[p], *(cells.point[i] + u))
                point = np.array(place[:3]) + 0.02 * np.array(place[3:])
                difference = abs(mean_surface_distance(surfaces, cells, p, tuple(point)) - 0.02)
                moved = max(moved, difference)
                # The point is higher than the surface, which turns it a little farther.
                assert difference < 1.4 * cells.displacement[p]
    assert moved > 0.01


def test_unmoved_primitives_have_their_own_distance() -> None:
    constants = build_constants(Scene(robot="ur5e"))
    surfaces = constants.surfaces
    rng = np.random.default_rng(5)
    for p in range(len(surfaces.kind)):
        point = tuple(rng.uniform(-0.2, 0.2, 3))
        expected = project(surfaces.kind[p], surfaces.size[p], *point)[0]
        assert mean_surface_distance(surfaces, constants.deviations, p, point) == expected


def test_clearance_is_to_the_mean_surfaces_of_the_neighbours(coarse: Constants) -> None:
    surfaces, cells = coarse.surfaces, coarse.deviations
    state, surface = placed(coarse, np.array([0.3, -1.2, 1.5, -1.9, -1.4, 0.5]))
    rotation, origin = state.frames.rotation, state.frames.origin
    near = 0
    for p in range(len(surfaces.kind)):
        links = range(int(surfaces.link[p]) - 1, int(surfaces.link[p]) + 2)
        others = [k for k in range(len(surfaces.kind)) if k != p and surfaces.link[k] in links]
        for i in range(cells.start[p], cells.start[p + 1]):
            place, normal = rotation[p] @ cells.mean_point[i] + origin[p], rotation[p] @ cells.mean_normal[i]
            expected = 0.03
            for k in others:
                height = OWN_CLEARANCE if surfaces.link[k] == surfaces.link[p] else 0.005
                x = rotation[k].T @ (place + height * normal - origin[k])
                expected = min(expected, mean_surface_distance(surfaces, cells, k, tuple(x)))
            near += expected < 0.03
            found = clearance(surface, p, tuple(place), tuple(normal), 0.005, 0.03)
            assert found == pytest.approx(expected, abs=1e-12)
    assert near > 20
