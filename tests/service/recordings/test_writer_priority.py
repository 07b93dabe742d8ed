"""Threads that write files are scheduled normally, although the one that reads sensors runs in real time."""

import os
import sys
import threading
from pathlib import Path

import pytest

from contactsense.service.live.scheduling import RECORDER, prioritize
from contactsense.service.recordings.writing.clip_listener import ClipListener, RecordingSettings
from contactsense.service.recordings.writing.segment_writer import SegmentWriter
from tests.service.live.test_scheduling import in_a_thread, permitted
from tests.service.loopback import until
from tests.service.recordings.samples import SCENE

pytestmark = [
    pytest.mark.skipif(sys.platform != "linux", reason="only Linux has it"),
    pytest.mark.skipif(not permitted(), reason="this user may not run anything in real time"),
]


def policies(name: str) -> set[int]:
    """How threads with this name are scheduled."""
    threads = [thread for thread in threading.enumerate() if thread.name.startswith(name)]
    return {os.sched_getscheduler(thread.native_id or 0) for thread in threads}


def test_those_of_a_recording(tmp_path: Path) -> None:
    def writes() -> set[int]:
        assert prioritize(RECORDER) == "real time"
        writer = SegmentWriter(tmp_path, "a", ("x",), {}, flush_seconds=0.0)
        writer.add((1.0,))
        writer.flush()
        found = policies("segments")
        writer.close()
        return found

    assert in_a_thread(writes) == {os.SCHED_OTHER}


def test_those_of_clips(tmp_path: Path) -> None:
    def writes() -> bool:
        assert prioritize(RECORDER) == "real time"
        listener = ClipListener(SCENE, RecordingSettings(folder=tmp_path), 500.0)
        normal = until(lambda: policies("recording") == {os.SCHED_OTHER}, timeout=10.0)
        listener.close()
        return normal

    assert in_a_thread(writes)
