"""The prior at one place: the cell that it is in, found by brute force."""

import numpy as np
import pytest

from contactsense import Scene, robots
from contactsense.localization.surface.local_prior import (
    LONG_TAILS,
    DeviationCells,
    nearest_cell,
    prior_in_cell,
)
from contactsense.robots.jit.kernel import kernel
from contactsense.robots.surface.convex_primitives import project
from contactsense.scene_model.constants import build_constants
from contactsense.scene_model.deviation_cells import LEAST_OFFSET, deviation_cells
from contactsense.scene_model.scene_surfaces import scene_surfaces
from contactsense.solvers.posterior.contact_prior import Prior


@kernel
def _numbers(
    prior: Prior, cells: DeviationCells, p: int, x: float, y: float, z: float
) -> tuple[float, float, float]:
    local = prior_in_cell(prior, cells, nearest_cell(cells, p, x, y, z))
    return local.surface_deviation, local.friction_ratio, local.torsion_lever


def test_a_place_has_the_deviations_of_the_nearest_cell_of_its_primitive() -> None:
    scene = Scene(robot="ur5e")
    constants = build_constants(scene)
    prior, cells = constants.prior, constants.deviations
    rng = np.random.default_rng(1)
    links = robots.load("ur5e").links
    for p in range(len(constants.surfaces.kind)):
        link = int(constants.surfaces.link[p])
        own = [c for c in links[link].deviation if c.primitive == p - constants.surfaces.start[link]]
        assert len(own) == cells.start[p + 1] - cells.start[p]
        place = rng.uniform(-0.1, 0.1, 3)
        deviation, friction_ratio, torsion_lever = _numbers(prior, cells, p, *place)
        assert torsion_lever == prior.torsion_lever
        if not own:
            assert (deviation, friction_ratio) == (prior.surface_deviation, prior.friction_ratio)
            continue
        in_link = constants.surfaces.rotation[p] @ place + constants.surfaces.origin[p]
        nearest = min(own, key=lambda c: float(np.linalg.norm(np.array(c.point) - in_link)))
        assert deviation == pytest.approx(max(LONG_TAILS * nearest.offset, LEAST_OFFSET))
        assert friction_ratio == pytest.approx(np.hypot(prior.friction_ratio, LONG_TAILS * nearest.tilt))
        ratios = [max(LONG_TAILS * c.offset, LEAST_OFFSET) / prior.surface_deviation for c in own]
        assert cells.largest[p] == pytest.approx(max(ratios))


@pytest.mark.parametrize("detail", ["coarse", "fine"])
@pytest.mark.parametrize("name", robots.names())
def test_cells_of_the_librarys_arms_lie_on_their_primitives(name: str, detail: str) -> None:
    scene = Scene(robot=name, detail=detail)  # type: ignore[arg-type]
    surfaces = scene_surfaces(scene)
    cells = deviation_cells(scene, surfaces)
    assert len(cells.ratio) > 100
    for p in range(len(surfaces.kind)):
        for i in range(cells.start[p], cells.start[p + 1]):
            distance = project(surfaces.kind[p], surfaces.size[p], *cells.point[i])[0]
            # A cell's centre is inside a round surface, by its sagitta.
            # Coarse primitives are as large as a housing, or overlap so that only a rim is left of one.
            assert (-0.03 if detail == "fine" else -0.1) < distance < 0.002


def test_an_error_that_the_scene_states_is_that_of_all_places() -> None:
    scene = Scene(robot="ur5e", surface_error=0.001)
    cells = deviation_cells(scene, scene_surfaces(scene))
    assert len(cells.ratio) == 0
    assert set(cells.largest) == {1.0}


def test_links_that_cannot_be_touched_and_bodies_of_the_cell_have_no_cells() -> None:
    scene = Scene(
        robot="ur5e",
        touchable=["forearm"],
        bodies=[
            {
                "name": "cap",
                "role": "cover",
                "primitives": [{"kind": "sphere", "center": [0, 0, 1], "radius": 0.1}],
            }
        ],
    )
    surfaces = scene_surfaces(scene)
    cells = deviation_cells(scene, surfaces)
    count = np.diff(cells.start)
    assert count[surfaces.start[3] : surfaces.start[4]].sum() == len(cells.ratio) > 50
