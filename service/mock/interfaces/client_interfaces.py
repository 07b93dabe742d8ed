"""The primary, secondary and real-time interfaces of a UR controller: they receive programs and send states.

Packages as in Universal Robots, "Remote Control via TCP/IP" (client interfaces 5.10): the version message at
the beginning; robot states ten times a second, with the mode, the joints and the pose; on the real-time port
the state of 1220 bytes 125 times a second. Fields that the mock does not simulate are 0.
"""

import struct
from typing import Literal

import numpy as np

from contactsense.service.mock.controller.robot_state import Reading, RuntimeState
from contactsense.service.mock.interfaces.live_fields import LiveController, tcp_pose
from contactsense.service.mock.interfaces.tcp_server import Connection, TcpServer
from contactsense.service.mock.urscript.parser import ProgramReader

PRIMARY, SECONDARY, REALTIME = 30001, 30002, 30003
"""The usual ports."""

Interface = Literal["primary", "secondary", "realtime"]

_STATE, _MESSAGE = 16, 20
_MODE_DATA, _JOINT_DATA, _CARTESIAN = 0, 1, 4
_VERSION_MESSAGE, _TEXT_MESSAGE = 3, 0
_CONTROLLER = 254  # -2: who sends the message
_RUNNING = 7
_JOINT_RUNNING = 253
_REALTIME_DOUBLES = 152
_REALTIME_FIELDS = (
    "target_q",
    "target_qd",
    "target_qdd",
    "target_current",
    "target_moment",
    "actual_q",
    "actual_qd",
    "actual_current",
    "joint_control_output",
    "actual_TCP_pose",
    "actual_TCP_speed",
    "actual_TCP_force",
    "target_TCP_pose",
    "target_TCP_speed",
)
"""Fields after the time, in order, six numbers each."""


class ClientInterface(TcpServer):
    """One of the three interfaces.

    Args:
        controller: The simulated controller.
        interface: Which one.
        host, port: Where to listen; port 0: any free port.
    """

    def __init__(
        self, controller: LiveController, interface: Interface, *, host: str = "127.0.0.1", port: int
    ) -> None:
        super().__init__(host, port, 0.008 if interface == "realtime" else 0.1)
        self._controller = controller
        self._interface = interface
        self._readers: dict[Connection, ProgramReader] = {}
        self._messages: list[str] = []
        if interface == "primary":
            controller.robot.on_message.append(self._messages.append)
        self.start()

    def greet(self, connection: Connection) -> None:
        """Send the version message."""
        self._readers[connection] = ProgramReader()
        if self._interface != "realtime":
            connection.send(version_message(self._controller.version))

    def receive(self, connection: Connection, data: bytes) -> None:
        """Run the programs that have arrived."""
        for program in self._readers[connection].feed(data):
            self._controller.robot.run(program)

    def tick(self) -> None:
        """Send the state."""
        self._readers = {c: reader for c, reader in self._readers.items() if c in self.connections}
        messages, self._messages[:] = list(self._messages), []
        if not self.connections:
            return
        robot = self._controller.robot
        reading = robot.at(robot.now)
        if self._interface == "realtime":
            self.send_all(realtime_state(reading, self._controller))
            return
        for message in messages:
            self.send_all(text_message(reading.t, message))
        self.send_all(robot_state(reading, self._controller))


def version_message(version: tuple[int, int, int, int]) -> bytes:
    """Message with the version of the software."""
    name = b"URControl"
    major, minor, bugfix, build = version
    body = struct.pack(">QBBB", 0, _CONTROLLER, _VERSION_MESSAGE, len(name)) + name
    body += struct.pack(">BBii", major, minor, bugfix, build) + b"01-01-2026, 00:00:00"
    return _package(_MESSAGE, body)


def text_message(t: float, text: str) -> bytes:
    """Message with a text."""
    body = struct.pack(">QBB", round(1e6 * t), _CONTROLLER, _TEXT_MESSAGE)
    return _package(_MESSAGE, body + text.encode("utf-8", "replace"))


def robot_state(reading: Reading, controller: LiveController) -> bytes:
    """State package: mode, joints, pose."""
    playing = reading.runtime is not RuntimeState.STOPPED
    mode = struct.pack(
        ">Q7?BBdddB",
        round(1e6 * reading.t),
        True,
        True,
        True,
        False,
        reading.protective,
        playing,
        reading.runtime is RuntimeState.PAUSED,
        _RUNNING,
        0,
        reading.slider,
        reading.speed,
        1.0,
        0,
    )
    current = controller.moving_field("actual_current")
    amperes = current(reading.t) if current else (0.0,) * 6
    joints = b"".join(
        struct.pack(">dddffffB", q, target, qd, ampere, 48.0, 30.0, 30.0, _JOINT_RUNNING)
        for q, target, qd, ampere in zip(reading.q, reading.target[0], reading.qd, amperes, strict=True)
    )
    pose = struct.pack(">12d", *tcp_pose(reading, controller), *([0.0] * 6))
    parts = [(_MODE_DATA, mode), (_JOINT_DATA, joints), (_CARTESIAN, pose)]
    return _package(_STATE, b"".join(_package(kind, body) for kind, body in parts))


def realtime_state(reading: Reading, controller: LiveController) -> bytes:
    """Package of the real-time interface."""
    values = np.zeros(_REALTIME_DOUBLES)

    def put(first: int, name: str) -> None:
        get = controller.moving_field(name)
        if get is not None:
            row = get(reading.t)
            values[first : first + len(row)] = row

    values[0] = reading.t
    for number, name in enumerate(_REALTIME_FIELDS):
        put(1 + 6 * number, name)
    values[86:92] = 30.0  # motor temperatures
    values[94] = _RUNNING
    values[95:101] = _JOINT_RUNNING
    put(101, "safety_mode")
    values[117] = reading.speed
    values[121:123] = 48.0
    values[124:130] = 48.0
    values[131] = int(reading.runtime)
    put(132, "elbow_position")
    put(138, "safety_status")
    return struct.pack(f">i{_REALTIME_DOUBLES}d", 4 + 8 * _REALTIME_DOUBLES, *values)


def _package(kind: int, body: bytes) -> bytes:
    return struct.pack(">iB", 5 + len(body), kind) + body
