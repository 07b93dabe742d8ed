"""The mean surface of coarse primitives: their motion, which cell a force enters, and contacts on it."""

from typing import Literal

import numpy as np
import pytest

from contactsense import Localizer, Scene, WrenchSensor, robots
from contactsense.kinematics.forward_kinematics import forward_kinematics
from contactsense.localization.surface.local_prior import DeviationCells, nearest_cell
from contactsense.localization.surface.mean_surface import CELL_SPREAD, LEAST_PUSH, entered_cell, mean_frame
from contactsense.localization.surface.placed_surface import PlacedSurface
from contactsense.robots.decomposition.local_deviation import MOVED_CELL
from contactsense.robots.jit.kernel import kernel
from contactsense.robots.surface.convex_primitives import project
from contactsense.runtime.buffers import Buffers, buffer_views
from contactsense.scene_model.constants import Constants, build_constants

COARSE = Scene(robot="ur5e", detail="coarse")


@pytest.fixture(scope="module")
def constants() -> Constants:
    return build_constants(COARSE)


def test_the_spread_of_a_cell_is_that_of_a_square() -> None:
    assert pytest.approx(MOVED_CELL / np.sqrt(12.0), rel=0.01) == CELL_SPREAD


def test_each_coarse_primitive_is_moved_in_its_cells_as_the_file_says(constants: Constants) -> None:
    surfaces, cells = constants.surfaces, constants.deviations
    assert (cells.displacement > 0.0).all()
    for number, link in enumerate(robots.load("ur5e").links):
        for cell in link.coarse_deviation:
            p = int(surfaces.start[number]) + cell.primitive
            R, o = surfaces.rotation[p], surfaces.origin[p]
            local = R.T @ (np.array(cell.point) - o)
            i = int(nearest_cell(cells, p, *local))
            np.testing.assert_allclose(cells.point[i], local, atol=1e-12)
            Q, t = cells.rotation[i], cells.translation[i]
            np.testing.assert_allclose(Q @ Q.T, np.eye(3), atol=1e-12)
            assert np.linalg.det(Q) == pytest.approx(1.0)
            # The centre of the cell is only shifted.
            np.testing.assert_allclose(R @ (Q @ local + t) + o, np.add(cell.point, cell.shift), atol=1e-12)
            angle = np.arccos(np.clip((np.trace(Q) - 1.0) / 2.0, -1.0, 1.0))
            assert angle == pytest.approx(np.linalg.norm(cell.turn), abs=1e-6)


def test_fine_primitives_and_those_of_a_stated_error_are_not_moved() -> None:
    for scene in (Scene(robot="ur5e"), Scene(robot="ur5e", detail="coarse", surface_error=0.004)):
        cells = build_constants(scene).deviations
        assert not cells.displacement.any()
        assert cells.largest_displacement == 0.0


def test_a_force_through_the_centre_of_a_cell_enters_there(constants: Constants) -> None:
    """Its distance and its inclination are zero there, and nowhere else."""
    cells = constants.deviations
    for p in range(len(constants.surfaces.kind)):
        for i in range(cells.start[p], cells.start[p + 1]):
            force = -20.0 * cells.mean_normal[i]
            wrench = np.concatenate((force, np.cross(cells.mean_point[i], force)))
            # A moment about the line of action, such as torsion, does not move it.
            wrench[3:] += 0.01 * force
            assert entered_cell(cells, p, wrench, 0.25) == i


def test_a_force_does_not_enter_where_it_would_pull(constants: Constants) -> None:
    cells = constants.deviations
    rng = np.random.default_rng(3)
    for p in range(len(constants.surfaces.kind)):
        for _ in range(20):
            i = int(rng.integers(cells.start[p], cells.start[p + 1]))
            force = 20.0 * cells.mean_normal[i]
            wrench = np.concatenate((force, np.cross(cells.mean_point[i], force)))
            entered = int(entered_cell(cells, p, wrench, 0.25))
            push = -cells.mean_normal[cells.start[p] : cells.start[p + 1]] @ force / 20.0
            assert push.max() <= LEAST_PUSH or push[entered - cells.start[p]] > LEAST_PUSH


def test_without_force_there_is_a_cell_too(constants: Constants) -> None:
    assert entered_cell(constants.deviations, 0, np.zeros(6), 0.25) == 0


def test_samples_lie_on_the_mean_surface(constants: Constants) -> None:
    surfaces, cells = constants.surfaces, constants.deviations
    still = build_constants(Scene(robot="ur5e", detail="coarse", surface_error=0.004))
    for moved, before in ((constants.samples, still.samples), (constants.subsamples, still.subsamples)):
        np.testing.assert_array_equal(moved.primitive, before.primitive)
        for s, p in enumerate(moved.primitive):
            R, o = surfaces.rotation[p], surfaces.origin[p]
            start, end = R.T @ (before.point[s] - o), R.T @ (moved.point[s] - o)
            own = cells.point[cells.start[p] : cells.start[p + 1]]
            i = cells.start[p] + int(np.argmin(((own - start) ** 2).sum(axis=1)))
            back = cells.rotation[i].T @ (end - cells.translation[i])
            np.testing.assert_allclose(back, start, atol=1e-12)
            assert abs(project(surfaces.kind[p], surfaces.size[p], *back)[0]) < 1e-6
            np.testing.assert_allclose(
                moved.normal[s], R @ cells.rotation[i] @ R.T @ before.normal[s], atol=1e-12
            )


@pytest.mark.parametrize("detail", ["coarse", "fine"])
def test_samples_are_as_tilted_as_their_cells(detail: Literal["coarse", "fine"]) -> None:
    constants = build_constants(Scene(robot="ur5e", detail=detail))
    still = build_constants(Scene(robot="ur5e", detail=detail, surface_error=0.004))
    surfaces, cells = constants.surfaces, constants.deviations
    for samples, before in ((constants.samples, still.samples), (constants.subsamples, still.subsamples)):
        assert not before.tilt.any()
        for s, p in enumerate(samples.primitive):
            local = surfaces.rotation[p].T @ (before.point[s] - surfaces.origin[p])
            own = slice(cells.start[p], cells.start[p + 1])
            assert (
                samples.tilt[s] == cells.tilt[own][np.linalg.norm(cells.point[own] - local, axis=1).argmin()]
            )
        assert len(np.unique(samples.tilt)) > 10


@kernel
def _mean_frame(buffers: Buffers, p: int, i: int, rotation: np.ndarray, origin: np.ndarray) -> None:
    constants, state = buffer_views(buffers)
    R, o = mean_frame(PlacedSurface(constants.surfaces, constants.deviations, state.frames), p, i)
    for k in range(3):
        origin[k] = o[k]
        for j in range(3):
            rotation[k, j] = R[k, j]


@pytest.mark.parametrize("detail", ["coarse", "fine"])
def test_the_frame_of_a_primitive_is_moved_with_its_link(detail: str) -> None:
    localizer = Localizer(Scene(robot="ur5e", detail=detail))  # type: ignore[arg-type]
    localizer.locate(np.array([0.2, -1.1, 1.3, -0.8, -1.2, 0.5]), base_wrench=np.ones(6), external=True)
    buffers = localizer._buffers
    cells, frames = buffers.constants.deviations, buffers.state.frames
    rotation, origin = np.empty((3, 3)), np.empty(3)
    for p in range(len(buffers.constants.surfaces.kind)):
        for i in range(cells.start[p], cells.start[p + 1]):
            _mean_frame(buffers.arguments, p, i, rotation, origin)
            R, o = frames.rotation[p], frames.origin[p]
            if detail == "coarse":
                R, o = R @ cells.rotation[i], R @ cells.translation[i] + o
            np.testing.assert_allclose(rotation, R, atol=1e-14)
            np.testing.assert_allclose(origin, o, atol=1e-14)


def _pushed(cells: DeviationCells, i: int, R: np.ndarray, o: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The point at the centre of cell i and the wrench of a push there, base frame; R, o: body frame."""
    point, force = R @ cells.mean_point[i] + o, R @ (-20.0 * cells.mean_normal[i])
    return point, np.concatenate((force, np.cross(point, force)))


@pytest.mark.parametrize(("force_noise", "moment_noise"), [(0.002, 0.0004), (1.0, 0.4)])
def test_a_push_on_a_housing_far_from_its_primitive_is_found_there(
    force_noise: float, moment_noise: float
) -> None:
    """Places 5 mm and more above the primitives. With little noise the line of action is known; with more
    noise the whole surface is searched."""
    noise = WrenchSensor(force_noise=force_noise, moment_noise=moment_noise)
    localizer = Localizer(Scene(robot="ur5e", detail="coarse", base_wrench=noise))
    q = np.array([0.2, -1.1, 1.3, -0.8, -1.2, 0.5])
    localizer.locate(q, base_wrench=np.ones(6), external=True)
    constants, state = localizer._buffers.constants, localizer._buffers.state
    forward_kinematics(constants.model, q, state.motion)
    surfaces, cells = constants.surfaces, constants.deviations
    right, errors = [], []
    for p in range(len(surfaces.kind)):
        body = constants.sensors.depth[surfaces.link[p]]
        link = state.motion.rotation[body], state.motion.origin[body]
        R, o = link[0] @ surfaces.rotation[p], link[0] @ surfaces.origin[p] + link[1]
        for i in range(cells.start[p], cells.start[p + 1]):
            rise = project(surfaces.kind[p], surfaces.size[p], *cells.mean_point[i])[0]
            if rise < 0.005:
                continue
            point, wrench = _pushed(cells, i, R, o)
            found = localizer.locate(q, base_wrench=wrench, external=True)
            right.append(bool(found.contacts) and found.contacts[0].link_index == surfaces.link[p])
            if right[-1]:
                errors.append(np.linalg.norm(found.contacts[0].point_base - point))
    assert len(right) > 10
    assert np.mean(right) > 0.8
    # What one standard deviation of the moment moves the line of 20 N.
    assert np.median(errors) < 1e-4 + moment_noise / 20.0
