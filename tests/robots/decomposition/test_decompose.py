"""Primitives fitted to meshes of known shape, and to a real link."""

import numpy as np
import pytest
import trimesh

from contactsense import robots
from contactsense.robots.decomposition.decompose import Fit, Options, choose, fit_link
from contactsense.robots.decomposition.least_squares_fit import Bodies
from contactsense.robots.decomposition.outer_skin import OutOfReachError
from contactsense.robots.decomposition.surface_error import exposed_surface, packed, surface_points
from contactsense.robots.decomposition.yaml_export import primitive, primitives
from contactsense.robots.primitives import Box, Capsule, Cylinder, Sphere
from contactsense.robots.robot import Inertia, Link
from contactsense.robots.surface.convex_primitives import BOX, ELLIPSOID, REVOLVED, pack
from contactsense.robots.surface.union import distances
from contactsense.robots.urdf.meshes import from_folder
from tests.robots.shapes import two_links, two_meshes
from tests.shared import shared

QUICK = Options(guesses=20, most=3, tolerance=0.0015, samples=6000)


def bodies(kind: int, *size: float) -> Bodies:
    full = np.zeros((1, 8))
    full[0, : len(size)] = size
    turn = np.array([[0.0, 0.0, 1.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]])
    return Bodies(np.array([kind]), turn[None], np.array([[0.1, 0.2, -0.1]]), full)


@pytest.fixture(scope="module")
def bar() -> tuple[Fit, ...]:
    return fit_link(two_links(), two_meshes(), 1, QUICK)


@pytest.mark.slow
def test_finds_the_two_bodies_that_made_the_mesh(bar: tuple[Fit, ...]) -> None:
    assert len(bar) == 2
    found = bar[1]
    assert found.p95 < 0.0015
    assert np.median(np.abs(found.errors.skin)) < 2e-4
    assert np.degrees(np.median(found.errors.angle)) < 3.0
    assert bar[0].p95 > found.p95


def test_a_link_within_its_neighbour_cannot_be_fitted() -> None:
    meshes = two_meshes() | {"bar": trimesh.creation.icosphere(2, 0.01)}
    meshes["base"].apply_scale(3.0)
    with pytest.raises(OutOfReachError, match="can be reached by a finger"):
        fit_link(two_links(), meshes, 1, QUICK)


@pytest.mark.long
def test_the_same_seed_gives_the_same_bodies(bar: tuple[Fit, ...]) -> None:
    again = fit_link(
        two_links(), two_meshes(), 1, Options(guesses=20, most=1, tolerance=0.0015, samples=6000)
    )
    for one, other in zip(again[0].bodies, bar[0].bodies, strict=True):
        np.testing.assert_array_equal(one, other)


@pytest.mark.slow
def test_rounded_to_a_file_the_surface_stays(bar: tuple[Fit, ...]) -> None:
    link = Link("bar", Inertia(1.0, np.zeros(3), np.eye(3)), primitives(bar[1].bodies))
    points = np.random.default_rng(0).uniform(-0.15, 0.15, size=(300, 3))
    before, after = distances(packed(bar[1].bodies), points)[0], distances(pack([link]), points)[0]
    np.testing.assert_allclose(after, before, atol=1e-4)


@pytest.mark.parametrize(
    ("kind", "size", "expected"),
    [
        (REVOLVED, (0.0, 0.0, 0.0, 0.05), Sphere),
        (REVOLVED, (0.1, 0.0, 0.0, 0.05), Capsule),
        (REVOLVED, (0.1, 0.02, 0.05, 0.01), Cylinder),
        (REVOLVED, (0.0, 0.02, 0.02, 0.01), Cylinder),
        (REVOLVED, (0.1, 0.0, 0.05, 0.01), Cylinder),
        (BOX, (0.1, 0.0, 0.05, 0.01), Box),
        (ELLIPSOID, (0.1, 0.03, 0.05), None),
    ],
)
def test_each_body_becomes_the_primitive_that_describes_it(
    kind: int, size: tuple[float, ...], expected: type | None
) -> None:
    body = bodies(kind, *size)
    shape = primitive(kind, body.rotation[0], body.origin[0], body.size[0])
    assert expected is None or isinstance(shape, expected)
    link = Link("link", Inertia(1.0, np.zeros(3), np.eye(3)), (shape,))
    points = np.random.default_rng(1).uniform(-0.3, 0.3, size=(300, 3))
    np.testing.assert_allclose(
        distances(pack([link]), points)[0], distances(packed(body), points)[0], atol=1e-4
    )


@pytest.mark.parametrize("half", [0.001, 0.005, 0.02])
@pytest.mark.parametrize("narrow", [0.0, 0.001])
def test_the_ball_of_a_steep_cone_fits_when_rounded(half: float, narrow: float) -> None:
    """Near its tip a hundredth of a millimetre decides."""
    for seed in range(50):
        rng = np.random.default_rng(seed)
        axis = rng.normal(size=3)
        turn = np.linalg.qr(np.column_stack((axis, np.eye(3)[:, :2])))[0][:, [1, 2, 0]]
        size = np.array([half, rng.uniform(0.05, 0.1), narrow, 0.011, 0.0, 0.0, 0.0, 0.0])
        shape = primitive(REVOLVED, turn, rng.normal(size=3), size)
        assert isinstance(shape, Cylinder)
        assert shape.rounding > 0.01


@pytest.mark.parametrize(
    ("kind", "size", "area"),
    [
        (REVOLVED, (0.0, 0.0, 0.0, 0.05), 4 * np.pi * 0.05**2),
        (REVOLVED, (0.1, 0.0, 0.0, 0.05), 2 * np.pi * 0.05 * 0.2 + 4 * np.pi * 0.05**2),
        (REVOLVED, (0.1, 0.06, 0.02, 0.01), None),
        (BOX, (0.1, 0.2, 0.3, 1e-6), 8 * (0.02 + 0.06 + 0.03)),
        (BOX, (0.1, 0.2, 0.3, 0.05), None),
        (ELLIPSOID, (0.1, 0.05, 0.03), None),
    ],
)
def test_samples_of_primitives_lie_on_them_evenly(
    kind: int, size: tuple[float, ...], area: float | None
) -> None:
    body, rng = bodies(kind, *size), np.random.default_rng(0)
    local, found = surface_points(kind, body.size[0], 4000, rng)
    points = body.origin[0] + local @ body.rotation[0].T
    # None may count as inside: a sample of the union is one that lies in no primitive.
    np.testing.assert_allclose(distances(packed(body), points)[0], 0.0, atol=1e-9)
    if area is not None:
        assert found == pytest.approx(area, rel=1e-3)
        # By symmetry the mean is the middle.
        np.testing.assert_allclose(points.mean(axis=0), body.origin[0], atol=0.01)
    assert len(exposed_surface(body, 4000, rng)) > 0.9 * len(points)


@pytest.mark.parametrize(("across", "along"), [(0.03, 0.12), (0.1, 0.03)])
def test_samples_of_an_ellipsoid_are_even_by_area(across: float, along: float) -> None:
    """Against the area between two heights of a body of revolution, by quadrature."""
    z = np.linspace(-along, along, 20001)
    density = np.sqrt(1.0 - (z / along) ** 2 * (1.0 - (across / along) ** 2))
    share = density[np.abs(z) < 0.8 * along].sum() / density.sum()
    size = np.array([across, across, along, 0.0, 0.0, 0.0, 0.0, 0.0])
    points, _ = surface_points(ELLIPSOID, size, 20000, np.random.default_rng(0))
    found = float(np.mean(np.abs(points[:, 2]) < 0.8 * along))
    assert found == pytest.approx(share, abs=4.0 * np.sqrt(share * (1.0 - share) / len(points)))


@pytest.mark.slow
def test_a_limit_in_all_is_kept_where_it_costs_least(bar: tuple[Fit, ...]) -> None:
    assert choose([bar, bar], 0.0015) == [1, 1]
    assert sum(choose([bar, bar], 0.0015, total=3)) == 1
    assert choose([bar, bar], 0.0015, total=1) == [0, 0]


@pytest.mark.long
def test_a_real_wrist() -> None:
    robot = robots.load("ur5e")
    meshes = from_folder(shared("ur_visual/ur5e"), robot.link_names)
    found = fit_link(robot, meshes, 4, Options(guesses=30, most=3))
    assert found[-1].p95 < 0.002
