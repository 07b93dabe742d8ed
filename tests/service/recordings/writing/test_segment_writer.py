"""Rows that were handed over survive whatever happens to the writer."""

import errno
import os
import signal
import subprocess
import sys
import threading
import time
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pyarrow.parquet as pa_parquet
import pytest

from contactsense import Scene
from contactsense.service.recordings import date_in
from contactsense.service.recordings.metadata import metadata
from contactsense.service.recordings.problems import RecordingError
from contactsense.service.recordings.writing import segment_writer
from contactsense.service.recordings.writing.segment_writer import Rotation, SegmentWriter, repair, to_parquet
from tests.service.recordings.failing_disk import fail_reading

NAMES = ("timestamp", "value")


def rows_of(paths: list[Path]) -> np.ndarray:
    tables = [pa_parquet.read_table(path) for path in paths]
    return np.concatenate([table.column("timestamp").to_numpy() for table in tables])


def test_rows_come_back_in_order_over_many_segments(tmp_path: Path) -> None:
    writer = SegmentWriter(tmp_path, "a", NAMES, {"k": "v"}, Rotation(megabytes=0.002), flush_seconds=0.0)
    for i in range(1000):
        writer.add((0.002 * i, float(i)))
    files = writer.close()
    assert len(files) > 3
    np.testing.assert_allclose(rows_of(files), 0.002 * np.arange(1000))
    assert pa_parquet.read_schema(files[0]).metadata[b"k"] == b"v"
    assert not list(tmp_path.glob("*.arrows"))


def test_each_file_has_the_time_at_which_it_began(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A recording over midnight is of two days."""
    times = iter(["2026-01-01T23:59:00+00:00", "2026-01-02T00:01:00+00:00"])
    monkeypatch.setattr(segment_writer, "creation", lambda: {"contactsense.created": next(times)})
    meta = metadata(Scene(robot="ur5e"), table="samples")
    writer = SegmentWriter(tmp_path, "a", NAMES, meta, Rotation(seconds=0.0), flush_seconds=0.0)
    for i in range(2):
        writer.add((0.002 * i, float(i)))
    assert [date_in(path) for path in writer.close()] == ["2026-01-01", "2026-01-02"]


def test_the_disk_limit_removes_the_oldest(tmp_path: Path) -> None:
    rotation = Rotation(megabytes=0.01, disk_megabytes=0.02)
    writer = SegmentWriter(tmp_path, "a", NAMES, {}, rotation, flush_seconds=0.0)
    noise = np.random.default_rng(1).standard_normal((10_000, 2))
    for row in noise:
        writer.add(row)
    files = writer.close()
    assert sum(path.stat().st_size for path in files) <= 20_000
    assert files == sorted(tmp_path.glob("*.parquet"))
    assert writer.removed > 0
    np.testing.assert_array_equal(rows_of(files), noise[-len(rows_of(files)) :, 0])


def test_the_newest_segment_is_kept_whatever_its_size(tmp_path: Path) -> None:
    rotation = Rotation(megabytes=0.002, disk_megabytes=1e-6)
    writer = SegmentWriter(tmp_path, "a", NAMES, {}, rotation, flush_seconds=0.0)
    for i in range(500):
        writer.add((float(i), 0.0))
    files = writer.close()
    assert writer.removed > 1
    assert list(tmp_path.glob("*.parquet")) == files


def test_rows_wait_and_segments_grow_no_longer_than_stated(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    now = 100.0
    clock = SimpleNamespace(monotonic=lambda: now, strftime=time.strftime, gmtime=time.gmtime)
    monkeypatch.setattr(segment_writer, "time", clock)
    writer = SegmentWriter(tmp_path, "a", NAMES, {}, Rotation(seconds=10.0), flush_seconds=0.5)
    for i in range(30):
        now = 100.0 + i
        writer.add((float(i), 0.0))
        writer.add((i + 0.5, 0.0))  # waits for less than half a second
        writer._wait(writer._writing)
    files = writer.close()
    lengths = [np.ptp(rows_of([path])) for path in files]
    assert len(files) == 3
    assert max(lengths) < 11.0
    np.testing.assert_array_equal(rows_of(files), 0.5 * np.arange(60))


WRITER = """
import sys, time
from pathlib import Path
from contactsense.service.recordings.writing.segment_writer import SegmentWriter
writer = SegmentWriter(Path(sys.argv[1]), "a", ("timestamp", "value"), {})
begin = time.monotonic()
while True:
    t = time.monotonic() - begin
    writer.add((t, 1.0))
    print(t, flush=True)
    time.sleep(0.002)
"""


@pytest.mark.slow
def test_a_killed_writer_loses_at_most_a_second(tmp_path: Path) -> None:
    process = subprocess.Popen(
        [sys.executable, "-c", WRITER, str(tmp_path)], stdout=subprocess.PIPE, text=True, env=os.environ
    )
    assert process.stdout is not None
    told = [0.0]
    while told[-1] < 2.0:
        told.append(float(process.stdout.readline()))
    process.send_signal(signal.SIGKILL)
    out, _ = process.communicate(timeout=120)
    told = told[1:] + [float(line) for line in out.splitlines()[:-1]]
    assert list(tmp_path.glob("*.arrows"))
    again = SegmentWriter(tmp_path, "a", NAMES, {})
    kept = rows_of(again.repaired)
    assert told[-1] - kept[-1] < 1.0
    np.testing.assert_allclose(kept, told[: len(kept)])
    assert not list(tmp_path.glob("*.arrows"))


@pytest.mark.parametrize("size", [0, 1, 40, 300, 900])
def test_a_segment_cut_anywhere_is_repaired_or_dropped(tmp_path: Path, size: int) -> None:
    writer = SegmentWriter(tmp_path, "a", NAMES, {}, flush_seconds=0.0)
    for i in range(20):
        writer.add((float(i), 0.0))
        writer.flush()
    (path,) = tmp_path.glob("*.arrows")
    (tmp_path / "b-cut.arrows").write_bytes(path.read_bytes()[:size])
    found = repair(tmp_path, "b")
    assert not (tmp_path / "b-cut.arrows").exists()
    if found:
        kept = rows_of(found)
        np.testing.assert_array_equal(kept, np.arange(len(kept)))
    writer.close()


@pytest.mark.parametrize("good", [0, 100, 900])
def test_what_the_disk_does_not_give_back_is_no_end_of_a_segment(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, good: int
) -> None:
    warnings: list[str] = []
    writer = SegmentWriter(tmp_path, "a", NAMES, {}, flush_seconds=0.0, warn=warnings.append)
    for i in range(20):
        writer.add((float(i), 0.0))
        writer.flush()
    fail_reading(monkeypatch, good)
    assert writer.close() == []
    (path,) = tmp_path.iterdir()  # no row is lost
    again = SegmentWriter(tmp_path, "a", NAMES, {}, warn=warnings.append)
    assert again.repaired == []
    again.add((20.0, 0.0))
    again.flush()  # earlier rows keep no later ones from being written
    assert len(warnings) == 2
    for warning in warnings:
        assert warning.startswith(f"{path}: cannot be read")
        assert "Input/output error; it stays as it is" in warning
    monkeypatch.undo()
    assert len(again.close()) == 1
    np.testing.assert_array_equal(rows_of(repair(tmp_path, "a")), np.arange(20.0))


def test_a_segment_of_another_user_keeps_no_rows_from_being_written(tmp_path: Path) -> None:
    (tmp_path / "a-1.arrows").mkdir()  # no user may read it as a file
    warnings: list[str] = []
    writer = SegmentWriter(tmp_path, "a", NAMES, {}, warn=warnings.append)
    writer.add((1.0, 0.0))
    np.testing.assert_array_equal(rows_of(writer.close()), [1.0])
    (warning,) = warnings
    assert "a-1.arrows: cannot be completed: Is a directory" in warning


def test_two_writers_share_a_folder(tmp_path: Path) -> None:
    writers = []
    for first in (0.0, 1000.0):
        writer = SegmentWriter(tmp_path, "a", NAMES, {}, flush_seconds=0.0)
        assert writer.repaired == []
        writers.append(writer)
        for i in range(10):
            writer.add((first + i, 0.0))
        writer.flush()
    for i in range(10, 20):
        writers[0].add((float(i), 0.0))
    np.testing.assert_array_equal(rows_of(writers[0].close()), np.arange(20.0))
    np.testing.assert_array_equal(rows_of(writers[1].close()), 1000.0 + np.arange(10.0))


def test_a_part_without_its_segment_is_removed(tmp_path: Path) -> None:
    writer = SegmentWriter(tmp_path, "a", NAMES, {})
    writer.add((0.0, 0.0))
    writer.flush()
    (path,) = tmp_path.glob("*.arrows")
    own, old = path.with_suffix(".parquet.part"), tmp_path / "a-old.parquet.part"
    own.write_text("")
    old.write_text("")
    assert repair(tmp_path, "a") == []
    assert own.exists()  # the other writer is completing it
    assert not old.exists()
    writer.close()


def test_a_folder_that_cannot_be_written_is_named(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    with pytest.raises(RecordingError, match=r"file.*cannot write"):
        SegmentWriter(tmp_path / "file" / "below", "a", NAMES, {})


def test_rows_are_taken_while_a_segment_becomes_parquet(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    begun, go_on = threading.Event(), threading.Event()

    def slow(path: Path, group: int) -> Path | None:
        begun.set()
        assert go_on.wait(30.0)
        return to_parquet(path, group)

    monkeypatch.setattr(segment_writer, "to_parquet", slow)
    writer = SegmentWriter(tmp_path, "a", NAMES, {}, Rotation(megabytes=0.002), flush_seconds=0.0)
    for i in range(1000):
        writer.add((float(i), 0.0))
    assert begun.wait(30.0)
    assert writer.files == []
    go_on.set()
    np.testing.assert_array_equal(rows_of(writer.close()), np.arange(1000.0))


def test_rows_are_taken_while_the_disk_holds_up_a_write(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    go_on = threading.Event()
    write = SegmentWriter._write

    def slow(writer: SegmentWriter, rows: np.ndarray) -> None:
        assert go_on.wait(30.0)
        write(writer, rows)

    monkeypatch.setattr(SegmentWriter, "_write", slow)
    writer = SegmentWriter(tmp_path, "a", NAMES, {}, flush_seconds=0.0)
    for i in range(50):
        writer.add((float(i), 0.0))
    assert not list(tmp_path.glob("*.arrows"))
    go_on.set()
    writer.flush()
    assert list(tmp_path.glob("*.arrows"))
    np.testing.assert_array_equal(rows_of(writer.close()), np.arange(50.0))


def test_a_full_disk_is_reported(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def full(writer: SegmentWriter, rows: np.ndarray) -> None:
        raise OSError(errno.ENOSPC, "No space left on device")

    monkeypatch.setattr(SegmentWriter, "_write", full)
    writer = SegmentWriter(tmp_path, "a", NAMES, {}, flush_seconds=0.0)

    def record() -> None:
        writer.add((0.0, 0.0))
        writer.flush()

    with pytest.raises(RecordingError, match="No space left on device"):
        record()


def test_a_segment_that_is_removed_while_it_is_written_is_reported_at_once(tmp_path: Path) -> None:
    """Writing to it goes on without an error, and its ten minutes would be lost without a word."""
    writer = SegmentWriter(tmp_path, "a", NAMES, {}, flush_seconds=0.0)
    writer.add((0.0, 0.0))
    writer.flush()
    (path,) = tmp_path.glob("*.arrows")
    path.unlink()
    writer.add((1.0, 1.0))
    with pytest.raises(RecordingError, match=r"\.arrows: cannot write: somebody has removed or moved it"):
        writer.flush()
    with pytest.raises(RecordingError):
        writer.close()


def test_a_segment_that_cannot_become_parquet_is_reported(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def full(path: Path, group: int) -> Path | None:
        raise OSError(errno.ENOSPC, "No space left on device")

    monkeypatch.setattr(segment_writer, "to_parquet", full)
    writer = SegmentWriter(tmp_path, "a", NAMES, {}, flush_seconds=0.0)
    writer.add((0.0, 0.0))
    with pytest.raises(RecordingError, match="No space left on device"):
        writer.close()
    assert list(tmp_path.glob("*.arrows"))  # the next start repairs it


def test_what_a_full_disk_leaves_of_a_conversion_makes_room(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def full(writer: object, table: object) -> None:
        raise OSError(errno.ENOSPC, "No space left on device")

    writer = SegmentWriter(tmp_path, "a", NAMES, {})
    writer.add((0.0, 0.0))
    writer.flush()
    (path,) = tmp_path.iterdir()
    monkeypatch.setattr(pa_parquet.ParquetWriter, "write_table", full)
    with pytest.raises(OSError, match="No space left"):
        to_parquet(path)
    assert list(tmp_path.iterdir()) == [path]
    monkeypatch.undo()
    assert len(writer.close()) == 1
