"""`contactsense record`: whoever presses Ctrl-C again while it ends does not leave the end undone."""

import signal
from collections.abc import Iterator
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest
from click.testing import CliRunner

from contactsense.service.cli import record
from contactsense.service.recordings.writing.recorder import Recorder
from tests.service.recordings.test_rotation_options import Packets


@pytest.fixture(params=[signal.SIGINT, signal.SIGTERM])
def number(request: pytest.FixtureRequest) -> Iterator[signal.Signals]:
    """A signal that interrupts, as in a process of the command line."""
    before = signal.signal(request.param, signal.default_int_handler)
    yield request.param
    signal.signal(request.param, before)


def test_the_last_file_is_completed(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, number: signal.Signals
) -> None:
    close = Recorder.close

    def interrupted(recorder: Recorder) -> list[Path]:
        signal.raise_signal(number)
        return close(recorder)

    monkeypatch.setattr(Recorder, "close", interrupted)
    monkeypatch.setattr(record, "LiveSource", Packets)
    robot = ["--robot-host", "192.0.2.1", "--ft-host", "192.0.2.2"]
    done = CliRunner().invoke(record.record, [*robot, "--out", str(tmp_path)])
    assert done.exit_code == 0, done.output
    assert [path.suffix for path in tmp_path.iterdir()] == [".parquet"]


def test_the_service_is_told_to_end_its_recording(
    monkeypatch: pytest.MonkeyPatch, number: signal.Signals
) -> None:
    told: list[bool] = []

    def recording(on: bool | None = None) -> Any:
        if on is False:
            signal.raise_signal(number)
        if on is not None:
            told.append(on)
        return SimpleNamespace(rows=0, folder="there", error="")

    service = SimpleNamespace(url="http://192.0.2.1", recording=recording)
    monkeypatch.setattr(record, "ServiceCalls", lambda *_: service)
    CliRunner().invoke(record.record, ["--url", service.url, "--seconds", "0.01"])
    assert told == [True, False]
