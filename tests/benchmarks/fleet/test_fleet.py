"""A simulated year of a fleet: what is made, and how it is compared with what was found."""

import json
from pathlib import Path

import pyarrow as pa
import pyarrow.parquet as pa_parquet
import pytest
from click.testing import CliRunner

from contactsense.benchmarks.fleet.command import fleet
from contactsense.benchmarks.fleet.dataset import BROKEN_EVERY, make_recording, plan, write_scenes
from contactsense.benchmarks.fleet.score import score_contacts
from contactsense.service.recordings import RecordingError, read


def test_recordings_are_spread_over_robots_and_days() -> None:
    tasks = plan(Path("data"), 40, 4, 30.0)
    assert len({task.name for task in tasks}) == 40
    assert tasks[0].name == "robot=arm00/date=2025-01-01/000000.parquet"
    assert tasks[-1].name == "robot=arm03/date=2025-12-31/000039.parquet"
    assert [task.year for task in tasks if task.robot == 2] == pytest.approx([i / 9 for i in range(10)])


def test_broken_recordings_cannot_be_read_and_count_no_contacts(tmp_path: Path) -> None:
    tasks = [task for task in plan(tmp_path, 3 * BROKEN_EVERY, 1, 8.0) if task.broken]
    assert len(tasks) == 3
    write_scenes(tmp_path, 1)
    for task in tasks:
        assert make_recording(task) == []
        with pytest.raises(RecordingError):
            read(tmp_path / task.name)


def _found(**columns: list[object]) -> pa.Table:
    count = len(columns["begin"])
    whole = {"robot": ["a"] * count, "peak_force": [20.0] * count, "duration": [1.0] * count, **columns}
    return pa.table(whole | {f"point_{axis}": [0.0] * count for axis in "xyz"})


def test_contacts_are_matched_in_time_and_within_their_recording() -> None:
    made = [
        {"recording": "one", "link": "forearm", "begin": 5.0, "end": 6.0, "force": 25.0,
         "point": [0.0, 0.003, 0.004]},
        {"recording": "one", "link": "forearm", "begin": 15.0, "end": 16.0, "force": 20.0,
         "point": [0.0, 0.0, 0.0]},
        {"recording": "two", "link": "base", "begin": 5.0, "end": 6.0, "force": 20.0,
         "point": [0.0, 0.0, 0.0]},
    ]  # fmt: skip
    found = _found(
        recording=["one", "one", "one", "one", "three"],
        begin=[5.1, 5.9, 9.0, 16.1, 5.0],
        peak_force=[20.0, 3.0, 20.0, 20.0, 20.0],
        link=["forearm", "base", "base", "upper_arm", "base"],
    )
    score = score_contacts(made, found)
    assert (score["made"], score["found"], score["false"], score["split"]) == (3, 2, 2, 1)
    assert score["false_by_robot"] == {"a": 2}
    assert score["link_right"] == 0.5
    assert score["median_mm"] == pytest.approx(5.0)
    assert score["force_error"] == pytest.approx(0.1)


def test_a_dataset_in_which_nothing_was_found() -> None:
    made = [{"recording": "one", "link": "base", "begin": 0.0, "end": 1.0, "force": 9.0, "point": [0, 0, 0]}]
    score = score_contacts(made, _found(recording=[], begin=[], link=[]))
    assert (score["found"], score["false"], score["link_right"], score["median_mm"]) == (0, 0, 0.0, None)


@pytest.mark.slow
@pytest.mark.parametrize("as_json", [True, False])
def test_the_command_finds_what_it_made(tmp_path: Path, as_json: bool) -> None:
    options = [
        "--recordings",
        "4",
        "--robots",
        "1",
        "--seconds",
        "14",
        "--workers",
        "1",
        "--out",
        str(tmp_path),
    ]
    result = CliRunner().invoke(fleet, [*options, "--json"] if as_json else options)
    assert result.exit_code == 0, result.output
    made = pa_parquet.read_table(tmp_path / "truth.parquet").num_rows
    assert made > 0
    if not as_json:
        assert f"contacts: {made} made, {made} found, 0 false" in result.output
        assert "100000 recordings would take" in result.output
        return
    found = json.loads(result.stdout)
    assert (found["made"], found["found"], found["false"]) == (made, made, 0)
    assert found["median_mm"] < 5.0
    assert found["drift"][0]["robot"] == "arm00"
    assert (tmp_path / "results" / "fleet.html").exists()
