"""One controller's stream of samples, in a separate process: one message in, one message out."""

import contextlib
import signal
import socket
from typing import Any

from contactsense import Localizer, Scene
from contactsense.service.controllers.framing import Unframer, frame
from contactsense.service.controllers.sample_message import (
    MessageError,
    SampleDecoder,
    decode,
    encode,
)
from contactsense.service.controllers.sample_times import SampleTimes
from contactsense.service.controllers.scene_message import make_scene
from contactsense.service.events.summary import ContactSummaries
from contactsense.service.live.estimate_json import estimate_dict, estimate_json
from contactsense.service.live.hub import with_events
from contactsense.service.live.scheduling import PIPELINE, Scheduling, prefer_low_latency, prioritize
from contactsense.service.process_argument import receive

_CHUNK = 1 << 16


class TrackSession:
    """Answers the messages of one connection. The first may contain a scene; otherwise `scene` is used.

    After a scene that is refused no sample is estimated until another one is accepted: estimates with the
    service's own scene would be those of another arm or cell.
    """

    def __init__(self, scene: Scene) -> None:
        self._scene = scene
        self._localizer: Localizer | None = None
        self._refused = False
        self._decoder = SampleDecoder(scene)
        self._times = SampleTimes()
        self._summaries = ContactSummaries()

    @property
    def loaded(self) -> bool:
        """Whether the localizer has been loaded, which happens at the first sample."""
        return self._localizer is not None

    def answer(self, message: bytes, binary: bool) -> bytes:
        """Return the estimate for the sample in a message, or an error that names the invalid field."""
        try:
            content = decode(message, binary)
            if "scene" in content:
                return encode(self._take_scene(content), binary)
            if self._refused:
                raise MessageError("scene", "the last one was refused: expected another before any sample")
            sample = self._decoder.sample(content, len(message))
            self._times.checked(sample.t)
        except MessageError as error:
            return error_message(error, binary)
        if self._localizer is None:
            self._localizer = Localizer(self._scene)
        estimate = self._localizer.step(sample)
        events = self._summaries.update(estimate, "")
        if not binary:
            return with_events(
                estimate_json(estimate), [event.model_dump_json().encode() for event in events]
            )
        return encode({**estimate_dict(estimate), "events": [event.model_dump() for event in events]}, binary)

    def _take_scene(self, content: dict[str, Any]) -> dict[str, Any]:
        if self._localizer is not None:
            raise MessageError("scene", "expected in the first message only; connect again for another")
        self._refused = True
        if len(content) > 1:
            raise MessageError("scene", "expected alone in its message, samples follow")
        scene = make_scene(content["scene"])
        try:
            self._localizer = Localizer(scene)
        except ValueError as error:
            raise MessageError("scene", str(error)) from None
        self._scene, self._decoder, self._refused = scene, SampleDecoder(scene), False
        return {
            "robot": scene.robot.name,
            "links": list(scene.link_names),
            "joints": [joint.name for joint in scene.robot.joints],
        }


def error_message(error: MessageError, binary: bool) -> bytes:
    """Encode an error as a message of the form `ErrorOut`."""
    return encode({"errors": [{"field": error.field, "reason": error.reason}]}, binary)


def work(connection: socket.socket) -> None:
    """Main function of the process, which first receives the scene. Returns when the service closes the
    connection."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # the service shuts this process down in order
    in_time: Scheduling | None = None
    with connection, contextlib.suppress(BrokenPipeError, ConnectionResetError):
        session, unframer = TrackSession(receive(connection)), Unframer()
        while chunk := connection.recv(_CHUNK):
            for message, binary in unframer.feed(chunk):
                connection.sendall(frame(session.answer(message, binary), binary))
            if session.loaded and not in_time:  # not before the kernels are compiled, which may take minutes
                in_time = prioritize(PIPELINE)
                prefer_low_latency()
