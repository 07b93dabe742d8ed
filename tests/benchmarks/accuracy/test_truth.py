"""The truth benchmark: its figures against the design's, its counting, its complaints."""

import json
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner

from contactsense.benchmarks.accuracy.truth import measure, truth
from contactsense.benchmarks.static_truth.cases import COLUMNS
from contactsense.benchmarks.static_truth.points import read
from tests.shared import shared

LINK_RIGHT = (0.97, 0.85, 0.79, 0.65)
"""Least share of links that are right in each noise column: 97 % without noise, then 8 points below what the
evidence of all sensors allows."""


@pytest.mark.parametrize("robot", ["ur5e", "ur10e"])
@pytest.mark.parametrize(("noise", "least"), list(zip(COLUMNS, LINK_RIGHT, strict=True)))
def test_links_and_places_on_ground_truth(robot: str, noise: tuple[float, ...], least: float) -> None:
    folder = shared("truth")
    result = measure(read(folder, robot), noise)
    assert result["link_right"] >= least
    if noise == COLUMNS[0]:
        assert result["error_mm"]["median"] <= 10.0
        assert result["listed"] >= 0.99
    assert np.sum(result["confusion"]) == result["samples"] == 2000


def test_the_torques_alone_decide_the_link_for_less_than_half_of_the_contacts() -> None:
    """The last joint that measures anything is the right one for 44 of 100 contacts on the UR5e at ordinary
    noise; jointly with the base sensor far more."""
    points = read(shared("truth"), "ur5e")
    alone = measure(points, COLUMNS[2], "torques_first")
    assert alone["link_right"] == pytest.approx(0.44, abs=0.03)


def test_json_is_the_table_for_programs(tmp_path: Path) -> None:
    with np.load(shared("truth/static_points_ur5e.npz")) as data:
        rows = {
            key: value[:50] if value.ndim and len(value) == 2000 else value for key, value in data.items()
        }
    np.savez(tmp_path / "static_points_ur5e.npz", **rows)
    done = CliRunner().invoke(truth, [str(tmp_path), "--robot", "ur5e", "--json"], catch_exceptions=False)
    assert done.exit_code == 0
    results = json.loads(done.stdout)["results"]
    assert [r["noise"]["torque"] for r in results] == [0.0, 0.3, 1.0, 3.0]
    assert all(r["robot"] == "ur5e" for r in results)


def test_a_missing_file_is_named(tmp_path: Path) -> None:
    done = CliRunner().invoke(truth, [str(tmp_path), "--robot", "ur5e"])
    assert done.exit_code == 1
    assert "static_points_ur5e.npz: cannot read ground truth" in done.output


def test_a_missing_array_is_named(tmp_path: Path) -> None:
    np.savez(tmp_path / "static_points_ur5e.npz", q=np.zeros((1, 6)))
    done = CliRunner().invoke(truth, [str(tmp_path), "--robot", "ur5e"])
    assert done.exit_code == 1
    assert "expected the array 'tau'" in done.output
