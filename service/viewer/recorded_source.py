"""Frames of a recording, with controls: play, pause, scrub, speed, and its contacts to jump to."""

import math
import time
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import Any

import viser

from contactsense import Event
from contactsense.scene import Scene
from contactsense.service.recordings import ColumnMapping
from contactsense.service.viewer.controls import set_value
from contactsense.service.viewer.frame import Frame
from contactsense.service.viewer.literal_text import literal
from contactsense.service.viewer.playback import Playback
from contactsense.service.viewer.playback_clock import SPEEDS, PlaybackClock

LEAD = 0.5
"""Time before a contact to which a jump leads [s]."""
CHOOSE = "choose one"
"""What the list of contacts shows before one is chosen."""
STEP = 0.01
"""Step of the slider [s]."""
FOLLOW = 0.2
"""Shortest time between two movements of the slider [s]."""


class RecordedSource:
    """A recording that is played."""

    title = "Recording"
    """Label of its controls."""

    def __init__(
        self,
        path: Path,
        scene: Scene,
        mapping: ColumnMapping | None = None,
        progress: Callable[[int], object] | None = None,
    ) -> None:
        """Read and estimate the recording; it stands at its beginning.

        Args:
            path: Of the recording.
            scene: The arm, its mounting and its sensors.
            mapping: Names of columns and topics, and units; None: the defaults.
            progress: As for `Playback.open`.

        Raises:
            RecordingError: The file cannot be read.
        """
        self.scene = scene
        self._playback = Playback.open(scene, path, mapping, progress=progress)
        self.problems = self._playback.problems
        """What is wrong with the file, one line each."""
        self._clock = PlaybackClock(self._playback.duration)
        self._name = path.name
        self._slider: viser.GuiInputHandle[float] | None = None
        self._button: viser.GuiButtonHandle | None = None
        self._followed = -float("inf")
        self._list: viser.GuiInputHandle[str] | None = None
        self._jumped: tuple[str, float] | None = None

    def add_controls(self, gui: viser.GuiApi) -> None:
        """Add play and pause, slider, speed, and the list of contacts."""
        button = self._button = gui.add_button("Play")
        slider = self._slider = gui.add_slider(
            "Time, s", min=0.0, max=slider_end(self._playback.duration), step=STEP, initial_value=0.0
        )
        speed = gui.add_dropdown("Speed", [f"{s:g} x" for s in SPEEDS], initial_value="1 x")

        @button.on_click
        def _(_: object) -> None:
            now = time.monotonic()
            if self._clock.running(now):
                self._clock.stop(now)
            else:
                self._clock.start(now)

        @slider.on_update
        def _(event: viser.GuiEvent[Any]) -> None:
            if event.client is not None:  # moved by a person, not by the clock
                self._clock.jump(slider.value, time.monotonic())

        @speed.on_update
        def _(_: object) -> None:
            self._clock.set_speed(float(speed.value.split()[0]), time.monotonic())

        names = onset_times(self._playback.events)
        if names:
            jump = self._list = gui.add_dropdown("Contact", [CHOOSE, *names], initial_value=CHOOSE)

            @jump.on_update
            def _(_: object) -> None:
                if jump.value in names:
                    at = max(names[jump.value] - LEAD, 0.0)
                    self._clock.jump(at, time.monotonic())
                    self._jumped = jump.value, at

    def frame(self) -> Frame:
        """The frame at the clock's time."""
        now = time.monotonic()
        at = self._clock.time(now)
        if self._slider is not None and self._button is not None and now - self._followed > FOLLOW:
            self._followed = now
            if abs(self._slider.value - at) > 0.02:
                set_value(self._slider, round(at, 2))
            label = "Pause" if self._clock.running(now) else "Play"
            if self._button.label != label:
                self._button.label = label
            self._leave_contact(at)
        return self._playback.at(at)

    def _leave_contact(self, at: float) -> None:
        """Let the list ask to choose one when the playback has left what it shows, which cannot be chosen
        again."""
        if self._list is None or self._jumped is None:
            return
        name, to = self._jumped
        if abs(at - to) > LEAD:
            self._jumped = None
            if self._list.value == name:  # not another that has been chosen since
                set_value(self._list, CHOOSE)

    def note(self) -> str:
        """Where the playback is, as Markdown."""
        at = self._clock.time(time.monotonic())
        return f"{literal(self._name)}: {at:.1f} s of {self._playback.duration:.1f} s"


def slider_end(duration: float) -> float:
    """A duration [s] as a whole number of steps: the slider reaches its end, whose label is short."""
    return round(STEP * max(math.ceil(duration / STEP - 1e-6), 1), 2)


def onset_times(events: Iterable[Event]) -> dict[str, float]:
    """Names of the contacts to jump to, with the times at which they began [s]."""
    # The number makes names differ where two contacts begin on one link within a tenth of a second.
    return {f"{e.contact}: {e.t:.1f} s {e.link}": e.t for e in events if e.kind == "onset"}
