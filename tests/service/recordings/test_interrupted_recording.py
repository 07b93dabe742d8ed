"""A service's recording while its files cannot be written: it lacks samples, goes on, and says so."""

import errno
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from contactsense.service.api.clips import Clips
from contactsense.service.recordings.writing.clip_listener import ClipListener, RecordingSettings
from contactsense.service.recordings.writing.segment_writer import SegmentWriter
from tests.service.loopback import until
from tests.service.recordings.samples import SCENE, estimate, sample


@pytest.fixture
def disk(monkeypatch: pytest.MonkeyPatch) -> dict[str, bool]:
    """Set `full` to have no space on it."""
    state = {"full": False}
    write = SegmentWriter._write

    def limited(writer: SegmentWriter, rows: np.ndarray) -> None:
        if state["full"]:
            raise OSError(errno.ENOSPC, "No space left on device")
        write(writer, rows)

    monkeypatch.setattr(SegmentWriter, "_write", limited)
    return state


class Recorded:
    """A listener, what it writes and what the service says of it."""

    def __init__(self, folder: Path) -> None:
        settings = RecordingSettings(folder=folder, minutes=0.1)
        self.listener = ClipListener(SCENE, settings, 500.0)
        self.clips = Clips(settings, self._send)
        self._sent = 0

    def _send(self, command: dict[str, Any]) -> bool:
        self.listener.command(command)
        return True

    def write(self, rows: int = 250) -> None:
        """So many samples, and what is reported of them; 250 are written at a time."""
        for i in range(self._sent, self._sent + rows):
            self.listener.receive(sample(i), estimate(i))
        self._sent += rows
        self.await_report()

    def await_report(self) -> None:
        assert until(lambda: any(report["type"] == "recording" for report in self.listener._reports))
        for report in self.listener.take_reports():
            self.clips.handle_report(report)

    @property
    def state(self) -> tuple[bool, int, str]:
        found = self.clips.recording
        return found.on, found.rows, found.trouble


LACKS = "the recording lacks samples; it goes on once files can be written: "


def test_it_goes_on_when_there_is_space_again(tmp_path: Path, disk: dict[str, bool]) -> None:
    recorded = Recorded(tmp_path)
    recorded.clips.record(True)
    recorded.write()
    assert recorded.state == (True, 250, "")
    disk["full"] = True
    recorded.write()
    on, rows, trouble = recorded.state
    assert (on, rows) == (True, 250)
    assert trouble.startswith(LACKS)
    assert "No space left on device" in trouble
    disk["full"] = False
    recorded.write()
    assert recorded.state == (True, 500, "")
    recorded.clips.record(False)
    recorded.await_report()
    assert recorded.state == (False, 500, "")
    recorded.listener.close()


def test_it_can_be_stopped_meanwhile(tmp_path: Path, disk: dict[str, bool]) -> None:
    recorded = Recorded(tmp_path)
    recorded.clips.record(True)
    disk["full"] = True
    recorded.write()
    assert recorded.clips.recording.on
    recorded.clips.record(False)
    recorded.await_report()
    assert recorded.state == (False, 0, "")
    recorded.listener.close()


def test_one_whose_last_file_cannot_be_completed_has_ended(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def full(_: SegmentWriter) -> None:
        raise OSError(errno.ENOSPC, "No space left on device")

    recorded = Recorded(tmp_path)
    recorded.clips.record(True)
    recorded.write()
    monkeypatch.setattr(SegmentWriter, "_finish", full)
    recorded.clips.record(False)
    recorded.await_report()
    on, rows, trouble = recorded.state
    assert (on, rows) == (False, 250)
    assert trouble.startswith("the recording ended, and its last file is incomplete: ")
    assert "No space left on device" in trouble
    recorded.listener.close()
