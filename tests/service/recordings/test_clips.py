"""Clips and recordings of a running service."""

import multiprocessing
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from click.testing import CliRunner

from contactsense.service.api.app import create_app
from contactsense.service.api.clips import Clips
from contactsense.service.api.settings import Settings
from contactsense.service.cli.record import record
from contactsense.service.mock.arm.script import Script
from contactsense.service.mock.arm.simulated_arm import simulate
from contactsense.service.mock.servers import MockServers, MockSettings
from contactsense.service.recordings import read
from contactsense.service.recordings.writing.clip_listener import ClipListener, RecordingSettings
from tests.service import http
from tests.service.loopback import own_address, until
from tests.service.recordings.samples import SCENE, estimate, sample
from tests.service.serving import serving


def test_a_recording_goes_on_in_a_new_process_and_a_lost_clip_is_told(tmp_path: Path) -> None:
    sent: list[dict[str, Any]] = []

    def send(command: dict[str, Any]) -> bool:
        sent.append(command)
        return True

    clips, started = Clips(RecordingSettings(folder=tmp_path), send), {"type": "recorder started"}
    clips.handle_report(started)
    assert sent == []
    assert clips.record(True)
    clips.handle_report({"type": "recording", "on": True, "rows": 500, "error": ""})
    clips.request(None, None, "door")
    clips.note_end()  # the process was killed
    assert clips.clips[1].error == "the pipeline ended before the clip was complete"
    clips.handle_report(started)
    assert sent == [{"type": "record", "on": True}] * 2
    clips.handle_report({"type": "recording", "on": True, "rows": 250, "error": ""})
    assert (clips.recording.on, clips.recording.rows) == (True, 750)
    clips.handle_report({"type": "recording", "on": True, "rows": 0, "error": "the disk is full"})
    assert clips.recording.error == "the disk is full"
    assert clips.record(False)
    clips.handle_report(started)
    assert len(sent) == 3
    assert clips.record(True)
    assert (clips.recording.rows, clips.recording.error) == (0, "")


def test_rows_are_those_since_the_recording_began(tmp_path: Path) -> None:
    clips = Clips(RecordingSettings(folder=tmp_path), lambda _: True)

    def rows(on: bool, rows: int, error: str = "") -> int:
        clips.handle_report({"type": "recording", "on": on, "rows": rows, "error": error})
        return clips.recording.rows

    clips.record(True)
    assert rows(True, 5000) == 5000
    assert rows(True, 0, "the disk is full") == rows(True, 0, "the disk is full") == 5000
    assert rows(True, 250) == 5250  # there is room again: a new file
    clips.record(False)
    clips.record(True)  # before the end of the one before is reported
    assert rows(False, 500) == 500
    assert (rows(True, 250), clips.recording.on) == (250, True)


def test_a_clip_that_is_requested_while_a_pipeline_loads_is_lost_only_with_that_one(tmp_path: Path) -> None:
    """That of a second pipeline was said to be lost, and that of one that ended while it loaded to come."""
    clips = Clips(RecordingSettings(folder=tmp_path), lambda _: True)
    clips.request(None, None, "door")
    clips.handle_report({"type": "recorder started"})
    assert clips.clips[1].error == ""
    clips.note_end()
    clips.request(None, None, "window")
    clips.note_end()
    clips.request(None, None, "floor")
    clips.handle_report({"type": "recorder started"})
    assert [bool(clip.error) for clip in clips.clips.values()] == [True, True, False]


def test_a_clip_that_is_refused_is_not_listed(tmp_path: Path) -> None:
    runs = False
    clips = Clips(RecordingSettings(folder=tmp_path), lambda _: runs)
    assert clips.order(None, None, "door") is None
    assert clips.listed() == []
    runs = True
    ordered = clips.order(None, None, "door")
    assert ordered is not None
    assert clips.listed() == [ordered]


def test_the_clip_of_a_collision_that_no_pipeline_takes_is_listed_as_failed(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    clips = Clips(RecordingSettings(folder=tmp_path), lambda _: False)
    clips.order_of_collision("forearm")
    (clip,) = clips.listed()
    assert (clip.reason, clip.file) == ("collision on forearm", None)
    assert "no pipeline runs" in clip.error
    assert "clip 1 (collision on forearm) was not written" in caplog.text


def test_clips_of_before_are_listed_with_their_reason(tmp_path: Path) -> None:
    listener = ClipListener(SCENE, RecordingSettings(folder=tmp_path, minutes=0.1), 500.0)
    for i in range(100):
        listener.receive(sample(i), estimate(i))
    for number, reason in ((1, "door"), (2, "collision on forearm")):
        listener.command(
            {"type": "clip", "number": number, "before": 100.0, "after": 0.0001, "reason": reason}
        )
    time.sleep(0.01)
    listener.tick(time.monotonic())
    listener.close()
    (tmp_path / "clip-20990101T000000-000003.parquet").write_text("no table")
    clips = Clips(RecordingSettings(folder=tmp_path), lambda _: True)
    clips.order(None, None, "window")
    # A file of this run, before it is reported.
    (tmp_path / "clip-20990101T000001-000001.parquet").write_text("")
    door, collision, broken, window = clips.listed()
    assert [clip.number for clip in (door, collision, broken, window)] == [None, None, None, 1]
    assert [door.reason, collision.reason, window.reason] == ["door", "collision on forearm", "window"]
    assert (door.samples, collision.samples) == (100, 100)
    assert door.file is not None
    assert "cannot be read as Parquet" in broken.error
    (tmp_path / door.file).unlink()
    assert [clip.reason for clip in clips.listed()] == ["collision on forearm", "", "window"]


def test_a_clip_that_is_removed_or_moved_away_is_not_listed(tmp_path: Path) -> None:
    clips = Clips(RecordingSettings(folder=tmp_path), lambda _: True)
    file = tmp_path / "clip-20260101T000000-000001.parquet"
    report = {"type": "clip", "number": 1, "file": file.name, "samples": 100, "error": ""}
    for reason in ("door", "window", "gate"):
        clips.order(None, None, reason)
    file.write_bytes(b"")
    clips.handle_report(report)
    clips.handle_report({**report, "number": 2, "file": None, "error": "the disk is full"})
    assert [clip.reason for clip in clips.listed()] == ["door", "window", "gate"]
    file.unlink()
    assert [clip.reason for clip in clips.listed()] == ["window", "gate"]  # failed, and being recorded


def test_only_the_newest_clips_are_listed(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("contactsense.service.api.clips._MOST", 3)
    for i in range(5):
        (tmp_path / f"clip-20260101T00000{i}-000001.parquet").write_bytes(b"no table")
    clips = Clips(RecordingSettings(folder=tmp_path), lambda _: True)
    assert [clip.file for clip in clips.listed()] == [
        f"clip-20260101T00000{i}-000001.parquet" for i in (2, 3, 4)
    ]
    for _ in range(2):
        assert clips.order(None, None, "now") is not None
    assert [clip.reason for clip in clips.listed()][1:] == ["now", "now"]
    assert len(clips.listed()) == 3


def test_without_a_pipeline_no_clip_is_left_in_the_list(tmp_path: Path) -> None:
    with serving(create_app(Settings.checked({"recording": {"folder": tmp_path}}))) as place:
        answer = http.post(f"http://{place}/v1/clip", json={"reason": "door"})
        assert answer.status_code == 503
        assert listed(f"http://{place}") == []


@pytest.fixture(scope="module")
def service(tmp_path_factory: pytest.TempPathFactory) -> Iterator[tuple[str, Path]]:
    folder = tmp_path_factory.mktemp("recordings")
    motion = simulate(
        Script.model_validate(
            {
                "robot": "ur5e",
                "noise": {"base_force": 0.25, "base_moment": 0.05, "joint_torque": 1.0},
                "trajectory": {"start": [0.0, -1.3, 1.6, -1.9, -1.57, 0.0], "dwell": 3.0},
            }
        )
    )
    chosen = MockSettings(host=own_address(), rtde_port=0, netft_port=0, http_port=0, loop=True)
    with MockServers(motion, chosen) as servers:
        settings = Settings.checked(
            {
                "robot_host": chosen.host,
                "robot_port": servers.rtde.port,
                "ft_host": chosen.host,
                "ft_port": servers.netft.port,
                "ft_http_port": servers.netft.http_port,
                "recording": {"folder": folder},
            }
        )
        with serving(create_app(settings)) as place:
            url = f"http://{place}"
            assert until(lambda: http.get(f"{url}/v1/health").json()["status"] == "ok", 280.0, step=0.05)
            yield url, folder


def listed(url: str) -> list[dict[str, Any]]:
    found: list[dict[str, Any]] = http.get(f"{url}/v1/clips").json()["clips"]
    return found


@pytest.mark.slow
def test_a_clip_over_http(service: tuple[str, Path]) -> None:
    url, folder = service
    assert until(lambda: http.get(f"{url}/v1/health").json()["pipeline"]["estimates"] > 500, 60.0)

    def clipped() -> float:
        """Length of a new clip [s]."""
        answer = http.post(f"{url}/v1/clip", json={"before": 0.5, "after": 0.3, "reason": "door"})
        assert answer.status_code == 202
        assert answer.json()["file"] is None
        assert until(lambda: listed(url)[-1]["file"], 30.0)
        clip = read(folder / listed(url)[-1]["file"])
        assert clip.meta["contactsense.reason"] == "door"
        np.testing.assert_allclose(np.diff(clip.t), 0.002, atol=1e-6)
        return clip.seconds

    # Samples are cut by their arrival: where the host stands still, more or fewer of them are in a clip.
    assert until(lambda: clipped() == pytest.approx(0.8, abs=0.3), 60.0)


@pytest.mark.slow
def test_a_service_records_while_the_command_runs(service: tuple[str, Path]) -> None:
    url, folder = service

    def recorded() -> float:
        """Length of a new recording [s]."""
        before = set(folder.glob("service-*.parquet"))
        result = CliRunner().invoke(record, ["--url", url, "--seconds", "1.5"])
        assert result.exit_code == 0, result.output
        assert until(lambda: set(folder.glob("service-*.parquet")) - before, 30.0)
        (path,) = set(folder.glob("service-*.parquet")) - before
        recording = read(path)
        np.testing.assert_allclose(np.diff(recording.t), 0.002, atol=1e-6)
        return recording.seconds

    # What arrives after a time in which the host stood still may be too late for it.
    assert until(lambda: 1.0 < recorded() < 2.5, 60.0)


@pytest.mark.slow
def test_a_killed_pipeline_goes_on_recording(service: tuple[str, Path]) -> None:
    url, folder = service
    files = len(list(folder.glob("service-*")))
    assert http.post(f"{url}/v1/recording", json={"on": True}).status_code == 202

    def recorded() -> int:
        return int(http.get(f"{url}/v1/recording").json()["rows"])

    assert until(lambda: recorded() > 250, 60.0)
    (pipeline,) = [child for child in multiprocessing.active_children() if "pipeline" in child.name]
    before = recorded()
    pipeline.kill()
    assert until(lambda: recorded() > before + 250, 280.0, step=0.05)
    assert http.post(f"{url}/v1/recording", json={"on": False}).status_code == 202
    assert until(
        lambda: len([*folder.glob("service-*.parquet"), *folder.glob("service-*.arrows")]) > files, 60.0
    )


def test_bad_requests_name_the_field(service: tuple[str, Path]) -> None:
    url, _ = service
    answer = http.post(f"{url}/v1/clip", json={"before": -1.0})
    assert (answer.status_code, answer.json()["errors"][0]["field"]) == (422, "before")
    answer = http.post(f"{url}/v1/recording", json={"on": "yes"})
    assert (answer.status_code, answer.json()["errors"][0]["field"]) == (422, "on")


@pytest.mark.parametrize("span", [{"after": 1e9}, {"before": 1e9}, {"before": 100.0, "after": 21.0}])
def test_a_clip_longer_than_the_memory_is_refused(service: tuple[str, Path], span: dict[str, float]) -> None:
    url, _ = service
    before = listed(url)
    answer = http.post(f"{url}/v1/clip", json=span)
    assert answer.status_code == 422
    error = answer.json()["errors"][0]
    assert error["field"] == max(span, key=lambda name: span[name])
    assert "120 s that the service keeps" in error["reason"]
    assert listed(url) == before


def test_without_a_folder_it_says_what_to_do() -> None:
    with serving(create_app(Settings())) as place:
        answer = http.post(f"http://{place}/v1/clip", json={})
        assert answer.status_code == 409
        assert "--recordings" in answer.text
    result = CliRunner().invoke(record, ["--url", "http://127.0.0.1:1", "--seconds", "1"])
    assert result.exit_code == 1
    assert "http://127.0.0.1:1 cannot be reached" in result.output


def test_a_service_with_a_token_needs_it(tmp_path: Path) -> None:
    (tmp_path / "token").write_text("a token of the cell\n")
    with serving(create_app(Settings(token="a token of the cell"))) as place:
        arguments = ["--url", f"http://{place}", "--seconds", "1"]
        result = CliRunner().invoke(record, arguments)
        assert "401" in result.output
        assert "--token-file names the file with its token" in result.output
        result = CliRunner().invoke(record, [*arguments, "--token-file", str(tmp_path / "token")])
        assert "--recordings" in result.output  # it is let in, and the service has no folder


def test_clips_keep_to_the_limit_of_the_disk_space(tmp_path: Path) -> None:
    settings = RecordingSettings(folder=tmp_path, minutes=0.1, disk_megabytes=0.2)
    listener = ClipListener(SCENE, settings, 500.0)
    for i in range(1000):
        listener.receive(sample(i), estimate(i))
    for number in range(6):
        listener.command({"type": "clip", "number": number, "before": 100.0, "after": 0.0001})
    time.sleep(0.01)
    listener.tick(time.monotonic())
    listener.close()
    left = sorted(tmp_path.glob("clip-*"))
    assert 0 < sum(path.stat().st_size for path in left) <= 200_000
    assert [path.stem[-6:] for path in left] == [f"{number:06d}" for number in range(6)][-len(left) :]
    assert len(left) < 6
