"""Bodies with edges and corners (the paper's figure 6): a rigid touch there has no torsion, so the wrench
axis finds it; a rounded stand-in finds it with the exact method, to within its rounding."""

import numpy as np
import pytest

from contactsense.solvers import Box, Polytope, Surface, solve, solve_batch

# A wedge with a crooked top, so that its edges have many angles.
WEDGE = np.array(
    [
        (0.1, 0.06, -0.04),
        (-0.1, 0.06, -0.04),
        (-0.1, -0.06, -0.04),
        (0.1, -0.06, -0.04),
        (0.08, 0.02, 0.05),
        (-0.06, 0.02, 0.05),
        (-0.06, -0.03, 0.04),
        (0.05, -0.01, 0.06),
    ]
)


def touched_edges(rng: np.random.Generator, count: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Points inside edges of the wedge, forces into the body between the two faces there, moments."""
    hull = Polytope(WEDGE, 0.0).hull
    points, forces = np.empty((count, 3)), np.empty((count, 3))
    for row in range(count):
        k = rng.integers(len(hull.length))
        points[row] = hull.edge[k, 0] + rng.uniform(0.1, 0.9) * hull.length[k] * hull.edge[k, 1]
        faces = np.flatnonzero(np.abs(hull.normal @ points[row] - hull.offset) < 1e-10)
        assert len(faces) == 2
        points[row] = (points[row] + hull.middle) * hull.unit
        forces[row] = -rng.uniform(0.5, 5.0, 2) @ hull.normal[faces]
    return points, forces, np.cross(points, forces)


def test_the_wrench_axis_finds_a_touch_on_a_sharp_edge() -> None:
    points, forces, moments = touched_edges(np.random.default_rng(1), 60)
    found = solve_batch(Polytope(WEDGE, 0.0), forces, moments, "wrench_axis")
    assert np.all(found.ok)
    np.testing.assert_allclose(found.centroid, points, atol=1e-12)


@pytest.mark.parametrize("rounding", [1e-3, 1e-6])
def test_the_exact_method_on_a_rounded_body_is_as_accurate_as_its_rounding(rounding: float) -> None:
    points, forces, moments = touched_edges(np.random.default_rng(2), 60)
    found = solve_batch(Polytope(WEDGE, rounding), forces, moments)
    assert np.all(found.ok)
    away = np.linalg.norm(found.centroid - points, axis=1)
    # Without torsion the contact is where the line enters the ball around the edge.
    assert np.all(away <= rounding * (1.0 + 1e-9) + 1e-12)
    assert np.all(away >= rounding * (1.0 - 1e-9) - 1e-12)


@pytest.mark.parametrize(
    ("sharp", "rounded"),
    [
        (Polytope(WEDGE, 0.0), Polytope(WEDGE, 1e-3)),
        (Box(0.1, 0.06, 0.04, 0.0), Box(0.1, 0.06, 0.04, 1e-3)),
    ],
)
def test_a_torsion_on_an_edge_is_located_only_with_rounding(sharp: Surface, rounded: Surface) -> None:
    # Beside the lower edge y = 0.06, z = -0.04, about a normal between those of its faces.
    normal = np.array((0.0, 1.0, -1.0)) / np.sqrt(2.0)
    point, force = np.array((0.01, 0.06, -0.04)) + 1e-3 * normal, np.array((0.0, -2.0, 1.0))
    moment = np.cross(point, force) + 0.02 * normal
    found = solve(rounded, force, moment)
    assert found.ok
    np.testing.assert_allclose(found.centroid, point, atol=1e-12)
    assert found.torsion == pytest.approx(0.02)
    # A sharp face that ends there explains the wrench as well, by a place elsewhere along the edge.
    beside = solve(sharp, force, moment)
    assert beside.ok
    assert beside.residual < 1e-12
    np.testing.assert_allclose(beside.centroid[1:], point[1:], atol=5e-3)
    assert abs(beside.centroid[0] - point[0]) > 1e-2
