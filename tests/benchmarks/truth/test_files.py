"""What the files hold: places on the meshes, pushes within their bounds, motions without jumps."""

from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest

from contactsense.benchmarks.motion.streams import KINDS, read
from contactsense.benchmarks.static_truth.points import read as read_static
from contactsense.benchmarks.truth import arrays, motion, simulation, static_points
from contactsense.benchmarks.truth.arm import Arm
from contactsense.benchmarks.truth.arm import read as read_arm
from contactsense.benchmarks.truth.schedule import HOLD, IMPACT, SLIDE, pairs, singles
from tests.shared import truth

Arrays = dict[str, np.ndarray]


@pytest.fixture(scope="module")
def arm() -> Arm:
    return read_arm("ur5e")


@pytest.fixture(scope="module")
def static(arm: Arm) -> Arrays:
    return static_points.make(arm, 120, 1)


@pytest.fixture(scope="module")
def moving(arm: Arm) -> Arrays:
    """One fast run, and one of pairs."""
    return motion.make(arm, 4, 1)


def on_facets(arm: Arm, link: np.ndarray, point: np.ndarray, normal: np.ndarray) -> np.ndarray:
    """Distance of each point from the nearest facet with this normal that is above or below it [m]."""
    distance = np.empty(len(link))
    for i, (k, p, n) in enumerate(zip(link, point, normal, strict=True)):
        a, b, c = np.moveaxis(arm.links[k].vertices[arm.links[k].faces], 1, 0)
        across = np.cross(b - a, c - a)
        unit = across / np.linalg.norm(across, axis=1)[:, None]
        height = np.abs(((p - a) * unit).sum(axis=1))
        beside = np.max(
            [
                (np.cross(end - start, unit) * (p - start)).sum(axis=1) / np.linalg.norm(end - start, axis=1)
                for start, end in ((a, b), (b, c), (c, a))
            ],
            axis=0,
        )
        alike = unit @ n > 1.0 - 1e-6
        distance[i] = np.maximum(height, beside)[alike].min()
    return distance


@pytest.mark.slow
def test_static_contacts_lie_on_the_meshes(arm: Arm, static: Arrays) -> None:
    assert set(static["link"]) == set(range(7))
    some = slice(None, None, 3)
    normal = static["n_link"].astype(float)
    found = on_facets(arm, static["link"][some], static["c_link"][some], normal[some])
    assert found.max() < 2e-7
    origin, rotation = simulation.poses(simulation.dynamics(arm), static["q"])
    rows = np.arange(len(static["link"])), static["link"]
    there = origin[rows] + np.einsum("nij,nj->ni", rotation[rows], static["c_link"])
    np.testing.assert_allclose(there, static["c_base"], atol=1e-12)


def test_static_pushes_are_within_their_bounds(static: Arrays) -> None:
    along = -(static["f"] * static["n_base"]).sum(axis=1)
    np.testing.assert_allclose(along, static["fn"], atol=1e-4)
    assert along.min() >= 5.0 - 1e-4
    assert along.max() <= 60.0 + 1e-4
    across = np.linalg.norm(static["f"] + along[:, None] * static["n_base"], axis=1) / along
    assert across.max() <= 0.5 + 1e-5
    # Uniform over the disc: half of the draws lie outside 0.707 of its radius.
    assert np.mean(across > 0.5 * np.sqrt(0.5)) == pytest.approx(0.5, abs=0.15)
    assert np.median(np.log(along)) == pytest.approx(np.log(np.sqrt(5.0 * 60.0)), abs=0.4)
    assert (static["xi"][::2] == 0.0).all()
    assert (np.abs(static["xi"][1::2]) <= 0.005 * static["fn"][1::2] * (1.0 + 1e-5)).all()


def test_inputs_are_on_their_grids(static: Arrays) -> None:
    for name, step in (("q", arrays.POSITION), ("c_link", arrays.LENGTH), ("f", arrays.FORCE)):
        assert (static[name] / step == np.round(static[name] / step)).all(), name


@pytest.mark.slow
@pytest.mark.parametrize("suite", ["static_points", "motion"])
def test_arrays_are_those_of_the_given_files(static: Arrays, moving: Arrays, suite: str) -> None:
    given, made = truth(f"{suite}_ur5e.npz"), static if suite == "static_points" else moving
    assert set(given) == set(made)
    for name in set(given) - {"meta"}:
        assert (given[name].dtype, given[name].shape[1:]) == (made[name].dtype, made[name].shape[1:]), name


@pytest.mark.slow
def test_the_benchmarks_read_them(static: Arrays, moving: Arrays, tmp_path: Path) -> None:
    arrays.write(tmp_path / "static_points_ur5e.npz", static)
    arrays.write(tmp_path / "motion_ur5e.npz", moving)
    points = read_static(tmp_path, "ur5e")
    assert points.q.shape == (120, 6)
    assert points.gravity == pytest.approx(9.81)
    streams = read(tmp_path, "ur5e", "motion")
    assert [KINDS.index(stream.kind) for stream in streams] == moving["run_kind"].tolist()
    assert [stream.multi for stream in streams] == [False, False, False, True]
    assert [len(stream.t) for stream in streams] == [10000, 10000, 10000, 5000]
    assert all(4 <= len(stream.events) <= 6 for stream in streams)


def test_motions_are_smooth_and_as_fast_as_said(arm: Arm, moving: Arrays) -> None:
    for run, kind in enumerate(moving["run_kind"]):
        rows = moving["run"] == run
        q, qd, qdd = (moving[name][rows].astype(float) for name in ("q", "qd", "qdd"))
        np.testing.assert_allclose((q[2:] - q[:-2]) * arrays.RATE / 2.0, qd[1:-1], atol=1e-4)
        np.testing.assert_allclose((qd[2:] - qd[:-2]) * arrays.RATE / 2.0, qdd[1:-1], atol=1e-2)
        np.testing.assert_array_equal(qd[[0, -1]], 0.0)
        peak = np.abs(qd).max(axis=0) / arm.speeds
        low, high = {0: (0.0, 0.0), 1: (0.03, 0.12), 2: (0.3, 0.6)}[int(kind)]
        assert (peak >= low - 1e-6).all()
        assert (peak <= high + 1e-6).all()


def test_moving_contacts_lie_on_the_meshes(arm: Arm, moving: Arrays) -> None:
    """All along slides, which keep their speed over the surface until they stop."""
    for event in range(len(moving["ev_start"])):
        rows = slice(moving["ev_start"][event], moving["ev_stop"][event])
        slot, link = moving["ev_slot"][event], moving["ev_link"][event]
        assert moving["active"][rows, slot].all()
        assert (moving["link"][rows, slot] == link).all()
        points, normals = (moving[name][rows, slot].astype(float) for name in ("c_link", "n_link"))
        some = slice(None, None, 100)
        found = on_facets(arm, np.full(len(points[some]), link), points[some], normals[some])
        assert found.max() < 3e-7
        steps = np.linalg.norm(np.diff(points, axis=0), axis=1)
        if moving["ev_type"][event] == SLIDE:
            assert moving["ev_path"][event] >= 0.005
            assert steps.sum() == pytest.approx(moving["ev_path"][event], rel=0.05)
            assert steps.max() <= moving["ev_speed"][event] / arrays.RATE + 3e-7
            pushed = (moving["f"][rows, slot] * moving["n_base"][rows, slot]).sum(axis=1)
            assert (pushed < 0.0).all()
        else:
            assert steps.max() == 0.0
    untouched = ~moving["active"]
    assert (moving["link"][untouched] == -1).all()
    assert (moving["f"][untouched] == 0.0).all()


def test_a_slide_pulls_the_robot_along(arm: Arm, moving: Arrays) -> None:
    rotation = simulation.poses(simulation.dynamics(arm), moving["q"])[1]
    for event in np.flatnonzero(moving["ev_type"] == SLIDE):
        first, slot = moving["ev_start"][event] + 10, moving["ev_slot"][event]
        R = rotation[first, moving["ev_link"][event]]
        c = moving["c_link"][first - 5 : first + 5 : 9, slot]
        normal = moving["n_base"][first, slot]
        force = moving["f"][first, slot]
        pulled = force - (force @ normal) * normal
        moved = R @ (c[1] - c[0])
        assert pulled @ moved > 0.9 * np.linalg.norm(pulled) * np.linalg.norm(moved)
        assert np.linalg.norm(pulled) / -(force @ normal) == pytest.approx(moving["ev_mu"][event], rel=1e-3)


def test_runs_hold_what_they_promise() -> None:
    rng = np.random.default_rng(7)
    for _ in range(50):
        planned = singles(10000, rng)
        assert 4 <= len(planned) <= 6
        assert {SLIDE, IMPACT} <= {one.type for one in planned}
        assert planned[0].start >= 500
        assert planned[-1].stop <= 9900
        assert all(after.start - before.stop >= 150 for before, after in pairwise(planned))
        for one in planned:
            length = (one.stop - one.start) / 500.0
            assert length == pytest.approx(0.05) if one.type == IMPACT else 0.3 <= length <= 3.0
        paired = pairs(5000, rng)
        assert len(paired) in (4, 6)
        for first, second in zip(paired[::2], paired[1::2], strict=True):
            assert (first.slot, second.slot) == (0, 1)
            assert first.type in (HOLD, SLIDE)
            overlap = min(first.stop, second.stop) - second.start
            assert overlap >= min(150, second.stop - second.start)


def test_pairs_are_on_different_links(moving: Arrays) -> None:
    both = moving["active"].all(axis=1)
    assert both.any()
    assert moving["run_multi"][moving["run"][both]].all()
    assert (moving["link"][both, 0] != moving["link"][both, 1]).all()
