"""The law of holding: the error falls with the root of time, until what the model gets wrong is all that is
left; and a slide's trace."""

import json
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner

from contactsense import Localizer
from contactsense.benchmarks.hold.command import held, hold, slid, slide_summary, summary
from contactsense.benchmarks.hold.simulate import CASES, SLIDE, TIMES, Case, Finger, scene_of, stream
from contactsense.benchmarks.static_truth.cases import COLUMNS

RUNS = 8


@pytest.fixture(scope="module")
def finger() -> Finger:
    return Finger()


def _errors(case: Case, finger: Finger) -> tuple[np.ndarray, np.ndarray]:
    localizer = Localizer(scene_of(case))
    found = summary(np.array([held(localizer, case, finger, seed) for seed in range(RUNS)]))
    return np.array(found["error_mm"]), np.array(found["stated_mm"])


@pytest.mark.long
@pytest.mark.parametrize("case", CASES[:2], ids=lambda case: case.name)
def test_the_error_falls_with_the_root_of_time(case: Case, finger: Finger) -> None:
    error, stated = _errors(case, finger)
    late = np.array(TIMES) >= 0.1
    slope = np.polyfit(np.log(np.array(TIMES)[late]), np.log(error[late]), 1)[0]
    assert -0.7 < slope < -0.4
    # Two errors each in eight streams: chi-square with 16 degrees of freedom, 99.9 % within.
    assert ((0.2 * stated**2 < error**2) & (error**2 < 2.5 * stated**2)).all()


@pytest.mark.long
def test_masses_that_are_off_leave_an_error_that_is_stated(finger: Finger) -> None:
    exact, _ = _errors(CASES[1], finger)
    wrong, stated = _errors(CASES[2], finger)
    assert wrong[-1] > 1.3 * exact[-1]
    assert ((0.2 * stated**2 < wrong**2) & (wrong**2 < 2.5 * stated**2)).all()


def test_a_slide_is_reported_and_followed(finger: Finger) -> None:
    trace = slid(Localizer(scene_of(SLIDE)), finger)
    told = slide_summary(trace)
    assert told["median_mm"] < 4.0
    assert told["at_rest_mm"] < 1.0
    assert 0.0 < told["said_after_s"] < 0.4
    assert 0.0 < told["over_after_s"] < 0.7


def test_the_finger_is_on_the_surface_and_the_wrench_is_its_push(finger: Finger) -> None:
    quiet = stream(Case("rest"), finger, 0.2, 0, noise=COLUMNS[0])
    rows = [(s, p, since) for s, p, since in quiet]
    before, after = rows[400][0], rows[-1][0]
    assert before.base_wrench is not None
    assert after.base_wrench is not None
    w, point = after.base_wrench - before.base_wrench, rows[-1][1]
    assert np.linalg.norm(w[:3]) == pytest.approx(20.1, abs=0.3)
    np.testing.assert_allclose(w[3:], np.cross(point, w[:3]), atol=1e-9)


@pytest.mark.slow
def test_the_command_prints_and_draws(tmp_path: Path) -> None:
    path = tmp_path / "hold.png"
    result = CliRunner().invoke(hold, ["--runs", "1", "--picture", str(path), "--json"])
    assert result.exit_code == 0, result.output
    said = json.loads(result.stdout)
    assert set(said["held"]) == {case.name for case in CASES}
    assert all(len(row["error_mm"]) == len(TIMES) for row in said["held"].values())
    assert path.stat().st_size > 10_000
