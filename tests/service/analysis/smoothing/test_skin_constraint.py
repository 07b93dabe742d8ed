"""Smoothed places are moved along the line of action onto the skin, and known there."""

import numpy as np
import pytest

from contactsense.robots.surface.signed_distance_grid import Grids
from contactsense.service.analysis.smoothing.place_search import Place
from contactsense.service.analysis.smoothing.skin_constraint import SKIN_DEVIATION, place_on_skin

HEIGHT = 0.002
"""Height of the skin over the primitive [m]."""
LEAN = np.array([0.3, -0.1, 1.0])
"""Line of action of the force."""


def flat_skin() -> Grids:
    """One link, the skin being the plane z = HEIGHT."""
    cell, shape = 0.005, (9, 9, 9)
    z = -0.02 + cell * np.arange(9)
    values = np.broadcast_to(z - HEIGHT, shape).astype(np.float32).ravel()
    return Grids(
        values, np.array([0, values.size]), np.array([shape]), np.array([[-0.02, -0.02, -0.02]]), cell
    )


def place(link: int, windows: int) -> Place:
    """A fixed place at the origin that would shift along LEAN if the surface were higher."""
    covariance = np.diag([1e-3, 2e-3, 0.0]) ** 2 + 5e-4**2 * np.outer(LEAN, LEAN)
    up = np.tile([0.0, 0.0, 1.0], (windows, 1))
    return Place(
        link, 0.0, np.zeros((windows, 3)), up, -up, np.tile(covariance, (windows, 1, 1)),
        np.zeros((1, 3)), 0.0, 1.0,
    )  # fmt: skip


def test_the_place_moves_along_the_line_of_action_to_the_skin() -> None:
    found = place_on_skin(flat_skin(), place(0, 3))
    np.testing.assert_allclose(found.point, np.tile(HEIGHT * LEAN, (3, 1)), atol=1e-6)
    np.testing.assert_allclose(found.normal, np.tile([0.0, 0.0, 1.0], (3, 1)), atol=1e-6)
    expected = np.diag([1e-3, 2e-3, 0.0]) ** 2 + SKIN_DEVIATION**2 * np.outer(LEAN, LEAN)
    for covariance in found.covariance:
        np.testing.assert_allclose(covariance, expected, rtol=1e-6, atol=1e-15)
        assert np.linalg.eigvalsh(covariance)[0] > 0.0


def test_a_place_is_not_moved_to_skin_that_faces_the_other_way() -> None:
    """The far side of a rib: a force that pushes into the primitive would pull there."""
    skin, before = flat_skin(), place(0, 2)
    after = place_on_skin(skin._replace(values=-skin.values), before)
    np.testing.assert_array_equal(after.point, before.point)
    np.testing.assert_array_equal(after.normal, before.normal)
    np.testing.assert_array_equal(after.covariance, before.covariance)


@pytest.mark.parametrize("link", [1, 0])
def test_without_skin_nearby_the_place_is_kept(link: int) -> None:
    before = place(link, 1)
    grids = flat_skin()
    if link == 0:
        grids = grids._replace(low=grids.low + 1.0)
    after = place_on_skin(grids, before)
    np.testing.assert_array_equal(after.point, before.point)
    np.testing.assert_array_equal(after.covariance, before.covariance)
