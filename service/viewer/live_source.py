"""Frames of a running service: its stream, thinned, and its state; both are tried again after a loss.

The service sends at most `RATE` estimates a second and never waits for a reader. Health and latches are
polled from a thread of their own.
"""

import json
import threading
import time

import numpy as np
from pydantic import ValidationError
from websockets.exceptions import WebSocketException
from websockets.sync.client import connect

from contactsense.scene import Scene
from contactsense.service.api.messages import EstimateOut
from contactsense.service.viewer.frame import TRACKS, ForceHistory, Forces, Frame, Latch
from contactsense.service.viewer.literal_text import literal
from contactsense.service.viewer.service_calls import LiveError, ServiceCalls, in_words
from contactsense.service.viewer.service_note import ServiceNote, service_note
from contactsense.service.viewer.stream_messages import estimate_of, joints_of

RATE = 33.0
"""Estimates per second, for 30 pictures: two that come together are one picture."""
POLL = 0.5
"""Time between two requests for health and latches [s]."""
LONGEST_PAUSE = 2.0
"""Longest pause before the stream is opened again [s]."""
OUTDATED = "**The service's scene has changed; here is the former one. Start the viewer again.**"
"""Shown as soon as the service serves another scene."""
_END = 1.0
"""Longest time that a thread has to end [s]; it ends with the process at the latest."""
STALE = 1.0
"""An estimate that is older is not shown [s]."""


class LiveSource:
    """Newest estimate and state of a service."""

    def __init__(self, calls: ServiceCalls, scene: Scene | None = None) -> None:
        """Ask the service for its scene, and begin to read.

        Args:
            calls: To the service.
            scene: Used instead of the service's, whose files may not be on this computer.

        Raises:
            LiveError: The service does not answer (`AwayError`), or its scene cannot be used here.
        """
        self._calls = calls
        self._served = calls.scene_fields()
        self.scene = calls.scene() if scene is None else scene
        self.news = threading.Event()
        """Set when a new estimate has come."""
        self._history = ForceHistory()
        self._frame = Frame(None, None, Forces(np.empty(0), np.empty((0, TRACKS))))
        self._arrival = -float("inf")
        self._lost = ""
        self._told = ServiceNote("")
        self._outdated = ""
        self._latches: tuple[Latch, ...] = ()
        self._over = threading.Event()
        self._threads = [
            threading.Thread(target=work, name=f"viewer {work.__name__}", daemon=True)
            for work in (self._read, self._poll)
        ]
        for thread in self._threads:
            thread.start()

    def frame(self) -> Frame:
        """The newest estimate; none where it is stale. The posture remains."""
        frame = self._frame
        if time.monotonic() - self._arrival > STALE:
            return Frame(frame.q, None, frame.forces)
        return frame

    def note(self) -> str:
        """What the service says of itself, or why it cannot be heard, as Markdown."""
        return "\n\n".join(filter(None, (self._outdated, literal(self._lost) or self._told.text)))

    @property
    def failures(self) -> tuple[str, ...]:
        """What is wrong with each action, where the note has their number only."""
        return () if self._lost else self._told.failures

    @property
    def latches(self) -> tuple[Latch, ...]:
        """Latched collisions."""
        return self._latches

    def acknowledge(self) -> str:
        """Acknowledge all latched collisions; returns what went wrong, empty if nothing did."""
        try:
            self._calls.acknowledge()
        except LiveError as error:
            return str(error)
        self._latches = ()
        return ""

    def close(self) -> None:
        """Stop reading. A service that does not answer is not waited for."""
        self._over.set()
        for thread in self._threads:
            thread.join(_END)

    def _read(self) -> None:
        address = f"{self._calls.url.replace('http', 'ws', 1)}/v1/stream?rate={RATE:g}"
        pause, refused = 0.1, False
        while not self._over.is_set():
            try:
                with connect(
                    address, additional_headers=self._calls.headers, compression=None, close_timeout=0.2
                ) as stream:
                    while not self._over.is_set():
                        try:
                            message = stream.recv(timeout=0.2)
                        except TimeoutError:
                            # While it starts it sends nothing; messages that were refused may still come.
                            if not refused:
                                self._lost = ""
                            continue
                        self._take(json.loads(message))
                        # Not before: a connection alone does not show that the service can be used.
                        self._lost, pause, refused = "", 0.1, False
            except (OSError, WebSocketException, ValueError) as error:
                self._lost = f"the service cannot be heard, trying again: {in_words(error)}"
                refused = isinstance(error, ValueError)
            self._over.wait(pause)
            pause = min(2.0 * pause, LONGEST_PAUSE)

    def _take(self, content: dict[str, object]) -> None:
        if "lost" in content:
            return
        try:
            message = EstimateOut.model_validate(content)
        except ValidationError:
            raise ValueError("its messages are of another version") from None
        estimate = estimate_of(message)
        if len(estimate.link_probability) != len(self.scene.link_names):
            raise ValueError(
                f"expected estimates of the {len(self.scene.link_names)} links of "
                f"{self.scene.robot.name}, got {len(estimate.link_probability)}; it now serves another arm"
            )
        self._history.add(estimate)
        q = joints_of(message, len(self.scene.robot.joints))
        self._frame = Frame(self._frame.q if q is None else q, estimate, self._history.forces())
        self._arrival = time.monotonic()
        self.news.set()

    def _poll(self) -> None:
        while not self._over.is_set():
            try:
                # A reload or restart may bring another arm, which looks right where it has as many links.
                self._outdated = "" if self._calls.scene_fields() == self._served else OUTDATED
                health = self._calls.health()
                self._told = service_note(health)
                # A service that was started again may have no reactions any more.
                reactions = health.reactions.status != "off"
                latched = self._calls.reactions().latched if reactions else []
                self._latches = tuple(
                    Latch(latch.rule, f"{latch.rule}: {latch.force:.0f} N on {latch.link}")
                    for latch in latched
                )
            except LiveError as error:
                self._told = ServiceNote(literal(str(error)))
            self._over.wait(POLL)
