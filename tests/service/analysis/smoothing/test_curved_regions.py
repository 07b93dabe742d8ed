"""Regions on curved surfaces: the surface's curvature is an error along the normal."""

import numpy as np
import pytest

from contactsense.robots.primitives import Box, Sphere
from contactsense.robots.robot import Inertia, Link
from contactsense.robots.surface.convex_primitives import Surfaces, pack
from contactsense.robots.surface.signed_distance_grid import Grids
from contactsense.service.analysis.smoothing.curved_regions import curvature_covariance

RADIUS = 0.04
BODY = Inertia(1.0, np.zeros(3), np.eye(3))
NO_SKIN = Grids(
    np.zeros(0, dtype=np.float32), np.zeros(1, dtype=np.int64), np.zeros((0, 3), dtype=np.int64),
    np.zeros((0, 3)), 1.0,
)  # fmt: skip
UP = np.array([[0.0, 0.0, 1.0]])


def surfaces() -> Surfaces:
    ball = Sphere(center=(0.0, 0.0, -RADIUS), radius=RADIUS)
    flat = Box(center=(0.0, 0.0, -0.1), half=(0.2, 0.2, 0.1), rounding=0.005)
    return pack([Link("ball", BODY, (ball,)), Link("flat", BODY, (flat,))])


def region(tangential: float, normal: float) -> np.ndarray:
    return np.diag([tangential, tangential, normal])[None] ** 2


def test_the_height_of_a_sphere_has_its_mean_square() -> None:
    """E (r^2 / 2 R)^2 = 2 sigma^4 / R^2 for two directions with sigma."""
    more = curvature_covariance(surfaces(), NO_SKIN, 0, np.zeros((1, 3)), UP, region(0.003, 0.0005))
    assert np.sqrt(more[0, 2, 2]) == pytest.approx(np.sqrt(2.0) * 0.003**2 / RADIUS, rel=0.05)
    np.testing.assert_allclose(more[0, :2], 0.0)


def test_what_counts_is_the_way_to_the_nearest_place_along_the_normal() -> None:
    """Even where the surface has turned away: the nine nodes of the quadrature, by hand."""
    sigma = 0.02
    more = curvature_covariance(surfaces(), NO_SKIN, 0, np.zeros((1, 3)), UP, region(sigma, 0.0005))
    square = 0.0
    for x, share_x in ((-1.0, 1 / 6), (0.0, 4 / 6), (1.0, 1 / 6)):
        for y, share_y in ((-1.0, 1 / 6), (0.0, 4 / 6), (1.0, 1 / 6)):
            from_center = np.array([x * np.sqrt(3.0) * sigma, y * np.sqrt(3.0) * sigma, RADIUS])
            nearest = RADIUS * from_center / np.linalg.norm(from_center)
            square += share_x * share_y * (RADIUS - nearest[2]) ** 2
    assert more[0, 2, 2] == pytest.approx(square, rel=1e-9)


def test_a_flat_face_adds_nothing() -> None:
    more = curvature_covariance(surfaces(), NO_SKIN, 1, np.zeros((1, 3)), UP, region(0.003, 0.0005))
    np.testing.assert_allclose(more, 0.0, atol=1e-20)


@pytest.mark.parametrize("tangential", [0.002, 0.004, 0.008])
def test_about_nine_of_ten_places_on_a_sphere_lie_in_their_region(tangential: float) -> None:
    rng, covariance = np.random.default_rng(1), region(tangential, 0.0001)
    more = curvature_covariance(surfaces(), NO_SKIN, 0, np.zeros((1, 3)), UP, covariance)
    error = rng.standard_normal((4000, 3)) * np.sqrt(np.diag(covariance[0]))
    error[:, 2] += np.sqrt(RADIUS**2 - np.sum(error[:, :2] ** 2, axis=1)) - RADIUS
    plain, curved = (
        np.mean(np.einsum("ni,ij,nj->n", error, np.linalg.inv(C[0]), error) < 6.251)
        for C in (covariance, covariance + more)
    )
    assert curved > plain + 0.05
    # The heights are not normally distributed: five per cent off at the most.
    assert 0.85 < curved < 0.95
