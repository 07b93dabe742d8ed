"""What `solve`, `solve_batch` and the surfaces accept, and what they return."""

import numpy as np
import pytest

from contactsense.solvers import (
    Compound,
    ContactPrior,
    Ellipsoid,
    Placed,
    Plane,
    Polytope,
    Sphere,
    Status,
    sensitivity,
    solve,
    solve_batch,
)
from contactsense.solvers.solver_batch import compiled_rows

BALL = Sphere(0.1)


@pytest.mark.parametrize("shape", [(3, 5), (3,), (6, 1), (2, 3, 3), (0,)])
def test_a_batch_of_another_shape_is_rejected(shape: tuple[int, ...]) -> None:
    with pytest.raises(ValueError, match=r"force: expected shape \(N, 3\)"):
        solve_batch(BALL, np.ones(shape), np.ones(shape))


@pytest.mark.parametrize("arguments", [{}, {"covariance": np.eye(6)}])
@pytest.mark.parametrize("surface", ["sphere", Sphere, None])
def test_what_is_no_surface_is_named(surface: object, arguments: dict[str, np.ndarray]) -> None:
    with pytest.raises(TypeError, match=r"^surface: expected one such as Sphere\(0.01\), got "):
        solve(surface, np.ones(3), np.ones(3), **arguments)  # type: ignore[call-overload]


@pytest.mark.parametrize("radius", ["a", [1.0], None])
def test_a_length_is_a_number(radius: object) -> None:
    with pytest.raises(TypeError, match=r"^Sphere: radius must be a number, not "):
        Sphere(radius)  # type: ignore[arg-type]


def test_rows_must_match() -> None:
    with pytest.raises(ValueError, match="moment: expected 4 rows"):
        solve_batch(BALL, np.ones((4, 3)), np.ones((1, 3)))
    with pytest.raises(ValueError, match=r"moment: expected shape \(3,\)"):
        solve(BALL, np.ones(3), np.ones((1, 3)))


def test_what_is_no_prior_is_named() -> None:
    with pytest.raises(TypeError, match=r"^prior: expected a ContactPrior, got 0\.5"):
        solve(BALL, -np.ones(3), np.zeros(3), covariance=np.eye(6), prior=0.5)  # type: ignore[call-overload]
    with pytest.raises(TypeError, match=r"^friction: must be a number, not 'a'"):
        ContactPrior(friction="a")  # type: ignore[arg-type]


def test_what_has_no_sensitivity_is_named() -> None:
    wrench = (-np.ones(3), np.zeros(3))
    exact, probable = solve(BALL, *wrench), solve(BALL, *wrench, covariance=np.eye(6))
    with pytest.raises(
        TypeError, match=r"^solution: expected one of `solve` without a covariance, got Probable"
    ):
        sensitivity(BALL, probable)  # type: ignore[arg-type]
    for covariance in (np.eye(3), np.ones(6), np.diag([np.nan] * 6)):
        with pytest.raises(ValueError, match=r"^wrench: expected a finite covariance of shape \(6, 6\)"):
            sensitivity(BALL, exact).covariance(covariance)


def test_what_is_no_part_is_named() -> None:
    with pytest.raises(
        TypeError, match=r"^Compound: expected parts such as Part\(.*, got Sphere\(radius=0.1"
    ):
        Compound([BALL], 1.0)  # type: ignore[list-item]


def test_a_masked_wrench_is_none() -> None:
    """NumPy keeps a number below the mask, and converts the array to it without a word."""
    force = np.ma.masked_array([0.0, 0.0, -1.0], [True, False, False])
    assert solve(BALL, force, np.zeros(3)).status == Status.NOT_FINITE
    rows = np.ma.masked_array([[0.0, 0.0, -1.0]] * 2, [[True, False, False], [False] * 3])
    assert solve_batch(BALL, rows, np.zeros((2, 3))).status.tolist() == [Status.NOT_FINITE, Status.OK]
    masked = np.ma.masked_array(np.eye(6), np.eye(6) > 0.0)
    with pytest.raises(ValueError, match="covariance: must be finite"):
        solve(BALL, force.data, np.zeros(3), covariance=masked)


@pytest.mark.parametrize(("force", "got"), [("up", "'up'"), (np.ones(3) + 1j, r"array\(\[1\.\+1\.j")])
def test_what_is_no_wrench_is_named(force: object, got: str) -> None:
    with pytest.raises(ValueError, match=f"^force: expected numbers, got {got}"):
        solve(BALL, force, np.zeros(3))  # type: ignore[call-overload]


@pytest.mark.slow
def test_an_empty_batch_has_no_solutions() -> None:
    assert solve_batch(BALL, np.empty((0, 3)), np.empty((0, 3))).status.shape == (0,)


def test_the_loop_of_a_library_surface_is_read_from_the_cache() -> None:
    wrenches = np.array([[0.0, 0.0, -1.0, 0.01, 0.0, 0.0]])
    solver, size = BALL.problem()
    for _ in range(2):  # the first may have to compile
        compiled_rows.cache_clear()
        rows = compiled_rows(solver)
        rows(wrenches, size, np.empty(1, dtype=np.int64), np.empty((1, 9)))
    assert rows.stats.cache_hits
    assert compiled_rows(BALL.line_problem()[0]).py_func.__qualname__ != rows.py_func.__qualname__


def test_a_solution_keeps_its_wrench() -> None:
    force, moment = np.array((0.0, 0.0, -1.0)), np.array((0.01, 0.0, 0.0))
    one, many = solve(BALL, force, moment), solve_batch(BALL, force[None], moment[None])
    force[:] = moment[:] = 7.0
    np.testing.assert_array_equal(one.force, (0.0, 0.0, -1.0))
    np.testing.assert_array_equal(one.moment, (0.01, 0.0, 0.0))
    np.testing.assert_array_equal(many.force, [(0.0, 0.0, -1.0)])


def test_solutions_and_places_compare_by_value() -> None:
    wrench = ((0.0, 0.0, -1.0), (0.01, 0.0, 0.0))
    assert solve(BALL, *wrench) == solve(BALL, *wrench)
    assert solve(BALL, *wrench) != solve(Sphere(0.2), *wrench)
    assert solve(BALL, *wrench) != solve(BALL, *wrench, "wrench_axis")
    rows = ([wrench[0]], [wrench[1]])
    assert solve_batch(BALL, *rows) == solve_batch(BALL, *rows)
    turned = Placed(BALL, np.ones(3), np.eye(3))
    assert turned == Placed(BALL, np.ones(3), np.eye(3))
    assert turned != Placed(BALL, np.zeros(3), np.eye(3))


@pytest.mark.parametrize(
    ("origin", "rotation", "said"),
    [
        (np.zeros(2), np.eye(3), "origin must be finite and of shape"),
        (np.array((0.0, np.nan, 0.0)), np.eye(3), "origin must be finite"),
        (np.zeros(3), np.eye(4), "rotation must be finite and of shape"),
        (np.zeros(3), 2.0 * np.eye(3), "orthonormal and right-handed"),
        (np.zeros(3), np.diag((1.0, 1.0, -1.0)), "orthonormal and right-handed"),
    ],
)
def test_a_pose_is_checked(origin: np.ndarray, rotation: np.ndarray, said: str) -> None:
    with pytest.raises(ValueError, match=said):
        Placed(Ellipsoid(0.1, 0.2, 0.3), origin, rotation)


def test_a_placed_surface_does_not_follow_the_array_it_was_made_from() -> None:
    origin = np.zeros(3)
    placed = Placed(BALL, origin, np.eye(3))
    origin[:] = 1.0
    np.testing.assert_array_equal(placed.origin, np.zeros(3))


def test_planes_and_points_are_checked() -> None:
    with pytest.raises(ValueError, match="Plane: normal"):
        Plane((0.0, 0.0, 0.0), 0.1)
    with pytest.raises(ValueError, match="Plane: offset"):
        Plane((0.0, 0.0, 1.0), np.nan)
    with pytest.raises(ValueError, match="Polytope: points"):
        Polytope(np.zeros((4, 2)), 0.1)
    with pytest.raises(ValueError, match=r"^Polytope: points: expected numbers"):
        Polytope([["a", 0.0, 0.0]], 0.1)
    with pytest.raises(ValueError, match=r"^Polytope: points must be finite"):
        Polytope(np.ma.masked_array(np.eye(4, 3), np.eye(4, 3) > 0.0), 0.1)


@pytest.mark.parametrize(
    "points", [np.zeros((1, 3)), np.eye(3), np.zeros((9, 3)), np.eye(3)[[0, 0, 1, 2, 2]]]
)
def test_points_without_a_volume_are_named(points: np.ndarray) -> None:
    with pytest.raises(ValueError, match=r"^Polytope: points must span a volume, not "):
        Polytope(points, 0.1)
