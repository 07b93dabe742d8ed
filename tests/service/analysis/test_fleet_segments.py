"""Recordings that are found in a dataset, with robot and date, and the segments of each."""

import shutil
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pa_parquet
import pytest

from contactsense.scene import Scene
from contactsense.service.analysis.fleet.run import analyze_fleet
from contactsense.service.analysis.fleet.segments import find_recordings, segments
from contactsense.service.recordings.metadata import metadata
from tests.service.analysis.datasets import dataset
from tests.service.analysis.recordings import demo, write_motion


def test_recordings_and_their_place_in_the_dataset(tmp_path: Path) -> None:
    data = dataset(tmp_path)
    second = data / "robot=a" / "date=2026-01-02" / "one"
    second.with_suffix(".parquet").rename(second.with_suffix(".Parquet"))
    found = find_recordings((data,))
    assert next((file.name, file.robot, file.date) for file in found) == (
        "robot=a/date=2026-01-01/one.parquet", "a", "2026-01-01",
    )  # fmt: skip
    assert len(found) == 4
    with pytest.raises(FileNotFoundError, match="found none"):
        find_recordings((_empty(tmp_path),))


def test_the_folder_that_is_given_may_be_that_of_a_robot_or_day(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """As `robot=*` of a shell; other folders are not its, as where the working folder is another robot's."""
    data = dataset(tmp_path / "data")
    given = [(data / "robot=a", data / "robot=b"), (data / "robot=a" / "date=2026-01-02",)]
    found = [[(file.robot, file.date) for file in find_recordings(folders)] for folders in given]
    first, second = "2026-01-01", "2026-01-02"
    assert found == [[("a", first), ("a", second), ("b", first), ("b", first)], [("a", second)]]
    monkeypatch.chdir(data / "robot=a")
    (data.parent / "others").mkdir()
    (data.parent / "others" / "one.parquet").write_bytes(b"broken")
    assert [file.robot for file in find_recordings((Path("../../others"),))] == ["unknown"]


def test_results_belong_to_the_robot_that_the_folders_name_now(tmp_path: Path) -> None:
    path = tmp_path / "robot=a" / "runs" / "one.parquet"
    path.parent.mkdir(parents=True)
    write_motion(demo(), path, last=2300)
    (tmp_path / "scene.yaml").write_text("robot: ur5e\n")
    for name in ("a", "b"):
        folder = (tmp_path / "robot=a").rename(tmp_path / f"robot={name}") / "runs"
        summary = analyze_fleet((folder,), tmp_path / "scene.yaml", tmp_path / "out")
        assert [robot.robot for robot in summary.robots] == [name]
        assert set(summary.contacts["robot"].to_pylist()) == {name}


def test_a_recording_has_its_own_date_where_no_folder_names_one(tmp_path: Path) -> None:
    """That of UTC, as the names of its files; a conversion only has the time of the conversion."""
    created = {"contactsense.created": "2026-03-01T23:30:00-02:00"}
    made = metadata(Scene(robot="ur5e"), table="samples") | created
    described = {
        "robot=a/recorded.parquet": made,
        "robot=a/date=2026-01-01/moved.parquet": made,
        "robot=a/date=/unnamed.parquet": made,
        "robot=a/converted.parquet": metadata(Scene(robot="ur5e")) | created,
        "robot=a/damaged.parquet": made | {"contactsense.created": "yesterday"},
        "robot=a/other.parquet": {},
    }
    table = pa.table({"timestamp": [0.0, 0.002]})
    for name, meta in described.items():
        (tmp_path / name).parent.mkdir(parents=True, exist_ok=True)
        pa_parquet.write_table(table.replace_schema_metadata(meta), tmp_path / name)
    stream = tmp_path / "robot=a" / "killed.arrows"
    with (
        pa.OSFile(str(stream), "wb") as file,
        pa.ipc.new_stream(file, table.schema.with_metadata(made)) as unfinished,
    ):
        unfinished.write_table(table)
    (tmp_path / "robot=a" / "plain.csv").write_text("timestamp\n0\n")
    (tmp_path / "robot=a" / "broken.parquet").write_bytes(b"broken")
    found = {file.name.removeprefix("robot=a/"): file.date for file in find_recordings((tmp_path,))}
    assert found == {
        "recorded.parquet": "2026-03-02",
        "killed.arrows": "2026-03-02",
        "date=2026-01-01/moved.parquet": "2026-01-01",
        "date=/unnamed.parquet": "2026-03-02",
        **dict.fromkeys(
            ("converted.parquet", "damaged.parquet", "other.parquet", "plain.csv", "broken.parquet"),
            "unknown",
        ),
    }


def test_recordings_of_the_same_name_in_several_folders_are_told_apart(tmp_path: Path, scene: Path) -> None:
    paths = []
    for name in ("first", "second"):
        here = tmp_path / name / "robot=a"
        here.mkdir(parents=True)
        paths.append(write_motion(demo(), here / "one.parquet"))
    found = find_recordings((*paths, paths[1].parent))
    assert [file.name for file in found] == ["first/robot=a/one.parquet", "second/robot=a/one.parquet"]
    summary = analyze_fleet(tuple(paths), scene, tmp_path / "out", workers=1)
    (one,) = {summary.contacts["recording"].to_pylist().count(file.name) for file in found}
    assert one > 0


def test_what_an_interrupted_analysis_left_is_no_recording(tmp_path: Path, scene: Path) -> None:
    """Its folder may lie in the dataset: results of segments are there, the report that names them is not."""
    path = write_motion(demo(), tmp_path / "one.parquet", last=500)
    analyze_fleet((tmp_path,), scene, tmp_path / "results")
    for result in (tmp_path / "results").iterdir():
        if result.name != "parts":
            shutil.rmtree(result) if result.is_dir() else result.unlink()
    left = list((tmp_path / "results").rglob("*.parquet"))
    assert len(left) == 1
    assert [file.path for file in find_recordings((tmp_path,), tmp_path / "other")] == [path]


def test_what_a_recorder_that_was_killed_left_is_a_recording(tmp_path: Path, scene: Path) -> None:
    """Its files have no end, and a name of their own."""
    here = tmp_path / "robot=a" / "date=2026-01-01"
    here.mkdir(parents=True)
    table = pa_parquet.read_table(write_motion(demo(), tmp_path / "one.parquet", last=2500))
    for name in ("samples-1.arrows", "wrench-1.arrows"):
        with pa.OSFile(str(here / name), "wb") as file, pa.ipc.new_stream(file, table.schema) as stream:
            stream.write_table(table, max_chunksize=500)
    whole = (here / "samples-1.arrows").read_bytes()
    (here / "samples-1.arrows").write_bytes(whole[: len(whole) * 9 // 10])
    found = analyze_fleet((tmp_path / "robot=a",), scene, tmp_path / "out")
    assert [robot.recordings for robot in found.robots] == [1]
    assert found.contacts.num_rows >= 1
    assert any("cut" in text or "ends" in text for text in found.problems)


@pytest.mark.parametrize("out", ["data", "data/results", "data/robot=a"])
def test_the_results_of_an_earlier_run_are_no_recordings(tmp_path: Path, out: str) -> None:
    data, results = dataset(tmp_path / "data"), tmp_path / out
    before = find_recordings((data,), results)
    for name in ("contacts/robot=a/date=unknown/part-0", "parts/1/a-0", "robots", "days"):
        (results / name).parent.mkdir(parents=True, exist_ok=True)
        (results / f"{name}.parquet").touch()
    assert find_recordings((data,), results) == before
    # Another folder for the results of this run.
    (results / "fleet.html").touch()
    assert find_recordings((data,), tmp_path / "out") == before


def test_the_results_of_a_single_recording_are_no_recordings(tmp_path: Path) -> None:
    """`contacts.mcap` holds the recording once more: its contacts counted twice."""
    data = dataset(tmp_path / "data")
    before = find_recordings((data,))
    results = data / "robot=a" / "date=2026-01-01"
    for name in ("contacts.parquet", "contacts.csv", "contacts.mcap", "estimates.parquet", "report.html"):
        (results / name).touch()
    assert find_recordings((data,)) == before
    (results / "report.html").unlink()
    assert len(find_recordings((data,))) == len(before) + 4


def _empty(tmp_path: Path) -> Path:
    folder = tmp_path / "empty"
    folder.mkdir()
    return folder


def test_segments_cover_a_recording_once(tmp_path: Path) -> None:
    write_motion(demo(), tmp_path / "one.parquet", rounds=5)
    (file,) = find_recordings((tmp_path / "one.parquet",))
    found = list(segments(file, 30.0))
    assert [segment.first for segment in found] == [0, 15000, 30000, 45000, 60000]
    assert [segment.last for segment in found] == [15000, 30000, 45000, 60000, None]
    assert found[3].begin == 15000
    assert [segment.earliest for segment in found] == [0, 0, 0, 0, 0]


@pytest.mark.parametrize(("unit", "count"), [("dates", 5), ("us", 1)])
def test_segments_of_recordings_with_dates_or_another_unit(tmp_path: Path, unit: str, count: int) -> None:
    """Dates ended in a traceback, microseconds in a segment for each sample."""
    write_motion(demo(), tmp_path / "one.parquet", rounds=5)
    table = pa_parquet.read_table(tmp_path / "one.parquet")
    t = pa.array((1e6 * table["timestamp"].to_numpy()).astype(np.int64))
    table = table.set_column(0, "timestamp", t.cast(pa.timestamp("us")) if unit == "dates" else t)
    pa_parquet.write_table(table, tmp_path / "one.parquet")
    (file,) = find_recordings((tmp_path / "one.parquet",))
    assert len(list(segments(file, 30.0))) == count


def test_times_in_milliseconds_are_told(tmp_path: Path) -> None:
    """Of a pile of recordings without a usable sample, what is wrong with them all."""
    (tmp_path / "robot=a").mkdir()
    path = write_motion(demo(), tmp_path / "robot=a" / "one.parquet", last=500)
    table = pa_parquet.read_table(path)
    milliseconds = 1000.0 * table["timestamp"].to_numpy()
    pa_parquet.write_table(table.set_column(0, "timestamp", [milliseconds]), path)
    (tmp_path / "scene.yaml").write_text("robot: ur5e\n")
    summary = analyze_fleet((tmp_path,), tmp_path / "scene.yaml", tmp_path / "out")
    assert summary.unjudged
    assert any("got 2 s on average; is another unit meant" in problem for problem in summary.problems)
