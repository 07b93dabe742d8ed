"""Clips and recordings in the process of the pipeline, without a service."""

import time
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from contactsense.service.api.clips import Clips
from contactsense.service.recordings import read
from contactsense.service.recordings.writing import clip_listener, sample_rows
from contactsense.service.recordings.writing.clip_listener import ClipListener, RecordingSettings
from contactsense.service.recordings.writing.sample_rows import Ring
from tests.service.loopback import until
from tests.service.recordings.samples import SCENE, estimate, sample


@pytest.mark.parametrize("pushed", [0, 3, 10, 25])
def test_the_ring_keeps_the_newest_rows(pushed: int) -> None:
    ring = Ring(10, 2)
    for i in range(pushed):
        ring.next[:] = i
        ring.push()
    kept = ring.between(0, -1.0, 1e9)[:, 0]
    np.testing.assert_array_equal(kept, np.arange(max(0, pushed - 10), pushed))
    np.testing.assert_array_equal(ring.between(0, 4.0, 6.0)[:, 0], [k for k in kept if 4 <= k <= 6])


def test_a_clip_that_cannot_be_written_is_reported_and_ends_no_recording(tmp_path: Path) -> None:
    listener = ClipListener(SCENE, RecordingSettings(folder=tmp_path, minutes=0.1), 500.0)
    listener.command({"type": "record", "on": True})
    for i in range(1000):
        listener.receive(sample(i), estimate(i))
    assert until(lambda: any(report["type"] == "recording" for report in listener._reports))
    listener._folder = tmp_path / "file"
    (tmp_path / "file").write_text("")
    listener.command({"type": "clip", "number": 7, "before": 1.0, "after": 0.001, "reason": "test"})
    time.sleep(0.01)
    listener.tick(time.monotonic())
    assert until(lambda: any(report["type"] == "clip" for report in listener._reports))
    (report,) = [report for report in listener.take_reports() if report["type"] == "clip"]
    assert (report["number"], report["file"]) == (7, None)
    assert "File exists" in report["error"]
    listener.close()
    *_, ended = listener.take_reports()
    assert (ended["on"], ended["rows"], ended["error"]) == (True, 1000, "")  # the next process goes on
    clips = Clips(RecordingSettings(folder=tmp_path), lambda _: True)
    clips.request(None, None, "test")
    clips.handle_report({**report, "number": 1})
    assert "File exists" in clips.clips[1].error


def test_a_clip_is_written_though_an_old_one_cannot_be_removed(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    settings = RecordingSettings(folder=tmp_path, minutes=0.1, disk_megabytes=1e-6)
    old = tmp_path / "clip-0.parquet"
    old.mkdir()  # no user may unlink it
    clips = Clips(settings, lambda _: True)
    listener = ClipListener(SCENE, settings, 500.0)
    for i in range(10):
        listener.receive(sample(i), estimate(i))
    listener.command(clips.request(3.0, 3.0, "test"))
    listener.close()
    for report in listener.take_reports():
        clips.handle_report(report)
    clip = clips.clips[1]
    assert (clip.samples, clip.error) == (10, "")
    assert [found.file for found in clips.listed()] == [old.name, clip.file]
    assert f"{old} cannot be removed" in caplog.text


@pytest.mark.parametrize(
    ("span", "first"),
    [({"before": 60.0, "after": 0.051}, 0), ({"before": 0.0601, "after": 0.051}, 70), ({}, 90)],
)
def test_a_clip_reaches_back_and_goes_on(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, span: dict[str, float], first: int
) -> None:
    now = 1e9
    clock = SimpleNamespace(
        time=lambda: now, monotonic=lambda: now, strftime=time.strftime, gmtime=time.gmtime
    )
    monkeypatch.setattr(clip_listener, "time", clock)
    monkeypatch.setattr(sample_rows, "time", clock)
    settings = RecordingSettings(folder=tmp_path, minutes=0.1, before=0.0201, after=0.051)
    listener = ClipListener(SCENE, settings, 500.0)
    for i in range(300):
        now += 0.002
        listener.receive(sample(i), estimate(i))
        if i == 100:
            listener.command({"type": "clip", "number": 7, **span, "reason": "test"})
        listener.tick(0.0)
    assert until(lambda: list(tmp_path.glob("clip-*-000007.parquet")))
    assert until(lambda: len(listener._reports) > 1)
    started, report = listener.take_reports()
    assert started == {"type": "recorder started"}
    assert (report["type"], report["number"]) == ("clip", 7)
    clip = read(tmp_path / report["file"])
    assert report["samples"] == len(clip) == 101 + 25 - first
    np.testing.assert_array_equal(clip.q[:, 0], np.arange(first, 126))
    np.testing.assert_allclose(clip.base_wrench[:, 0], np.arange(first, 126))
    listener.close()


def test_a_clip_whose_end_has_not_come_is_written_when_the_service_ends(tmp_path: Path) -> None:
    listener = ClipListener(SCENE, RecordingSettings(folder=tmp_path, minutes=0.1), 500.0)
    listener.command({"type": "clip", "number": 1, "before": 60.0, "after": 60.0})
    for i in range(10):
        listener.receive(sample(i), estimate(i))
    listener.tick(0.0)
    assert list(tmp_path.iterdir()) == []
    listener.close()
    (path,) = tmp_path.iterdir()
    np.testing.assert_array_equal(read(path).q[:, 0], np.arange(10))


def test_a_recording_holds_every_row_until_it_is_ended(tmp_path: Path) -> None:
    listener = ClipListener(SCENE, RecordingSettings(folder=tmp_path, minutes=0.1), 500.0)
    listener.command({"type": "record", "on": True})
    for i in range(777):
        listener.receive(sample(i), estimate(i))
    listener.command({"type": "record", "on": False})
    assert until(lambda: list(tmp_path.glob("service-*.parquet")))
    listener.close()
    (path,) = tmp_path.glob("service-*.parquet")
    np.testing.assert_array_equal(read(path).q[:, 0], np.arange(777))


def test_an_old_file_that_cannot_be_completed_is_told_once(tmp_path: Path) -> None:
    (tmp_path / "service-0.arrows").mkdir()  # no user may read it as a file
    listener = ClipListener(SCENE, RecordingSettings(folder=tmp_path, minutes=0.1), 500.0)
    for _ in range(3):
        listener.command({"type": "record", "on": True})
        listener.receive(sample(0), estimate(0))
        listener.command({"type": "record", "on": False})
    listener.close()
    assert len(list(tmp_path.glob("service-*.parquet"))) == 3
    told = [report["text"] for report in listener.take_reports() if report["type"] == "recorder warning"]
    assert len(told) == 1
    assert "service-0.arrows: cannot be completed" in told[0]
