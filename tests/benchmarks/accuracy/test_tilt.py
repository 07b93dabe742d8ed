"""The benchmark of contacts whose surface is tilted from the primitives: its angles and its counts."""

import json
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner

from contactsense.benchmarks.accuracy.calibration import Verdict
from contactsense.benchmarks.accuracy.tilt import FORCE_BINS, TILT_BINS, Angles, angles, count, tilt
from contactsense.benchmarks.static_truth.cases import COLUMNS
from contactsense.benchmarks.static_truth.points import read
from tests.shared import shared

INSIDE = Verdict((1.0, True, 1.0), (1.0, True, 1.0), (1.0, True, 1.0), True, True, 1.0)


def test_each_contact_is_counted_once_for_each_angle() -> None:
    found = Angles(np.array([0.0, 30.0, 180.0]), np.array([14.9, 90.0, 180.0]))
    bins = count(found, [INSIDE, None, INSIDE._replace(in_region=False)], COLUMNS[0])
    counted = {(b.angle, b.low, b.high): (b.contacts, b.no_answer, b.in_region) for b in bins if b.contacts}
    assert counted == {
        ("tilt", 0, 10): (1, 0, 1),
        ("tilt", 30, 45): (1, 1, 0),
        ("tilt", 60, 180): (1, 0, 0),
        ("force", 0, 15): (1, 0, 1),
        ("force", 90, 180): (2, 1, 0),
    }
    assert len(bins) == len(TILT_BINS) + len(FORCE_BINS) - 2


def test_the_force_is_in_the_friction_cone_of_the_real_normal() -> None:
    """The angles between force, real normal and primitive obey the triangle inequality with the friction of
    the contacts, 0.5 at most; so frames and signs agree."""
    folder = shared("truth")
    found = angles(folder, read(folder, "ur5e"))
    assert np.all(np.abs(found.force - found.tilt) <= np.degrees(np.arctan(0.5)) + 1e-6)
    assert np.median(found.tilt) < 3.0


@pytest.mark.slow
def test_every_exact_contact_has_an_answer() -> None:
    """Also those whose force is tangential to the primitive, or pulls on it."""
    folder = str(shared("truth"))
    done = CliRunner().invoke(tilt, [folder, "--robot", "ur10e", "--json"], catch_exceptions=False)
    exact = [b for b in json.loads(done.stdout)["results"] if b["noise"]["torque"] == 0.0]
    force = [b for b in exact if b["angle"] == "force"]
    assert sum(b["contacts"] for b in force if b["high"] <= 45) > 1800
    assert sum(b["contacts"] for b in force if b["low"] >= 60) > 10
    assert [b["no_answer"] for b in force] == [0] * len(force)


def test_an_array_that_is_missing_is_named(tmp_path: Path) -> None:
    with np.load(shared("truth/static_points_ur5e.npz")) as data:
        np.savez(tmp_path / "static_points_ur5e.npz", **{k: v for k, v in data.items() if k != "n_link"})
    done = CliRunner().invoke(tilt, [str(tmp_path)])
    assert done.exit_code == 1
    assert "expected the array 'n_link'" in done.output


@pytest.mark.parametrize("option", [["--sensors", "torques"], ["--detail", "skin"]])
def test_what_it_cannot_measure_is_refused(option: list[str], tmp_path: Path) -> None:
    done = CliRunner().invoke(tilt, [str(tmp_path), *option])
    assert done.exit_code == 2
    assert option[0] in done.output
