"""The signed-distance grid of a skin: its values, its gradient, the way onto the skin, and its files."""

from dataclasses import replace
from multiprocessing import get_context
from multiprocessing.synchronize import Barrier
from pathlib import Path

import numpy as np
import pytest
import trimesh

from contactsense import robots
from contactsense.robots.decomposition import grid_builder as gridding
from contactsense.robots.robot import Inertia, Joint, Link, Robot
from contactsense.robots.surface import signed_distance_grid as grid
from contactsense.robots.vectors import vector

pytestmark = pytest.mark.slow  # its kernels compile for long

RADIUS = 0.04


@pytest.fixture(scope="module")
def robot() -> Robot:
    body = Inertia(1.0, np.zeros(3), np.eye(3))
    hinge = Joint("hinge", np.eye(3), np.zeros(3), np.array([0.0, 0.0, 1.0]), (-1.0, 1.0), 1.0, 1.0)
    return Robot("ball", (Link("base", body), Link("ball", body)), (hinge,))


@pytest.fixture(scope="module")
def meshes() -> dict[str, trimesh.Trimesh]:
    return {"ball": trimesh.creation.icosphere(5, RADIUS).apply_translation((0.1, 0.0, 0.0))}


@pytest.fixture(scope="module")
def grids(robot: Robot, meshes: dict[str, trimesh.Trimesh]) -> grid.Grids:
    return gridding.build(robot, meshes)


def around(rng: np.random.Generator, count: int, low: float, high: float) -> np.ndarray:
    directions = rng.normal(size=(count, 3))
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    return directions * rng.uniform(low, high, size=(count, 1)) + [0.1, 0.0, 0.0]


def test_values_and_gradient_of_a_ball(grids: grid.Grids) -> None:
    for point in around(np.random.default_rng(0), 300, RADIUS - 0.01, RADIUS + 0.01):
        d, gradient = grid.sample(grids, 1, vector(point))
        offset = point - [0.1, 0.0, 0.0]
        far = np.linalg.norm(offset)
        assert d == pytest.approx(far - RADIUS, abs=2e-4)
        np.testing.assert_allclose(gradient, offset / far, atol=0.1)


def test_the_gradient_is_the_derivative_of_the_value(grids: grid.Grids) -> None:
    step = 1e-6
    checked = 0
    for point in around(np.random.default_rng(1), 100, RADIUS - 0.008, RADIUS + 0.008):
        cells = (point - grids.low[1]) / grids.cell
        if np.any(np.abs(cells - np.round(cells)) < 0.01):
            continue  # between cells the derivative jumps
        gradient = grid.sample(grids, 1, vector(point))[1]
        for axis in range(3):
            ahead, behind = point.copy(), point.copy()
            ahead[axis] += step
            behind[axis] -= step
            slope = (grid.sample(grids, 1, vector(ahead))[0] - grid.sample(grids, 1, vector(behind))[0]) / (
                2 * step
            )
            assert gradient[axis] == pytest.approx(slope, abs=1e-6)
        checked += 1
    assert checked > 80


def test_points_are_projected_to_the_skin(grids: grid.Grids) -> None:
    for point in around(np.random.default_rng(2), 200, RADIUS - 0.006, RADIUS + 0.006):
        left, moved, normal = grid.project_to_skin(grids, 1, vector(point), 3)
        assert abs(left) < 1e-5
        offset = np.array(moved) - [0.1, 0.0, 0.0]
        assert np.linalg.norm(offset) == pytest.approx(RADIUS, abs=2e-4)
        assert np.linalg.norm(normal) == pytest.approx(1.0)
        assert np.degrees(np.arccos((offset @ normal) / np.linalg.norm(offset))) < 6.0


def test_a_line_is_intersected_with_the_skin(grids: grid.Grids) -> None:
    rng = np.random.default_rng(3)
    for point in around(rng, 200, RADIUS - 0.005, RADIUS + 0.005):
        normal = (point - [0.1, 0.0, 0.0]) / np.linalg.norm(point - [0.1, 0.0, 0.0])
        line = normal + rng.uniform(-0.5, 0.5, size=3)
        left, on_skin, facing = grid.intersect_skin(grids, 1, vector(point), vector(line), 4)
        assert abs(left) < 1e-5
        offset, moved = np.array(on_skin) - [0.1, 0.0, 0.0], np.array(on_skin) - point
        np.testing.assert_allclose(np.cross(moved, line), 0.0, atol=1e-9)
        assert np.linalg.norm(offset) == pytest.approx(RADIUS, abs=2e-4)
        assert np.dot(facing, offset) / RADIUS > np.cos(np.radians(7.0))
        across = np.cross(normal, [0.0, 0.6, 0.8])
        assert np.isinf(grid.intersect_skin(grids, 1, vector(point), vector(across), 4)[0])


@pytest.mark.parametrize("point", [(0.1, 0.0, 0.0), (5.0, 0.0, 0.0), (0.1, 0.0, -0.0599), (np.inf, 0.0, 0.0)])
def test_far_from_the_skin_nothing_is_found(grids: grid.Grids, point: tuple[float, float, float]) -> None:
    assert np.isinf(grid.project_to_skin(grids, 1, point, 3)[0])


def test_a_link_without_mesh_has_no_grid(grids: grid.Grids) -> None:
    assert np.isinf(grid.sample(grids, 0, (0.0, 0.0, 0.0))[0])


def test_files_are_made_once_and_read_back(
    tmp_path: Path,
    robot: Robot,
    meshes: dict[str, trimesh.Trimesh],
    grids: grid.Grids,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    asked = []

    def build(robot: Robot, meshes: dict[str, trimesh.Trimesh]) -> grid.Grids:
        asked.append((robot, meshes))
        return grids

    monkeypatch.setattr(gridding, "build", build)
    first = gridding.cached(robot, meshes, tmp_path)
    np.testing.assert_array_equal(first.values, grids.values)
    made = sorted(tmp_path.iterdir())
    assert len(made) == 2
    assert isinstance(gridding.cached(robot, meshes, tmp_path).values, np.memmap)
    assert sorted(tmp_path.iterdir()) == made
    assert asked == [(robot, meshes)]
    # Another mesh is another file.
    gridding.cached(robot, {"ball": meshes["ball"].copy().apply_scale(1.1)}, tmp_path)
    assert len(list(tmp_path.iterdir())) == 4
    assert len(asked) == 2


def test_a_further_link_without_mesh_needs_other_grids(
    tmp_path: Path, robot: Robot, meshes: dict[str, trimesh.Trimesh]
) -> None:
    gridding.cached(robot, meshes, tmp_path)
    (hinge,), (base, ball) = robot.joints, robot.links
    longer = Robot("ball", (base, Link("hub", base.inertia), ball), (hinge, replace(hinge, name="second")))
    assert gridding.cached(longer, meshes, tmp_path).shape[:, 0].astype(bool).tolist() == [False, False, True]


def test_damaged_files_are_refused(tmp_path: Path, grids: grid.Grids) -> None:
    path = tmp_path / "ball.npy"
    with pytest.raises(robots.RobotError, match=r"ball.npy: no readable grid"):
        grid.read(path)
    grid.write(grids, path)
    np.save(path, grids.values[:-1])
    with pytest.raises(robots.RobotError, match=r"ball.npy: damaged"):
        grid.read(path)
    path.write_bytes(b"nothing")
    with pytest.raises(robots.RobotError, match=r"ball.npy: no readable grid"):
        grid.read(path)
    grid.write(grids, path)
    head = path.with_suffix(".head.npz")
    for damaged in (b"", head.read_bytes()[:200]):
        head.write_bytes(damaged)
        with pytest.raises(robots.RobotError, match=r"ball.npy: no readable grid.*delete it to rebuild it"):
            grid.read(path)


def test_grids_of_another_version_are_refused(tmp_path: Path, grids: grid.Grids) -> None:
    path = tmp_path / "ball.npy"
    grid.write(grids, path)
    with np.load(path.with_suffix(".head.npz")) as head:
        fields = {**head, "format": 0}
    np.savez(path.with_suffix(".head.npz"), **fields)
    with pytest.raises(robots.RobotError, match=r"ball.npy: written by another version; delete it"):
        grid.read(path)


def _write(grids: grid.Grids, path: Path, together: Barrier, times: int) -> None:
    for _ in range(times):
        together.wait(60.0)
        grid.write(grids, path)
        np.testing.assert_array_equal(grid.read(path).values, grids.values)


def test_two_processes_may_build_the_same_skin(tmp_path: Path, grids: grid.Grids) -> None:
    """Each process of a service that starts for the first time builds the skin, and all write it at once."""
    spawn = get_context("spawn")
    together = spawn.Barrier(2)
    both = [spawn.Process(target=_write, args=(grids, tmp_path / "ball.npy", together, 20)) for _ in range(2)]
    for each in both:
        each.start()
    for each in both:
        each.join(120.0)
    assert [each.exitcode for each in both] == [0, 0]
    assert sorted(each.name for each in tmp_path.iterdir()) == ["ball.head.npz", "ball.npy"]
