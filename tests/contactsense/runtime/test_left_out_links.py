"""What the kernels know of links that are left out of `touchable`."""

import numpy as np
import pytest

from contactsense import Scene
from contactsense.runtime.constants import build_constants
from contactsense.runtime.left_out_links import left_out_links
from contactsense.runtime.link_prior import area_share

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
    left_out = left_out_links(Scene(robot="ur5e", touchable=KEPT), WHOLE.prior.area)
    of_sample = WHOLE.surfaces.link[WHOLE.samples.primitive]
    for link in np.flatnonzero(OUT):
        mine = of_sample == link
        point, weight = WHOLE.samples.point[mine], np.exp(WHOLE.samples.log_share[mine])
        # Samples stand for cells of 35 mm.
        np.testing.assert_allclose(left_out.centre[link], weight @ point / weight.sum(), atol=0.01)
        covariance = np.cov(point.T, aweights=weight, bias=True)
        np.testing.assert_allclose(left_out.covariance[link], covariance, atol=0.15 * covariance.trace())


def test_with_equal_links_each_is_as_probable_as_a_searched_one() -> None:
    left_out = left_out_links(Scene(robot="ur5e", touchable=KEPT, link_prior="equal"), 1.0)
    assert np.exp(left_out.log_weight[OUT]) == pytest.approx(1.0 / len(KEPT))


def test_a_link_that_cannot_be_touched_is_not_left_out() -> None:
    weights = {name: float(name in KEPT) for name in NAMES}
    assert np.isneginf(left_out_links(Scene(robot="ur5e", link_prior=weights), 1.0).log_weight).all()
    assert np.isneginf(WHOLE.left_out.log_weight).all()
