"""Keeps the last minutes in memory and writes clips of them, or a continuous recording, while the pipeline
runs.

The listener fills one row per sample and passes completed blocks to a writer thread: pyarrow releases the
interpreter lock, and nothing on the sample path waits for the disk.
"""

import queue
import threading
import time
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any

import numpy as np
import pyarrow as pa
from pydantic import BaseModel, ConfigDict, Field, PositiveFloat

from contactsense.scene import Scene
from contactsense.service.live.scheduling import deprioritize
from contactsense.service.recordings.clips.clip_files import CLIP, CONTINUOUS, remove_unfinished
from contactsense.service.recordings.metadata import metadata, removed_delays
from contactsense.service.recordings.tables.parquet_files import write_parquet
from contactsense.service.recordings.writing.oldest_files import OldestFiles
from contactsense.service.recordings.writing.sample_rows import Ring, SampleRows
from contactsense.service.recordings.writing.segment_writer import Rotation, SegmentWriter
from contactsense.types import Estimate, Sample

_CHUNK = 250
"""Rows that are handed to the writer at a time."""
_MOST_WANTED = 1000
"""Clips that may be recorded at the same time."""
_SLOW = "the disk is too slow: what waits for it would fill the memory"
_Seconds = Annotated[float, Field(gt=0.0, le=86400.0)]


class RecordingSettings(BaseModel):
    """Recording settings of the service."""

    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False)

    folder: Path | None = None
    """Folder for clips and recordings; without it the service writes none."""
    minutes: Annotated[float, Field(gt=0.0, le=1440.0)] = 2.0
    """Duration of the data kept in memory for clips [min]."""
    before: _Seconds = 10.0
    """Length of a clip before the requested time [s]."""
    after: _Seconds = 5.0
    """Length of a clip after the requested time [s]."""
    disk_megabytes: PositiveFloat = 2000.0
    """Maximum disk space of recordings and of clips, each; the oldest files are removed [MB]."""


@dataclass(slots=True)
class _Wanted:
    number: int
    begin: float
    """On the host's monotonic clock [s], as `end`."""
    end: float
    reason: str


class ClipListener:
    """A listener of the pipeline that writes clips and recordings.

    Commands: `{"type": "clip", "number", "before", "after", "reason"}` and
    `{"type": "record", "on": true}`. Reports: `{"type": "clip", "number", "file", "samples", "error"}`,
    `{"type": "recording", "on", "rows", "error"}`, `{"type": "recorder warning", "text"}`, and first of all
    `{"type": "recorder started"}`.
    """

    def __init__(self, scene: Scene, settings: RecordingSettings, rate: float) -> None:
        assert settings.folder is not None
        self._folder, self._settings, self._scene = settings.folder, settings, scene
        self._rows = SampleRows(scene)
        # A row's last value is its time on the monotonic clock, by which clips are cut: the host's clock may
        # be set at any moment.
        self._ring = Ring(max(_CHUNK, int(60.0 * settings.minutes * rate)), len(self._rows.names) + 1)
        self._warnings: set[str] = set()
        limit = int(1e6 * settings.disk_megabytes)
        self._oldest_clips = OldestFiles(self._folder, CLIP, limit, self._warn)
        self._rate = rate
        self._wanted: list[_Wanted] = []
        self._reports: list[dict[str, Any]] = [{"type": "recorder started"}]
        self._work: queue.SimpleQueue[tuple[str, Any, int]] = queue.SimpleQueue()
        # A disk of the network may hang for hours: at most twice what the ring has waits for it.
        self._most_rows = 2 * self._ring.capacity
        self._handed = self._done = 0  # rows given to the writer, and rows that it is through with
        self._losing = False
        self._recording = False
        self._chunk = np.zeros((_CHUNK, len(self._rows.names)))
        self._filled = 0
        self._thread = threading.Thread(target=self._write, name="recording", daemon=True)
        self._thread.start()

    def receive(self, sample: Sample, estimate: Estimate) -> None:
        """Keep one sample. When a rule reports a collision, a command requests the clip."""
        self._ring.next[-1] = time.monotonic()
        row = self._ring.next[:-1]
        self._rows.fill(row, sample, estimate)
        if self._recording:
            self._chunk[self._filled] = row
            self._filled += 1
            if self._filled == _CHUNK:
                self._hand_over()
        self._ring.push()

    def tick(self, now: float) -> None:
        """Write the clips whose end has been reached."""
        del now
        clock = time.monotonic()
        for wanted in [w for w in self._wanted if clock >= w.end]:
            self._wanted.remove(wanted)
            self._hand_over_clip(wanted)

    def command(self, message: dict[str, Any]) -> None:
        """Handle a command; types meant for other listeners are ignored."""
        if message.get("type") == "clip":
            now = time.monotonic()
            before = float(message.get("before") or self._settings.before)
            after = float(message.get("after") or self._settings.after)
            reason = str(message.get("reason", ""))
            wanted = _Wanted(int(message["number"]), now - before, now + after, reason)
            if len(self._wanted) < _MOST_WANTED:
                self._wanted.append(wanted)
            else:
                self._reports.append(_clip_report(wanted, f"{_MOST_WANTED} clips are being recorded already"))
        elif message.get("type") == "record":
            on = bool(message["on"])
            if self._recording and not on:
                self._hand_over()
                self._put("stop", None)
            self._recording = on

    def take_reports(self) -> list[dict[str, Any]]:
        """Reports since the last call."""
        taken = self._reports[:]
        del self._reports[: len(taken)]  # the writer may add one at any moment
        return taken

    def close(self) -> None:
        """Write what was requested, as far as it is available."""
        for wanted in self._wanted:
            self._hand_over_clip(wanted)
        self._hand_over()
        self._put("end", None)
        self._thread.join(5.0)

    def _hand_over_clip(self, wanted: _Wanted) -> None:
        rows = self._ring.between(-1, wanted.begin, wanted.end)[:, :-1]
        if not self._put("clip", (wanted, rows), len(rows)):
            self._reports.append(_clip_report(wanted, _SLOW))

    def _hand_over(self) -> None:
        if not self._filled:
            return
        kept = self._put("rows", self._chunk[: self._filled].copy(), self._filled)
        self._filled = 0
        if not kept and not self._losing:
            self._put("lost", None)  # the file ends here: what comes later is in another one
        self._losing = not kept

    def _put(self, kind: str, value: Any, rows: int = 0) -> bool:
        """Give the writer something to do, unless that are rows, and too many wait for it."""
        if rows and self._handed - self._done + rows > self._most_rows:
            return False
        self._handed += rows
        self._work.put((kind, value, rows))
        return True

    def _write(self) -> None:
        """Main loop of the writer thread."""
        deprioritize()  # the pipeline runs in real time, and is not to wait for files
        writer: SegmentWriter | None = None
        remove_unfinished(self._folder)
        while True:
            kind, value, rows_taken = self._work.get()
            # Only the file ends with this process or with an error: the next one goes on.
            goes_on = kind != "stop"
            try:
                if kind == "clip":
                    self._report_clip(*value)
                elif kind == "rows":
                    if writer is None:
                        meta = metadata(self._scene, table=CONTINUOUS, **removed_delays(self._scene))
                        limit = Rotation(disk_megabytes=self._settings.disk_megabytes)
                        writer = SegmentWriter(
                            self._folder, CONTINUOUS, self._rows.names, meta, limit, rate=self._rate,
                            warn=self._warn,
                        )  # fmt: skip
                    for row in self._rows.stored(value):
                        writer.add(row)
                    writer.flush()
                    self._reports.append({"type": "recording", "on": True, "rows": writer.rows, "error": ""})
                if kind == "lost":
                    raise OSError(f"samples are lost: {_SLOW}")
                if kind == "stop" or (kind == "end" and writer is not None):
                    rows = 0
                    if writer is not None:
                        ended, writer = writer, None  # one that fails to close is closed all the same
                        rows = ended.rows
                        ended.close()
                    self._reports.append({"type": "recording", "on": goes_on, "rows": rows, "error": ""})
            except (OSError, ValueError, pa.ArrowException) as error:
                if writer is not None:
                    with suppress(OSError, ValueError, pa.ArrowException):
                        writer.close()
                writer = None
                # The next rows begin another file, as the disk may have space by then.
                self._reports.append({"type": "recording", "on": goes_on, "rows": 0, "error": str(error)})
            self._done += rows_taken
            if kind == "end":
                return

    def _warn(self, text: str) -> None:
        """Report once what each new file finds again."""
        if text not in self._warnings:
            self._warnings.add(text)
            self._reports.append({"type": "recorder warning", "text": text})

    def _report_clip(self, wanted: _Wanted, rows: np.ndarray) -> None:
        """Write a clip; one that fails is reported, and ends no recording."""
        report = _clip_report(wanted)
        try:
            report |= {"file": self._write_clip(wanted, rows), "samples": len(rows)}
        except (OSError, ValueError, pa.ArrowException) as error:
            report["error"] = str(error)
        self._reports.append(report)

    def _write_clip(self, wanted: _Wanted, rows: np.ndarray) -> str:
        """Write a clip; returns the name of its file."""
        self._folder.mkdir(parents=True, exist_ok=True)
        stamp = time.strftime("%Y%m%dT%H%M%S", time.gmtime())
        path = self._folder / f"{CLIP}-{stamp}-{wanted.number:06d}.parquet"
        meta = metadata(self._scene, table=CLIP, reason=wanted.reason, **removed_delays(self._scene))
        arrays = [pa.array(np.ascontiguousarray(column)) for column in self._rows.stored(rows).T]
        write_parquet(pa.table(dict(zip(self._rows.names, arrays, strict=True)), metadata=meta), path)
        self._oldest_clips.remove(path)
        return path.name


def _clip_report(wanted: _Wanted, error: str = "") -> dict[str, Any]:
    """The report of a clip that has not been written."""
    return {"type": "clip", "number": wanted.number, "file": None, "samples": None, "error": error}
