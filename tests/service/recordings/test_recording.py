"""Recordings in every format that is read, and everything that can be wrong with them."""

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.feather as pa_feather
import pyarrow.parquet as pa_parquet
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from contactsense import Localizer, Sample
from contactsense.scene_model.wrench_map import WrenchMap
from contactsense.service.recordings import (
    RecordingError,
    RecordingFile,
    read,
)
from contactsense.service.recordings.metadata import metadata
from contactsense.service.recordings.signals.cleaning import RowChecker
from tests.service.recordings.recorded_tables import (
    SCENE,
    TORQUES,
    N,
    as_arrow,
    as_blanks,
    as_csv,
    as_feather,
    as_folder,
    as_gzip,
    as_parquet,
    columns,
    table,
    text,
)


@pytest.mark.parametrize("write", [as_csv, as_blanks, as_gzip, as_parquet, as_folder, as_arrow, as_feather])
def test_every_table_format_reads_the_same(
    tmp_path: Path, write: Callable[[Path, dict[str, np.ndarray]], Path]
) -> None:
    found = columns()
    recording = read(write(tmp_path, found), SCENE)
    np.testing.assert_allclose(recording.t, found["timestamp"], atol=1e-9)
    np.testing.assert_allclose(recording.q, table(found, "actual_q"), atol=1e-9)
    np.testing.assert_allclose(recording.joint_torque, table(found, "joint_torque"), atol=1e-9)
    expected = WrenchMap.of(SCENE.base_wrench).wrench(table(found, "base_wrench"))
    np.testing.assert_allclose(recording.base_wrench, expected, atol=1e-8)
    assert recording.problems == ()
    np.testing.assert_array_equal(recording.rows, np.arange(N))


def test_packed_files_and_names_in_capitals(tmp_path: Path) -> None:
    found = columns()
    packed = as_gzip(tmp_path, found).rename(tmp_path / "a.csv")
    np.testing.assert_array_equal(read(packed, SCENE).q, table(found, "actual_q"))
    capitals = as_parquet(tmp_path, found).rename(tmp_path / "A.PARQUET")
    np.testing.assert_array_equal(read(capitals, SCENE).q, table(found, "actual_q"))
    (tmp_path / "converted.mcap").touch()  # beside it, this makes the folder no rosbag2 recording
    np.testing.assert_array_equal(read(tmp_path, SCENE).q, table(found, "actual_q"))


@pytest.mark.parametrize("unit", ["ms", "us", "ns"])
@pytest.mark.parametrize("zone", [None, "Europe/Berlin"])
def test_dates_are_seconds_since_1970(tmp_path: Path, unit: str, zone: str | None) -> None:
    found = columns()
    start = 1_774_746_000.0  # half an hour before the clocks of Berlin are set forward
    t = start + np.arange(N) * 0.002
    dates = pa.array(np.round(t * {"ms": 1e3, "us": 1e6, "ns": 1e9}[unit]).astype(np.int64))
    arrow = pa.table({**found, "timestamp": dates.cast(pa.timestamp(unit, zone))})
    pa_parquet.write_table(arrow, tmp_path / "a.parquet", version="2.6")
    recording = read(tmp_path / "a.parquet", SCENE)
    np.testing.assert_allclose(recording.t, t, atol=1e-6)
    assert recording.problems == ()


def test_rows_in_no_order_span_the_time_from_the_earliest_to_the_latest(tmp_path: Path) -> None:
    head, *lines = text(columns()).splitlines()
    shuffled = np.random.default_rng(0).permutation(lines)
    for rows in (shuffled, lines[::-1]):
        (tmp_path / "a.csv").write_text("\n".join([head, *rows]))
        assert read(tmp_path / "a.csv", SCENE).seconds == pytest.approx(0.002 * (N - 1))
    found = columns()
    found["timestamp"][N // 2 :] -= found["timestamp"][N // 2]  # set back once
    assert read(as_csv(tmp_path, found), SCENE).seconds == pytest.approx(0.002 * (N - 2))


def test_a_folder_that_was_recorded_is_one_recording(tmp_path: Path) -> None:
    found = columns()
    half = {name: values[: N // 2] for name, values in found.items()}
    rest = {name: values[N // 2 :] for name, values in found.items()}
    for part, name in ((half, "samples-1-0000.parquet"), (rest, "samples-1-0001.parquet")):
        as_parquet(tmp_path, part).rename(tmp_path / name)
    raw = {"tick": np.arange(9.0), "arrival": np.arange(9.0)}
    as_parquet(tmp_path, raw).rename(tmp_path / "wrench-1-0000.parquet")
    np.testing.assert_array_equal(read(tmp_path, SCENE).t, found["timestamp"])
    for path in tmp_path.glob("samples-*"):
        path.unlink()
    with pytest.raises(RecordingError, match=r"expected a folder with \.parquet files of samples, got none"):
        read(tmp_path, SCENE)


@pytest.mark.parametrize("damage", ["checksum", "garbage"])
def test_a_packed_file_that_is_damaged_gives_what_it_holds(tmp_path: Path, damage: str) -> None:
    """The error is the file's, not one of writing the results."""
    found = columns()
    path = as_gzip(tmp_path, found)
    packed = path.read_bytes()
    path.write_bytes(packed[:-8] + b"x" * 8 if damage == "checksum" else packed + b"no more of it")
    recording = read(path, SCENE)
    np.testing.assert_allclose(recording.t, found["timestamp"], atol=1e-9)
    assert [p.kind for p in recording.problems] == ["cut_short"]


@pytest.mark.filterwarnings("error")
def test_infinite_readings_are_missing(tmp_path: Path) -> None:
    found = columns()
    found["base_wrench_2"][3] = np.inf
    found["joint_torque_1"][4] = -np.inf
    recording = read(as_parquet(tmp_path, found), SCENE)
    assert [(p.row_from, p.row_to, p.kind) for p in recording.problems] == [
        (4, 5, "not_finite"), (3, 4, "not_finite"),
    ]  # fmt: skip


def test_a_time_that_can_be_none_in_any_unit_is_not_used(tmp_path: Path) -> None:
    found = columns()
    found["timestamp"][20] = 1e308
    recording = read(as_parquet(tmp_path, found), SCENE)
    assert [(p.kind, p.row_from) for p in recording.problems] == [("not_finite", 20)]
    assert recording.seconds < 1.0


@pytest.mark.parametrize("size", [1, 7, 50, 1000])
def test_blocks_hold_every_row_once(tmp_path: Path, size: int) -> None:
    found = columns()
    scene = SCENE.model_copy(update={"base_wrench": SCENE.base_wrench.model_copy(update={"delay": 0.005})})
    file = RecordingFile(as_parquet(tmp_path, found), scene)
    blocks = list(file.blocks(size))
    assert max(map(len, blocks)) <= size
    np.testing.assert_array_equal(np.concatenate([block.rows for block in blocks]), np.arange(N))


def test_rows_that_are_wrong_are_named_and_the_rest_is_used(tmp_path: Path) -> None:
    found = columns()
    t = found["timestamp"]
    t[5:7] = t[4]  # repeated
    t[20:] += 1.0  # gap
    t[40:] -= 50.0  # clock set back
    t[30] = np.nan
    found["base_wrench_2"][10:12] = np.nan
    found["actual_q_0"][15] = np.inf
    recording = read(as_parquet(tmp_path, found), SCENE)
    assert [(p.kind, p.row_from, p.row_to) for p in sorted(recording.problems, key=lambda p: p.row_from)] == [
        ("repeated", 5, 7),
        ("not_finite", 10, 12),
        ("not_finite", 15, 16),
        ("gap", 20, 21),
        ("not_finite", 30, 31),
        ("clock_set_back", 40, 41),
    ]
    assert (len(recording), recording.repeated) == (N - 3, 2)
    samples = list(recording.samples())
    assert samples[8].base_wrench is None  # row 10, two rows before it are left out
    assert samples[7].base_wrench is not None


@pytest.mark.parametrize("share", [0.3, 0.6, 0.95])
@pytest.mark.parametrize("write", [as_gzip, as_arrow, as_csv])
def test_files_that_are_cut_short_give_what_they_hold(
    tmp_path: Path, write: Callable[[Path, dict[str, np.ndarray]], Path], share: float
) -> None:
    path = write(tmp_path, columns(400))
    whole = path.read_bytes()
    path.write_bytes(whole[: int(share * len(whole))])
    recording = read(path, SCENE)
    assert 0 < len(recording) < 400
    expected = columns(400)["timestamp"][: len(recording)]
    np.testing.assert_allclose(recording.t[:-1], expected[:-1], atol=1e-6)


@pytest.mark.parametrize("write", [as_gzip, as_arrow, as_csv])
def test_what_is_wrong_with_a_file_is_said_once_however_often_it_is_read(
    tmp_path: Path, write: Callable[[Path, dict[str, np.ndarray]], Path]
) -> None:
    """Its end counted again with each reading, as when `analyze` first looks for sensors without readings."""
    path = write(tmp_path, columns(400))
    whole = path.read_bytes()
    path.write_bytes(whole[: int(0.7 * len(whole))])
    file = RecordingFile(path, SCENE)
    once = file.read().problems
    assert once
    assert file.read().problems == once


@pytest.mark.parametrize("size", [37, 10_000])
def test_a_sensor_whose_values_are_held_is_named(tmp_path: Path, size: int) -> None:
    n = 200
    found, held = columns(n), np.arange(n) // 4 * 4
    slow = {name: v[held] if name.startswith("base_wrench") else v for name, v in found.items()}
    said = [
        p for part in RecordingFile(as_parquet(tmp_path, slow), SCENE).blocks(size) for p in part.problems
    ]
    assert [(problem.kind, problem.row_from, problem.row_to) for problem in said] == [("held", 0, n)]
    assert "base_wrench repeats its values in 7" in str(said[0])
    # An arm at rest may repeat them: there, a simulator without noise does.
    resting = slow | {f"actual_qd_{i}": np.zeros(n) for i in range(6)}
    assert not read(as_parquet(tmp_path, resting), SCENE).problems


def test_a_recording_that_carries_its_scene_needs_no_other(tmp_path: Path) -> None:
    whole = pa.table(columns(), metadata=metadata(SCENE))
    pa_parquet.write_table(whole, tmp_path / "a.parquet")
    np.testing.assert_allclose(
        read(tmp_path / "a.parquet").base_wrench, read(tmp_path / "a.parquet", SCENE).base_wrench
    )
    with pytest.raises(RecordingError, match="carries no scene"):
        read(as_csv(tmp_path, columns()))


@pytest.mark.parametrize("write", [pa_parquet.write_table, pa_feather.write_feather])
def test_names_that_are_damaged_are_told(tmp_path: Path, write: Callable[..., None]) -> None:
    """Those of the metadata say nothing about the readings."""
    path = tmp_path / ("a.feather" if write is pa_feather.write_feather else "a.parquet")
    write(pa.table(columns(), metadata={b"\xff": b"\xff"}), path)
    assert len(read(path, SCENE)) == N
    path.write_bytes(path.read_bytes().replace(b"actual_q_0", b"actual_q_\xff"))
    with pytest.raises(RecordingError, match=rf"{path.name}: .*(cannot read the recording|actual_q)"):
        read(path, SCENE)


def test_there_and_back_through_pandas_and_arrow(tmp_path: Path) -> None:
    recording = read(as_parquet(tmp_path, columns()), SCENE)
    assert recording.to_arrow().num_rows == N
    pandas = pytest.importorskip("pandas")
    assert isinstance(recording.to_pandas(), pandas.DataFrame)
    assert "50 samples" in repr(recording)


@settings(max_examples=60)
@given(st.lists(st.sampled_from([0.0, 0.002, 0.002, 0.002, 0.5, -3.0, float("nan")]), max_size=60), st.data())
def test_the_checker_does_not_depend_on_where_blocks_end(steps: list[float], data: st.DataObject) -> None:
    t = np.cumsum(np.nan_to_num(np.array([1.0, 0.002, 0.002, *steps])))
    t[3:][np.isnan(np.array(steps))] = np.nan
    whole = RowChecker()
    kept = whole.keep(t, 0)
    whole.finish()
    cut = data.draw(st.integers(3, len(t)))
    parts = RowChecker()
    split = np.concatenate((parts.keep(t[:cut], 0), parts.keep(t[cut:], cut)))
    parts.finish()
    np.testing.assert_array_equal(kept, split)
    rows = {
        kind: {r for p in checker.problems if p.kind == kind for r in range(p.row_from, p.row_to)}
        for checker in (whole,)
        for kind in ("repeated", "gap", "clock_set_back", "not_finite")
    }
    for kind, expected in rows.items():
        found = {r for p in parts.problems if p.kind == kind for r in range(p.row_from, p.row_to)}
        assert found == expected, kind


def test_a_recording_steps_through_the_localizer(tmp_path: Path) -> None:
    localizer = Localizer(TORQUES)
    estimates = list(localizer.run(read(as_parquet(tmp_path, columns()), TORQUES).samples()))
    assert len(estimates) == N
    assert isinstance(next(read(as_parquet(tmp_path, columns()), TORQUES).samples()), Sample)
