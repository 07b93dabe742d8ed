"""A dataset in segments: the same contacts wherever it is cut, whoever works on it, however often it is
begun."""

import json
import os
import signal
import time
from dataclasses import replace
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pa_parquet
import pytest
from click.testing import CliRunner

from contactsense.benchmarks.fleet.dataset import (
    COULOMB,
    bias_drift,
    friction_drift,
    make_recording,
    plan,
    write_scenes,
)
from contactsense.scene import Scene
from contactsense.service.analysis.fleet.report import _text, _when, write_fleet_report
from contactsense.service.analysis.fleet.run import analyze_fleet
from contactsense.service.analysis.fleet.summary import RobotSummary
from contactsense.service.analysis.fleet.worker_pool import WorkerPoolError, run_tasks
from contactsense.service.cli.analyze import analyze
from contactsense.service.recordings.metadata import metadata, scene_hash
from tests.service.analysis.datasets import carrying, dataset
from tests.service.analysis.recordings import demo, write_motion


def _work(task: tuple[int, Path]) -> int:
    """Takes a moment; leaves its process id behind."""
    number, folder = task
    (folder / f"{number}-{os.getpid()}").touch()
    time.sleep(0.3)
    if number < 0:
        raise ValueError("negative")
    return number * number


@pytest.mark.long
def test_any_cut_gives_the_same_contacts(tmp_path: Path, scene: Path) -> None:
    write_motion(demo(), tmp_path / "one.parquet", rounds=6)
    files = (tmp_path / "one.parquet",)
    whole = analyze_fleet(files, scene, tmp_path / "whole").contacts.to_pylist()
    assert len(whole) == 48
    for length in (31.0, 61.7):
        cut = analyze_fleet(files, scene, tmp_path / f"{length}", length=length).contacts.to_pylist()
        assert [one["link"] for one in cut] == [one["link"] for one in whole]
        assert [one["contact"] for one in cut] == list(range(1, 49))
        for one, other in zip(cut, whole, strict=True):
            assert one["begin"] == pytest.approx(other["begin"], abs=0.01)
            assert one["peak_force"] == pytest.approx(other["peak_force"], rel=0.02)
            for axis in "xyz":
                std = other[f"covariance_{axis * 2}"] ** 0.5
                assert one[f"point_{axis}"] == pytest.approx(other[f"point_{axis}"], abs=std + 1e-4)


@pytest.mark.slow
def test_a_clock_that_is_set_back_loses_no_contacts_and_no_time(tmp_path: Path, scene: Path) -> None:
    """Gaps count as no hours, and no hours are negative."""
    write_motion(demo(), tmp_path / "one.parquet", rounds=3)
    table = pa_parquet.read_table(tmp_path / "one.parquet")
    t = table["timestamp"].to_numpy()
    # Set back by more than the whole recording, then two hours of silence.
    t = t + np.where(t < 40.0, 5000.0, np.where(t < 53.0, 0.0, 7200.0))
    table = table.set_column(0, "timestamp", [t])
    pa_parquet.write_table(table, tmp_path / "one.parquet", row_group_size=5000)
    for length in (30.0, 600.0):
        found = analyze_fleet((tmp_path / "one.parquet",), scene, tmp_path / f"{length}", length=length)
        assert found.contacts.num_rows == 24
        (robot,) = found.robots
        assert robot.hours == pytest.approx(3 * 26.0 / 3600.0, rel=0.01)
        assert robot.contacts_per_hour == pytest.approx(24.0 / robot.hours)


@pytest.mark.slow
def test_results_do_not_depend_on_the_workers_and_are_not_made_twice(tmp_path: Path, scene: Path) -> None:
    data = dataset(tmp_path / "data")
    one = analyze_fleet((data,), scene, tmp_path / "one")
    assert one.skipped == 1
    (told,) = [text for text in one.problems if "two.parquet" in text]
    assert told.startswith("robot="), "its whole path on this computer"
    assert [(robot.robot, robot.recordings, robot.contacts) for robot in one.robots] == [
        ("a", 2, 16),
        ("b", 1, 8),
    ]
    parts = {path: path.stat().st_mtime_ns for path in (tmp_path / "one" / "parts").rglob("*.json")}
    assert len(parts) == 4
    next(iter(parts)).unlink()
    again = analyze_fleet((data,), scene, tmp_path / "one")
    assert again.contacts.equals(one.contacts)
    unchanged = [path for path, stamp in parts.items() if path.stat().st_mtime_ns == stamp]
    assert len(unchanged) == 3
    written = pa_parquet.read_table(tmp_path / "one" / "contacts")
    assert written.num_rows == 24
    assert set(written["robot"].to_pylist()) == {"a", "b"}


@pytest.mark.slow
def test_worker_processes_give_what_one_gives(tmp_path: Path, scene: Path) -> None:
    data = dataset(tmp_path / "data")
    one = analyze_fleet((data,), scene, tmp_path / "one")
    two = analyze_fleet((data,), scene, tmp_path / "two", workers=2)
    assert two.contacts.equals(one.contacts)


@pytest.mark.long
def test_two_of_four_workers_may_be_killed(tmp_path: Path) -> None:
    tasks = [(i, tmp_path) for i in range(24)]
    killed: set[int] = set()
    results = {}
    for task, result in run_tasks(_work, tasks, workers=4):
        results[task[0]] = result
        for path in sorted(tmp_path.iterdir()):
            pid = int(path.name.rsplit("-", 1)[1])
            if len(killed) < 2 and pid not in killed:
                killed.add(pid)
                os.kill(pid, signal.SIGKILL)
    assert len(killed) == 2
    assert results == {i: i * i for i in range(24)}


def _kill_oneself(task: int) -> int:
    if task == 1:
        os.kill(os.getpid(), signal.SIGKILL)
    return task


@pytest.mark.long
def test_a_task_that_kills_its_workers_is_given_up_and_the_others_are_done() -> None:
    results = dict(run_tasks(_kill_oneself, [0, 1, 2, 3], workers=2))
    assert isinstance(results.pop(1), WorkerPoolError)
    assert results == {0: 0, 2: 2, 3: 3}


@pytest.mark.slow
def test_an_error_is_a_result(tmp_path: Path) -> None:
    tasks = [(-1, tmp_path), (2, tmp_path)]
    for workers in (1, 2):
        results = {task[0]: result for task, result in run_tasks(_work, tasks, workers)}
        assert isinstance(results[-1], ValueError)
        assert results[2] == 4


@pytest.mark.slow
def test_a_dask_cluster_does_the_same(tmp_path: Path) -> None:
    distributed = pytest.importorskip("distributed")
    with distributed.LocalCluster(
        n_workers=1, threads_per_worker=1, processes=False, host="127.0.0.1", dashboard_address=None,
        scheduler_port=0, protocol="tcp",
    ) as cluster:  # fmt: skip
        tasks = [(i, tmp_path) for i in range(4)]
        results = {task[0]: r for task, r in run_tasks(_work, tasks, scheduler=cluster.scheduler_address)}
    assert results == {i: i * i for i in range(4)}


@pytest.mark.slow
def test_the_command_reports_what_was_skipped(tmp_path: Path, scene: Path) -> None:
    data = dataset(tmp_path / "data")
    result = CliRunner().invoke(
        analyze, [str(data), "--scene", str(scene), "--out", str(tmp_path / "out"), "--json"]
    )
    assert result.exit_code == 1
    found = json.loads(result.stdout)
    assert [robot["robot"] for robot in found["robots"]] == ["a", "b"]
    assert found["contacts"] == 24
    assert not any(robot["needs_calibration"] for robot in found["robots"])
    text = (tmp_path / "out" / "fleet.html").read_text()
    assert "http" not in text
    assert (tmp_path / "out" / "fleet.md").read_text().startswith("# Contacts of a fleet")


def test_a_robot_without_a_usable_sample_is_unknown(tmp_path: Path, scene: Path) -> None:
    data = tmp_path / "data"
    for robot in "ab":
        (data / f"robot={robot}" / "date=2026-01-01").mkdir(parents=True)
        write_motion(demo(), data / f"robot={robot}" / "date=2026-01-01" / "one.parquet", last=500)
    wrong = data / "robot=b" / "date=2026-01-01" / "one.parquet"
    table = pa_parquet.read_table(wrong)
    for name in (f"actual_q_{i}" for i in range(6)):
        degrees = np.degrees(table[name].to_numpy())
        table = table.set_column(table.column_names.index(name), name, [degrees])
    pa_parquet.write_table(table, wrong)
    out = tmp_path / "out"
    # The second run takes the segments from the first one's files.
    for _ in range(2):
        result = CliRunner().invoke(analyze, [str(data), "--scene", str(scene), "--out", str(out), "--json"])
        assert result.exit_code == 1
        assert "robot=b/date=2026-01-01/one.parquet: no sample could be used" in result.stderr
        found = json.loads(result.stdout)
        assert found["unjudged"] == ["robot=b/date=2026-01-01/one.parquet"]
        good, bad = found["robots"]
        assert good["residual_ratio"] > 0.0
        assert bad["residual_ratio"] is bad["needs_calibration"] is None
        assert bad["base_bias_drift"] == [None] * 6
        assert bad["hours"] == 0.0
        assert bad["contacts_per_hour"] is bad["touched"] is bad["degraded"] is None
        assert good["touched"] is not None
    for name in ("fleet.md", "fleet.html"):
        text = (out / name).read_text()
        assert "unknown" in text
        assert "one.parquet: no sample could be used" in text
    row = pa_parquet.read_table(out / "robots.parquet").to_pylist()[1]
    assert row["needs_calibration"] is None


def test_a_robot_whose_files_are_broken_is_listed(tmp_path: Path, scene: Path) -> None:
    data, out = tmp_path / "data", tmp_path / "out"
    carrying(data, "a", Scene(robot="ur5e"))
    carrying(data, "b", None)
    arguments = [str(data), "--scene", str(scene), "--out", str(out), "--json"]
    result = CliRunner().invoke(analyze, arguments)
    assert result.exit_code == 1
    _, bad = json.loads(result.stdout)["robots"]
    assert (bad["robot"], bad["recordings"], bad["hours"], bad["touched"]) == ("b", 0, 0.0, None)
    assert bad["needs_calibration"] is bad["contacts_per_hour"] is None
    assert bad["coulomb_drift"] == [None] * 6
    written = pa_parquet.read_table(out / "robots.parquet")
    assert written["robot"].to_pylist() == ["a", "b"]
    assert written.schema.field("touched").type == pa.float64()
    text = (out / "fleet.md").read_text()
    assert "2 robots, 1 recording of unknown date, " in text
    assert "| b | 0 | 0.00 | 0 | unknown | unknown | unknown |" in text


def test_a_robot_without_a_name_has_the_same_one_everywhere(tmp_path: Path, scene: Path) -> None:
    path = write_motion(demo(), tmp_path / "one.parquet", last=2300)
    out = tmp_path / "out"
    arguments = [str(path), "--scene", str(scene), "--out", str(out), "--workers", "1", "--json"]
    result = CliRunner().invoke(analyze, arguments)
    assert result.exit_code == 0, result.output
    assert [robot["robot"] for robot in json.loads(result.stdout)["robots"]] == ["unknown"]
    for name in ("contacts", "robots.parquet", "days.parquet"):
        table = pa_parquet.read_table(out / name)
        assert set(table["robot"].to_pylist()) == {"unknown"}
        assert "date" not in table.column_names or set(table["date"].to_pylist()) == {"unknown"}


@pytest.mark.slow
def test_a_damaged_result_of_an_earlier_run_is_made_again(tmp_path: Path, scene: Path) -> None:
    """As a power cut leaves it; the files are in place, empty or cut."""
    path, out = write_motion(demo(), tmp_path / "one.parquet", last=2300), tmp_path / "out"
    before = analyze_fleet((path,), scene, out).contacts
    for ending, content in (("json", b'{"sec'), ("json", b""), ("parquet", b"PAR1"), ("parquet", None)):
        (part,) = (out / "parts").rglob(f"*.{ending}")
        part.unlink() if content is None else part.write_bytes(content)
        assert analyze_fleet((path,), scene, out).contacts.equals(before)


@pytest.mark.parametrize(
    ("dates", "words"),
    [
        ({"2026-01-01"}, " on 1 day"),
        ({"2026-01-01", "2026-01-02", "unknown"}, " on 2 days and of unknown date"),
        ({"unknown"}, " of unknown date"),
        (set(), ""),
    ],
)
def test_an_unknown_date_is_no_day(dates: set[str], words: str) -> None:
    assert _when(dates) == words


def test_segments_without_a_usable_sample_do_not_lower_the_residual() -> None:
    robot = RobotSummary("a", Scene(robot="ur5e"))
    robot.free = [100, 0, 0]
    robot.base_ratio = [[2.0] * 6, [0.0] * 6, [0.0] * 6]
    robot.joint_ratio = [[1.0] * 6, [0.0] * 6, [0.0] * 6]
    assert robot.worst_ratio() == 2.0
    assert robot.needs_calibration() is True


@pytest.mark.slow
def test_recordings_without_a_sensor_do_not_lower_its_residual(tmp_path: Path, scene: Path) -> None:
    """A base sensor with more noise than stated, in the one recording of three that has it."""
    base = [f"base_wrench_{i}" for i in range(6)]
    here = tmp_path / "robot=a"
    here.mkdir()
    table = pa_parquet.read_table(write_motion(demo(), here / "0.parquet", last=1000))
    lacking, noise = table.drop_columns(base), np.random.default_rng(0).standard_normal(len(table))
    for column in base:
        noisy = table[column].to_numpy() + noise
        table = table.set_column(table.column_names.index(column), column, [noisy])
    pa_parquet.write_table(table, here / "0.parquet")
    found = []
    for count in (1, 3):
        for number in range(1, count):
            pa_parquet.write_table(lacking, here / f"{number}.parquet")
        arguments = [str(here), "--scene", str(scene), "--out", str(tmp_path / f"out{count}"), "--json"]
        (robot,) = json.loads(CliRunner().invoke(analyze, arguments).stdout)["robots"]
        assert robot["recordings"] == count
        found.append(robot["residual_ratio"])
    assert found[1] == found[0] > 1.3


def test_a_sensor_without_a_single_reading_is_one_that_the_recording_lacks(
    tmp_path: Path, scene: Path
) -> None:
    """As in the analysis of that recording alone; every estimate was degraded and nothing known of the
    model."""
    base = [f"base_wrench_{i}" for i in range(6)]
    found = {}
    for name in ("lacking", "silent"):
        here = tmp_path / name / "robot=a"
        here.mkdir(parents=True)
        table = pa_parquet.read_table(write_motion(demo(), here / "one.parquet", last=2300)).drop_columns(
            base
        )
        if name == "silent":
            for column in base:
                table = table.append_column(column, pa.array(np.full(len(table), np.nan)))
        pa_parquet.write_table(table, here / "one.parquet")
        arguments = [str(tmp_path / name), "--scene", str(scene), "--out", str(tmp_path / "out" / name)]
        found[name] = json.loads(CliRunner().invoke(analyze, [*arguments, "--json"]).stdout)
    assert found["silent"]["robots"] == found["lacking"]["robots"]
    assert found["silent"]["robots"][0]["degraded"] < 0.1
    assert found["silent"]["undetermined_forces"] == found["lacking"]["undetermined_forces"] != []


def test_what_the_recorder_wrote_is_a_dataset(tmp_path: Path) -> None:
    table = pa_parquet.read_table(write_motion(demo(), tmp_path / "demo.parquet", last=2300))
    folder = tmp_path / "recordings"
    folder.mkdir()
    scene = Scene(robot="ur5e", clear=0.9)
    pa_parquet.write_table(
        table.replace_schema_metadata(metadata(scene)), folder / "samples-20260101T000000-0000.parquet"
    )
    pa_parquet.write_table(table.select(["base_wrench_0"]), folder / "wrench-20260101T000000-0000.parquet")
    result = CliRunner().invoke(analyze, [str(folder), "--out", str(tmp_path / "out"), "--json"])
    assert result.exit_code == 0, result.output
    assert json.loads(result.stdout)["contacts"] == 1
    assert scene_hash(Scene.load(tmp_path / "out" / "scenes" / "unknown.yaml")) == scene_hash(scene)


@pytest.mark.slow
def test_drift_of_friction_and_bias_is_reported(tmp_path: Path) -> None:
    data = tmp_path / "data"
    write_scenes(data, 10)
    for task in plan(data, 10, 1, 16.0):
        make_recording(replace(task, robot=9, number=100 + task.number))
    found = analyze_fleet((data,), None, tmp_path / "out")
    write_fleet_report(found, tmp_path / "out")
    (row,) = pa_parquet.read_table(tmp_path / "out" / "robots.parquet").to_pylist()
    # 0.8 Nm at the first joint; from day to day 2 % of 6 Nm come and go.
    truth = np.array(COULOMB) * friction_drift(9)
    np.testing.assert_allclose(row["coulomb_drift"], truth, atol=0.3)
    assert row["coulomb_drift"][0] > 0.5
    np.testing.assert_allclose(row["joint_bias_drift"], bias_drift(9)[1], atol=0.1)
    days = pa_parquet.read_table(tmp_path / "out" / "days.parquet").to_pylist()
    assert len(days) == 10
    assert (days[0]["date"], days[-1]["date"]) == ("2025-01-01", "2025-12-31")
    assert len(days[0]["coulomb"]) == 6
    text = (tmp_path / "out" / "fleet.html").read_text()
    assert "Coulomb friction of arm09 beyond the scene" in text
    assert "friction drift" in (tmp_path / "out" / "fleet.md").read_text()


def test_a_drift_that_is_rounded_to_zero_has_no_minus() -> None:
    assert [_text(value, "N") for value in (-0.001, -0.006, None)] == ["+0.00 N", "-0.01 N", "unknown"]
