"""Growth of the time of one answer: the arms, their contacts, the fit, table and picture."""

import io
from pathlib import Path

import numpy as np
import pytest
from rich.console import Console

from contactsense.benchmarks.growth import LENGTH, NOISE, Point, chain, draw, slope, table, touches
from contactsense.benchmarks.live.search_parts import Parts
from contactsense.benchmarks.live.search_parts import table as parts_table
from contactsense.robots.surface.convex_primitives import pack
from contactsense.robots.surface.union import distances


def test_a_divided_capsule_is_the_same_body() -> None:
    points = np.random.default_rng(1).uniform(-0.3, 0.3, (200, 3))
    whole, divided = (pack(chain(4, pieces).links) for pieces in (1, 5))
    np.testing.assert_array_equal(np.diff(divided.start)[1:], 5)
    for link in range(5):
        # Inside, a divided body is measured to its nearest piece.
        expected, found = (distances(surfaces, points, link)[0] for surfaces in (whole, divided))
        np.testing.assert_allclose(np.maximum(found, 0.0), np.maximum(expected, 0.0), atol=1e-12)


def test_joints_beyond_a_touch_measure_noise_only() -> None:
    robot = chain(6, 1)
    q, wrench, torque = touches(robot, 50, 1)
    assert q.shape == torque.shape == (50, 6)
    assert wrench.shape == (50, 6)
    # The last joint feels only touches of the last link.
    assert np.mean(np.abs(torque[:, -1]) < 4.0 * NOISE.torque) > 0.6
    assert np.all(np.linalg.norm(wrench[:, :3], axis=1) > 10.0)
    # The first joint's axis is the base's z: it measures the moment about it.
    np.testing.assert_allclose(torque[:, 0] + wrench[:, 5], 0.0, atol=5.0 * (NOISE.torque + NOISE.moment))
    total = sum(joint.translation[2] for joint in robot.joints[1:]) + LENGTH / 6
    assert total == pytest.approx(LENGTH)


def test_the_power_is_found_and_drawn(tmp_path: Path) -> None:
    points = [Point("links", number, 3.0 * number**0.7) for number in (3, 6, 12)]
    assert slope(points) == (pytest.approx(0.7), pytest.approx(3.0))
    picture = tmp_path / "growth.png"
    draw({"links": points}, picture)
    assert picture.stat().st_size > 10_000
    out = io.StringIO()
    Console(file=out, width=100).print(table({"links": points}))
    assert "number^0.70" in out.getvalue()


def test_a_part_without_samples_is_left_empty() -> None:
    out = io.StringIO()
    parts = Parts("ur5e", "torques", NOISE, 2.5, 0.0, 0.0, float("nan"), float("nan"), 100.0, 102.5)
    Console(file=out, width=118).print(parts_table([parts]))
    assert "102.5" in out.getvalue()
    assert "nan" not in out.getvalue()
