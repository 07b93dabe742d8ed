"""Problems of a recording in segments: those of all segments, each once, wherever it was cut."""

from pathlib import Path

import numpy as np
import pyarrow.parquet as pa_parquet
import pytest

from contactsense.service.analysis.fleet.run import analyze_fleet
from contactsense.service.analysis.fleet.segment_problems import RecordingProblems, own_problems
from contactsense.service.recordings.problems import Problem
from tests.service.analysis.recordings import demo, write_motion


def _lines(problems: list[Problem], cuts: list[int]) -> tuple[str, ...]:
    """What is said of a file whose segments begin at these rows."""
    found = RecordingProblems()
    for first, last in zip(cuts, [*cuts[1:], None], strict=True):
        found.add({"problems": own_problems(problems, first, last), "complaints": []})
    return found.lines()


def test_where_a_file_is_cut_does_not_change_what_is_said_of_it() -> None:
    missing = "base_wrench is missing or not finite"
    problems = [
        Problem(0, 0, "missing_sensor", "no column joint_torque_0"),
        Problem(5, 40, "not_finite", missing),
        Problem(45, 46, "not_finite", missing),
        *(Problem(i, i + 1, "gap", "a gap of 1.000 s before this row", 1.0) for i in (9, 10, 19)),
        Problem(50, 50, "cut_short", "the file ends within a batch"),
    ]
    whole = _lines(problems, [0])
    assert whole == (
        "no column joint_torque_0",
        "rows 5 to 39, 45 (2 places): base_wrench is missing or not finite",
        "rows 9, 10, 19 (3 places): a gap of 1.000 s before this row",
        "row 50: the file ends within a batch",
    )
    for cuts in ([0, 20], [0, 10, 20, 30, 40], [0, 5, 46]):
        assert sorted(_lines(problems, cuts)) == sorted(whole)


def test_a_field_is_complained_about_once() -> None:
    found = RecordingProblems()
    for value in (1, 2):
        found.add({"problems": [], "complaints": [f"q: expected rad, got {value}", "no free arm"]})
    assert found.lines() == ("q: expected rad, got 1", "no free arm")


@pytest.mark.slow
def test_problems_of_later_segments_are_reported(tmp_path: Path) -> None:
    """Joint torques that no arm has, and a gap, in the last third of a recording."""
    path = write_motion(demo(), tmp_path / "one.parquet", rounds=4)
    table = pa_parquet.read_table(path)
    late = np.arange(table.num_rows) >= 40_000
    table = table.set_column(0, "timestamp", [table["timestamp"].to_numpy() + 2.0 * late])
    for i in range(6):
        name, wrong = f"joint_torque_{i}", np.linspace(1e4, 2e4, table.num_rows)
        values = np.where(late, wrong, table[name].to_numpy())
        table = table.set_column(table.column_names.index(name), name, [values])
    pa_parquet.write_table(table, path)
    scene = tmp_path / "scene.yaml"
    scene.write_text("robot: ur5e\n")
    whole, cut = (
        analyze_fleet((path,), scene, tmp_path / f"{length}", length=length).problems
        for length in (600.0, 20.0)
    )
    gap, implausible = whole
    assert "row 40000: a gap of 2.002 s" in gap
    assert "expected at most 1.5 times the 150 Nm" in implausible
    assert cut == whole
