"""The ellipse of 90 % of a flat density: against drawn places."""

from typing import Any

import numpy as np
import pytest
from scipy.stats import chi2

from contactsense.localization.problem.surface_cells import SurfaceCells
from contactsense.localization.surface_search.ellipse_scale import ellipse_scale, scaled_along_surface

CHI_90 = chi2.ppf(0.9, 2)
N = 3000


def scaled(points: np.ndarray, variance: float | np.ndarray = 0.0) -> tuple[float, float]:
    """Scale for places in the plane z = 0, and the share of them that the scaled ellipse of 90 % holds.

    `variance`: of a Gaussian in each cell, along both axes or along each, shape (2,).
    """
    x, y = np.broadcast_to(variance, 2)
    fields: dict[str, Any] = dict.fromkeys(SurfaceCells._fields, np.zeros(0))
    fields |= {
        "point": np.column_stack((points, np.zeros(len(points)))),
        "weight": np.ones(len(points)),
        "covariance": np.tile([x, 0.0, 0.0, y, 0.0, 0.0], (len(points), 1)),
    }
    C = points.T @ points / len(points) + np.diag([x, y])
    scale = ellipse_scale(
        SurfaceCells(**fields),
        len(points),
        (0.0, 0.0, 0.0),
        (0.0, 0.0, 1.0),
        (C[0, 0], C[0, 1], 0.0, C[1, 1], 0.0, 0.0),
    )
    drawn = points + np.sqrt([x, y]) * np.random.default_rng(2).standard_normal(points.shape)
    squared = np.einsum("ij,ij->i", drawn @ np.linalg.inv(scale * C), drawn)
    return scale, float((squared < CHI_90).mean())


def disc(rng: np.random.Generator) -> np.ndarray:
    radius, angle = np.sqrt(rng.random(N)), rng.uniform(0.0, 2.0 * np.pi, N)
    return np.column_stack((0.1 * radius * np.cos(angle), 0.03 * radius * np.sin(angle)))


def test_a_gaussian_is_left_as_it_is() -> None:
    rng = np.random.default_rng(1)
    scale, inside = scaled(rng.standard_normal((N, 2)) * [0.1, 0.02])
    assert scale == pytest.approx(1.0, abs=0.04)
    assert inside == pytest.approx(0.9, abs=0.015)
    # So is one cell with a Gaussian in it.
    assert scaled(np.zeros((1, 2)), 0.01)[0] == pytest.approx(1.0)
    assert scaled(np.zeros((1, 2)), np.array([0.01, 0.0001]))[0] == pytest.approx(1.0)


@pytest.mark.parametrize("variance", [0.0, 1e-5, 1e-4, (1e-3, 1e-6)])
def test_ellipses_of_flat_densities_hold_their_share(variance: float | tuple[float, float]) -> None:
    rng = np.random.default_rng(1)
    rectangle = rng.uniform(-1.0, 1.0, (N, 2)) * [0.15, 0.04]
    around = np.column_stack((rng.uniform(-0.2, 0.2, N), 0.05 * np.sin(rng.uniform(0.0, 2.0 * np.pi, N))))
    for points in (disc(rng), rectangle, around):
        _, inside = scaled(points, np.array(variance))
        assert inside == pytest.approx(0.9, abs=0.03)


def test_the_factor_leaves_the_variance_along_the_normal() -> None:
    rng = np.random.default_rng(3)
    root, normal = rng.standard_normal((3, 3)), rng.standard_normal(3)
    C, normal = root @ root.T, normal / np.linalg.norm(normal)
    found = scaled_along_surface(tuple(C[np.triu_indices(3)]), tuple(normal), 0.6)
    scaled_C = np.zeros((3, 3))
    scaled_C[np.triu_indices(3)] = found
    scaled_C += np.triu(scaled_C, 1).T
    across = np.eye(3) - np.outer(normal, normal)
    assert normal @ scaled_C @ normal == pytest.approx(normal @ C @ normal)
    np.testing.assert_allclose(across @ scaled_C @ across, 0.6 * across @ C @ across, atol=1e-12)
    assert np.linalg.eigvalsh(scaled_C).min() > 0.0
