"""A page that hangs: the others are sent every frame, and nothing piles up for it."""

import socket
import threading
from collections.abc import Iterator

import msgspec.msgpack
import numpy as np
import pytest
import viser
from websockets.client import ClientProtocol
from websockets.frames import Frame as WebSocketFrame
from websockets.frames import Opcode
from websockets.sync.client import connect
from websockets.typing import Subprotocol
from websockets.uri import parse_uri

from contactsense.benchmarks.live.viewer_clients import CAMERA, orientations
from contactsense.scene import Scene
from contactsense.service.scene.summary import link_places
from contactsense.service.viewer.arm_nodes import quaternion
from contactsense.service.viewer.frame import TRACKS, Forces, Frame
from contactsense.service.viewer.viewer import Viewer, run, serve_page
from tests.service.loopback import until
from tests.service.viewer.estimates import POSTURE

pytestmark = pytest.mark.long
SUBPROTOCOL = Subprotocol(f"viser-v{viser.__version__}")
LOOKS = msgspec.msgpack.encode(CAMERA)
SCENE = Scene(robot="ur5e")
FRAMES = 150
PATIENCE = 60.0
"""Longest time for the next message on a busy computer [s]."""


class HangingPage:
    """A page that looks at the viewer and then reads nothing until it is woken."""

    def __init__(self, port: int) -> None:
        self._socket = socket.socket()
        self._socket.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 4096)
        self._socket.connect(("127.0.0.1", port))
        uri = parse_uri(f"ws://127.0.0.1:{port}")
        self._protocol = ClientProtocol(uri, subprotocols=[SUBPROTOCOL], max_size=None)
        self._protocol.send_request(self._protocol.connect())
        self._send()
        answer = b""
        while not answer.endswith(b"\r\n\r\n"):
            answer += self._socket.recv(1)
        self._protocol.receive_data(answer)
        self._protocol.send_binary(LOOKS)
        self._send()

    def _send(self) -> None:
        for data in self._protocol.data_to_send():
            self._socket.sendall(data)

    def wake(self) -> Iterator[bytes]:
        """What it is sent, until nothing more comes."""
        message = b""
        self._socket.settimeout(3.0)
        while True:
            try:
                self._protocol.receive_data(self._socket.recv(1 << 16))
            except TimeoutError:
                return
            for event in self._protocol.events_received():
                if isinstance(event, WebSocketFrame) and event.opcode in (Opcode.BINARY, Opcode.CONT):
                    message += bytes(event.data)
                    if event.fin:
                        yield message
                        message = b""

    def close(self) -> None:
        self._socket.close()


def test_the_others_get_every_frame_and_nothing_piles_up() -> None:
    server = serve_page("127.0.0.1", 0)
    viewer = Viewer(server, SCENE)
    # More than the buffers of the system hold: a page that does not read is felt at once.
    server.scene.add_point_cloud("/ballast", np.zeros((1_000_000, 3)), (0, 0, 0), visible=False)
    over, drawn = threading.Event(), 0
    none = Forces(np.empty(0), np.empty((0, TRACKS)))

    def draw() -> None:
        nonlocal drawn
        drawn += 1
        viewer.draw(Frame(POSTURE + 0.001 * drawn, None, none))

    thread = threading.Thread(target=run, args=(draw, over))
    hanging = HangingPage(server.get_port())
    try:
        with connect(
            f"ws://127.0.0.1:{server.get_port()}", subprotocols=[SUBPROTOCOL], max_size=None
        ) as reading:
            reading.send(LOOKS)
            assert until(lambda: len(server.get_clients()) == 2, PATIENCE)
            thread.start()
            received = 0
            while received < FRAMES:
                window = reading.recv(PATIENCE)
                assert isinstance(window, bytes)
                received += len(orientations(window))
        over.set()
        thread.join()
        late = [orientation for window in hanging.wake() for orientation in orientations(window)]
        # What it was sent before it hung, and then at once the newest.
        assert 1 <= len(late) < FRAMES / 5
        newest = link_places(SCENE, POSTURE + 0.001 * drawn)
        turn = np.linalg.inv(newest[0]) @ newest[1]
        assert abs(quaternion(turn[:3, :3]) @ late[-1]) == pytest.approx(1.0, abs=1e-7)
    finally:
        over.set()
        hanging.close()
        viewer.close()
