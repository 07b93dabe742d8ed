"""Clips and recordings of a service that runs for months: clocks are set, and disks hang."""

import os
import threading
import time
from collections.abc import Callable
from pathlib import Path

import pytest

from contactsense.service.recordings import read
from contactsense.service.recordings.writing import clip_listener
from contactsense.service.recordings.writing.clip_listener import ClipListener, RecordingSettings
from tests.service.loopback import until
from tests.service.recordings.samples import SCENE, estimate, sample

HOUR = 3600.0


def listener_of(folder: Path) -> ClipListener:
    return ClipListener(SCENE, RecordingSettings(folder=folder, minutes=0.01), 500.0)


def reports(listener: ClipListener, kind: str) -> list[dict[str, object]]:
    return [report for report in listener.take_reports() if report["type"] == kind]


@pytest.mark.parametrize("step", [-2.0 * HOUR, 2.0 * HOUR])
def test_a_clip_is_whole_and_in_time_where_the_clock_is_set(
    step: float, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    real, by = time.time, 0.0
    monkeypatch.setattr(time, "time", lambda: real() + by)
    listener = listener_of(tmp_path)
    for i in range(100):
        listener.receive(sample(i), estimate(i))
    begin = time.monotonic()
    listener.command({"type": "clip", "number": 1, "before": 5.0, "after": 0.3, "reason": "test"})
    by = step
    for i in range(100, 150):
        listener.receive(sample(i), estimate(i))
    listener.tick(0.0)
    assert not listener._wanted or time.monotonic() - begin < 0.3
    while time.monotonic() - begin < 0.31:
        time.sleep(0.01)
    listener.tick(0.0)
    assert until(lambda: list(tmp_path.glob("clip-*-000001.parquet")))
    listener.close()
    (file,) = tmp_path.glob("clip-*-000001.parquet")
    assert len(read(file).t) == 150


class _HangingDisk:
    """Holds up the writer until it is let go."""

    def __init__(self, listener: ClipListener, monkeypatch: pytest.MonkeyPatch) -> None:
        self.goes_on = threading.Event()
        write: Callable[..., None] = clip_listener.write_parquet

        def wait(*args: object) -> None:
            assert self.goes_on.wait(20.0)
            write(*args)

        monkeypatch.setattr(clip_listener, "write_parquet", wait)
        listener.command({"type": "clip", "number": 1, "before": 1.0, "after": 0.001, "reason": "test"})
        listener.receive(sample(0), estimate(0))
        time.sleep(0.01)
        listener.tick(0.0)


def test_what_waits_for_a_disk_that_hangs_is_bounded(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    listener = listener_of(tmp_path)
    disk = _HangingDisk(listener, monkeypatch)
    listener.command({"type": "record", "on": True})
    for i in range(5000):
        listener.receive(sample(i), estimate(i))
    assert listener._handed - listener._done <= 2 * listener._ring.capacity
    listener.command({"type": "clip", "number": 2, "before": 60.0, "after": 0.001, "reason": "test"})
    time.sleep(0.01)
    listener.tick(0.0)
    (refused,) = reports(listener, "clip")
    assert refused["number"] == 2
    assert "the disk is too slow" in str(refused["error"])

    disk.goes_on.set()
    assert until(lambda: listener._handed == listener._done and listener._work.empty())
    for i in range(5000, 5500):  # it goes on, in another file
        listener.receive(sample(i), estimate(i))
    listener.close()
    told = reports(listener, "recording")
    assert any("samples are lost: the disk is too slow" in str(report["error"]) for report in told)
    assert (told[-1]["on"], told[-1]["rows"], told[-1]["error"]) == (True, 500, "")
    assert len(list(tmp_path.glob("service-*.parquet"))) == 2


def test_what_a_killed_writer_has_left_is_removed(tmp_path: Path) -> None:
    old, new = (tmp_path / f".clip-20260101T000000-00000{i}.parquet.123" for i in (1, 2))
    for file in (old, new):
        file.write_bytes(b"PAR1")
    os.utime(old, (0.0, time.time() - 2.0 * HOUR))
    listener_of(tmp_path).close()
    assert list(tmp_path.iterdir()) == [new]  # perhaps another service is writing it


def test_a_flood_of_requests_for_clips_is_bounded(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(clip_listener, "_MOST_WANTED", 3)
    listener = listener_of(tmp_path)
    for number in range(5):
        listener.command({"type": "clip", "number": number, "before": 1.0, "after": 9.0, "reason": "test"})
    assert [(r["number"], r["error"]) for r in reports(listener, "clip")] == [
        (number, "3 clips are being recorded already") for number in (3, 4)
    ]
    listener.close()


def test_a_recording_whose_file_is_removed_goes_on_in_another_one(tmp_path: Path) -> None:
    listener = listener_of(tmp_path)
    listener.command({"type": "record", "on": True})

    def record(first: int) -> list[dict[str, object]]:
        for i in range(first, first + 250):
            listener.receive(sample(i), estimate(i))
        found: list[dict[str, object]] = []
        assert until(lambda: found.extend(reports(listener, "recording")) or found)  # type: ignore[func-returns-value]
        return found

    assert record(0)[-1]["error"] == ""
    (path,) = tmp_path.glob("service-*.arrows")
    path.unlink()
    assert "somebody has removed or moved it" in str(record(250)[-1]["error"])
    assert record(500)[-1]["error"] == ""
    listener.close()
    (path,) = tmp_path.glob("service-*.parquet")
    assert len(read(path).t) == 250
