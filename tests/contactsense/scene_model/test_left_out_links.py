"""What the kernels know of links that are left out of `touchable`."""

from typing import Any

import numpy as np
import pytest

from contactsense import Scene
from contactsense.scene_model.constants import build_constants
from contactsense.scene_model.left_out_links import unsearched_surfaces
from contactsense.scene_model.link_prior import area_share

KEPT = ("forearm", "wrist_1", "wrist_2", "wrist_3")
WHOLE = build_constants(Scene(robot="ur5e"))
NAMES = Scene(robot="ur5e").link_names
OUT = ~np.isin(NAMES, KEPT)


def test_a_link_left_out_counts_by_its_area_as_in_the_whole_scene() -> None:
    constants = build_constants(Scene(robot="ur5e", touchable=KEPT))
    share = area_share(WHOLE.surfaces, WHOLE.samples, len(NAMES))
    expected = share[OUT] / share[~OUT].sum()
    np.testing.assert_allclose(np.exp(constants.left_out.log_weight[OUT]), expected, rtol=1e-9)
    assert np.isneginf(constants.left_out.log_weight[~OUT]).all()


def test_centre_and_covariance_are_those_of_the_surface() -> None:
    left_out = build_constants(Scene(robot="ur5e", touchable=KEPT)).left_out
    of_sample = WHOLE.surfaces.link[WHOLE.samples.primitive]
    for link in np.flatnonzero(OUT):
        mine = of_sample == link
        point, weight = WHOLE.samples.point[mine], np.exp(WHOLE.samples.log_share[mine])
        # Samples stand for cells of 35 mm.
        np.testing.assert_allclose(left_out.centre[link], weight @ point / weight.sum(), atol=0.01)
        covariance = np.cov(point.T, aweights=weight, bias=True)
        np.testing.assert_allclose(left_out.covariance[link], covariance, atol=0.15 * covariance.trace())


def test_with_equal_links_each_is_as_probable_as_a_searched_one() -> None:
    left_out = build_constants(Scene(robot="ur5e", touchable=KEPT, link_prior="equal")).left_out
    assert np.exp(left_out.log_weight[OUT]) == pytest.approx(1.0 / len(KEPT))


def test_a_link_that_cannot_be_touched_is_not_left_out() -> None:
    weights = {name: float(name in KEPT) for name in NAMES}
    assert np.isneginf(build_constants(Scene(robot="ur5e", link_prior=weights)).left_out.log_weight).all()
    assert np.isneginf(WHOLE.left_out.log_weight).all()


@pytest.mark.parametrize(
    "changes", [{"touchable": KEPT}, {"link_prior": {name: float(name in KEPT) for name in NAMES}}]
)
def test_the_cells_of_the_other_links_are_those_of_the_whole_scene(changes: dict[str, Any]) -> None:
    scene = Scene(robot="ur5e", **changes)
    constants = build_constants(scene)
    area = unsearched_surfaces(scene).area
    assert (area > 0.0).tolist() == OUT.tolist()
    assert constants.prior.area + area.sum() == pytest.approx(WHOLE.prior.area)
    kept = ~OUT[WHOLE.surfaces.link[WHOLE.samples.primitive]]
    np.testing.assert_array_equal(constants.samples.point, WHOLE.samples.point[kept])
