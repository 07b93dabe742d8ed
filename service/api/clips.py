"""Clips of the last minutes and recordings on request, as the service orders them from the pipeline."""

import itertools
import logging
from collections.abc import Callable
from pathlib import Path
from typing import Any

from pydantic import BaseModel, Field

from contactsense.service.api.http.errors import FieldRefusedError
from contactsense.service.api.request_body import RequestBody
from contactsense.service.recordings.clips.clip_files import clip_names, read_clip_file
from contactsense.service.recordings.writing.clip_listener import RecordingSettings

log = logging.getLogger("contactsense")
_MOST = 1000
"""Clips that are listed; older ones are forgotten, their files stay."""


class ClipIn(RequestBody):
    """Time span of a clip."""

    before: float | None = Field(
        None, gt=0.0, description="Time before now [s]; default: the service's.", examples=[20.0]
    )
    after: float | None = Field(
        None, gt=0.0, description="Time after now [s]; default: the service's.", examples=[5.0]
    )
    reason: str = Field("", max_length=500, description="Why; goes into the file's metadata.")


class ClipOut(BaseModel):
    """One clip."""

    number: int | None = Field(
        description="Number of the clip since the service began; null of one that was in the folder before."
    )
    reason: str = Field("", description="Why it was asked for.")
    file: str | None = Field(
        None, description="Name of the file; null while it is still being recorded, and if it failed."
    )
    samples: int | None = Field(None, description="Samples in it.")
    error: str = Field("", description="Why it could not be written.")


class ClipsOut(BaseModel):
    """Clips in the folder, and those that are being recorded or have failed; the latest last."""

    folder: str = Field(description="Where the files are, on the service's host.")
    clips: list[ClipOut] = Field(description="The clips.")


class RecordingIn(RequestBody):
    """Start or stop a recording."""

    on: bool = Field(description="true: start, or go on; false: stop.")


class RecordingOut(BaseModel):
    """The recording on the service's host."""

    folder: str = Field(description="Where the files are, on the service's host.")
    on: bool = Field(
        description="Whether it goes on; also while files cannot be written, since that is tried again."
    )
    rows: int = Field(0, description="Samples written so far.")
    error: str = Field("", description="Why the latest samples are missing; empty if none are.")

    @property
    def trouble(self) -> str:
        """What is wrong with it in one readable line; empty if nothing is."""
        if not self.error:
            return ""
        if self.on:
            return f"the recording lacks samples; it goes on once files can be written: {self.error}"
        return f"the recording ended, and its last file is incomplete: {self.error}"


class Clips:
    """What the service knows about its clips and recording.

    Args:
        settings: Where they are written, and how long clips are.
        send: Sends a command to the pipeline's process; returns False if there is none.
    """

    def __init__(self, settings: RecordingSettings, send: Callable[[dict[str, Any]], bool]) -> None:
        self.settings = settings
        self._send = send
        self._numbers = itertools.count(1)
        self._started = False  # whether any process has written clips and recording
        self._rows_before = 0  # in files that are complete or broken off
        self.clips: dict[int, ClipOut] = {}
        """Those since the service began, by number."""
        # Later ones are known by their number; a file may be there before it is reported.
        self._earlier: dict[str, ClipOut | None] = dict.fromkeys(
            [] if settings.folder is None else clip_names(settings.folder)
        )
        self.recording = RecordingOut(folder=str(settings.folder), on=False)

    def request(self, before: float | None, after: float | None, reason: str) -> dict[str, Any]:
        """Number a new clip; returns the command for the pipeline.

        Raises:
            FieldRefusedError: the clip is longer than what the service keeps in memory.
        """
        self._check_length(before, after)
        number = next(self._numbers)
        self.clips[number] = ClipOut(number=number, reason=reason)
        while len(self.clips) > _MOST:
            del self.clips[next(iter(self.clips))]
        return {"type": "clip", "number": number, "before": before, "after": after, "reason": reason}

    def order(self, before: float | None, after: float | None, reason: str) -> ClipOut | None:
        """Order a new clip of the pipeline; returns None, and lists no clip, if no pipeline runs.

        Raises:
            FieldRefusedError: the clip is longer than what the service keeps in memory.
        """
        command = self.request(before, after, reason)
        if not self._send(command):
            del self.clips[command["number"]]
            return None
        return self.clips[command["number"]]

    def order_of_collision(self, link: str) -> None:
        """Order the clip of a collision. Nobody else would be told that it is missing: it is listed, too, if
        no pipeline runs."""
        command = self.request(None, None, f"collision on {link}")
        if not self._send(command):
            self._fail(self.clips[command["number"]], "no pipeline runs that has the samples")

    def listed(self) -> list[ClipOut]:
        """The newest clips: those whose files are in the folder, and those that have none yet or have failed.
        Those of before the service began come first. Reads files."""
        folder = self.settings.folder
        if folder is None:
            return []
        since = [(clip, clip.file) for clip in tuple(self.clips.values())]  # before new files appear
        found, names = [], clip_names(folder)
        for name in names[-_MOST:]:
            if name in self._earlier:
                clip = self._earlier[name] = self._earlier[name] or _clip_of_file(folder / name)
                found.append(clip)
        present = {None, *names}
        return [*found, *(clip for clip, file in since if file in present)][-_MOST:]

    def record(self, on: bool) -> bool:
        """Start or stop the recording; returns False if no pipeline runs."""
        if not self._send({"type": "record", "on": on}):
            return False
        if on and not self.recording.on:
            self._rows_before = self.recording.rows = 0
        self.recording.on, self.recording.error = on, ""
        return True

    def _check_length(self, before: float | None, after: float | None) -> None:
        if before is None and after is None:
            return
        length = {"before": before or self.settings.before, "after": after or self.settings.after}
        kept = 60.0 * self.settings.minutes
        if sum(length.values()) > kept:
            longer, shorter = sorted(length, key=lambda name: -length[name])
            raise FieldRefusedError(
                longer,
                f"expected at most {max(kept - length[shorter], 0.0):g} s, since with {shorter} the clip may "
                f"have the {kept:g} s that the service keeps, got {length[longer]:g} s",
            )

    def handle_report(self, report: dict[str, Any]) -> None:
        """Process a report of the pipeline."""
        if report["type"] == "recorder started":
            self._resume()
        elif report["type"] == "recorder warning":
            log.warning(report["text"])
        elif report["type"] == "clip" and report["number"] in self.clips:
            clip = self.clips[report["number"]]
            clip.file, clip.samples = report["file"], report["samples"]
            if report["error"]:
                self._fail(clip, report["error"])
        elif report["type"] == "recording":
            self.recording.on, self.recording.error = report["on"], report["error"]
            if report["error"]:  # what was written before stays; a later file is counted from 0
                self._rows_before = self.recording.rows
            else:
                self.recording.rows = self._rows_before + report["rows"]

    def _fail(self, clip: ClipOut, error: str) -> None:
        clip.error = error
        log.error("clip %d (%s) was not written: %s", clip.number, clip.reason, error)

    def note_end(self) -> None:
        """The pipeline's process has ended, and has forgotten the clips that it had not written."""
        for clip in self.clips.values():
            if clip.file is None and not clip.error:
                self._fail(clip, "the pipeline ended before the clip was complete")

    def _resume(self) -> None:
        """A process has started that writes clips and recording; it knows no recording of the one before.

        Commands that arrived while it was loading have not been read by it yet.
        """
        self._rows_before = self.recording.rows
        if self.recording.on:
            if self._started:
                log.warning("the recording goes on in a new file: the pipeline was started again")
            self._send({"type": "record", "on": True})
        self._started = True


def _clip_of_file(path: Path) -> ClipOut:
    """A clip of which only the file is known."""
    try:
        found = read_clip_file(path)
    except (OSError, ValueError) as error:
        return ClipOut(number=None, file=path.name, error=str(error))
    return ClipOut(number=None, reason=found.reason, file=path.name, samples=found.samples)
