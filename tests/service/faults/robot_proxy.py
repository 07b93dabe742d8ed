"""A proxy between the mock arm and the service that spoils what passes: RTDE over TCP.

It knows the protocol but nothing of the mock, so a fault is the same whatever makes the packets.
"""

import math
import random
import select
import socket
import struct
import threading
from collections.abc import Callable, Sequence
from contextlib import suppress

from contactsense.service.wire.recipe import Number, Recipe

Values = list[Number]
RobotFault = Callable[["Link", bytes], list[bytes]]
"""Given a data packet, the packets that go out instead."""


class Link:
    """One direction of one RTDE connection: the recipe in use, and a memory for faults."""

    def __init__(self, names: Sequence[str]) -> None:
        self.names = tuple(names)
        self.recipe: Recipe | None = None
        self.held: bytes = b""
        self.queue: list[bytes] = []
        self.first: Values | None = None
        self.count = 0

    def edit(self, packet: bytes, change: Callable[[Values, "Recipe"], None]) -> bytes:
        """The packet with other values."""
        assert self.recipe is not None
        values = list(self.recipe.unpack(packet[3:]))
        change(values, self.recipe)
        return self.recipe.pack(values)


HANDSHAKES = {
    "closed": None,
    "mute": b"",
    "garbage": random.Random(1).randbytes(64),
    "wrong version": b"\x00\x04V\x00",
    "start refused": b"\x00\x04S\x00",
    "NOT_FOUND": b"\x00\x26O\x00DOUBLE,VECTOR6D,VECTOR6D,NOT_FOUND",
}
"""What a robot does to whoever connects: None: it hangs up; else what it answers, instead of the reply that
the third byte names, where that is one."""


class RtdeProxy:
    """Stands between a robot and its clients. Set `fault` to spoil the data packets, `handshake` to drop all
    clients and to receive them badly."""

    def __init__(self, host: str, port: int) -> None:
        self._target = (host, port)
        self.fault: RobotFault | None = None
        self._handshake: str | None = None
        self._dropped = 0
        self._listener = socket.create_server((host, 0))
        self.port: int = self._listener.getsockname()[1]
        self._stop = threading.Event()
        self._threads = [threading.Thread(target=self._accept, daemon=True)]
        self._threads[0].start()

    @property
    def handshake(self) -> str | None:
        """One of `HANDSHAKES`; None: as it should be."""
        return self._handshake

    @handshake.setter
    def handshake(self, name: str | None) -> None:
        self._dropped += name != self._handshake
        self._handshake = name

    def close(self) -> None:
        self._stop.set()
        with suppress(OSError):
            self._listener.shutdown(socket.SHUT_RDWR)
        self._listener.close()
        for thread in self._threads:
            thread.join(5.0)

    def _accept(self) -> None:
        while not self._stop.is_set():
            try:
                client, _ = self._listener.accept()
            except OSError:
                return
            try:
                robot = socket.create_connection(self._target, 2.0)
            except OSError:
                client.close()
                continue
            thread = threading.Thread(target=self._pass, args=(client, robot), daemon=True)
            thread.start()
            self._threads.append(thread)

    def _pass(self, client: socket.socket, robot: socket.socket) -> None:
        up, down, link = bytearray(), bytearray(), Link(())
        epoch, handshake = self._dropped, self._handshake
        if handshake == "closed":
            robot.close()
            client.close()
            return
        with client, robot, suppress(OSError):
            for end in (client, robot):
                end.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
            while not self._stop.is_set() and epoch == self._dropped:
                for end in select.select([client, robot], [], [], 0.1)[0]:
                    chunk = end.recv(1 << 16)
                    if not chunk:
                        return
                    if end is client:
                        up += chunk
                        for frame in _frames(up):
                            if frame[2:3] == b"O":
                                link = Link(frame[11:].decode().split(","))
                        robot.sendall(chunk)
                    else:
                        down += chunk
                        frames = [_received(frame, handshake) for frame in _frames(down)]
                        client.sendall(b"".join(self._spoiled(link, frame) for frame in frames if frame))

    def _spoiled(self, link: Link, frame: bytes) -> bytes:
        if frame[2:3] == b"O" and self._handshake is None:
            types = frame[4:].decode().split(",")
            link.recipe = Recipe(frame[3], link.names, types)
        if frame[2:3] != b"U" or self.fault is None or link.recipe is None:
            waiting, link.queue = b"".join(link.queue), []
            link.first, link.held = None, b""
            return waiting + frame
        link.count += 1
        return b"".join(self.fault(link, frame))


def _received(frame: bytes, handshake: str | None) -> bytes:
    """What a client hears of the robot's frame in that handshake."""
    if handshake is None:
        return frame
    reply = HANDSHAKES[handshake]
    assert reply is not None
    if handshake in ("mute", "garbage"):
        return reply
    return reply if frame[2:3] == reply[2:3] else frame


def _frames(buffer: bytearray) -> list[bytes]:
    found = []
    while len(buffer) >= 3:
        size = struct.unpack_from(">H", buffer)[0]
        if size < 3:  # no frame: passed on as it is
            size = len(buffer)
        if len(buffer) < size:
            break
        found.append(bytes(buffer[:size]))
        del buffer[:size]
    return found


def _set(name: str, value: float) -> RobotFault:
    def fault(link: Link, packet: bytes) -> list[bytes]:
        def change(values: Values, recipe: Recipe) -> None:
            where = recipe.slices[name]
            values[where] = [value] * (where.stop - where.start)

        return [link.edit(packet, change)]

    return fault


def _frozen(names: tuple[str, ...]) -> RobotFault:
    """Fields that keep their first value."""

    def fault(link: Link, packet: bytes) -> list[bytes]:
        def change(values: Values, recipe: Recipe) -> None:
            if link.first is None:
                link.first = list(values)
            for name in names:
                values[recipe.slices[name]] = link.first[recipe.slices[name]]

        return [link.edit(packet, change)]

    return fault


def _no_velocities(link: Link, packet: bytes) -> list[bytes]:
    """From the first packet on in which a joint moves with 0.2 rad/s: at the end of a movement nothing could
    tell of the fault before the next."""

    def change(values: Values, recipe: Recipe) -> None:
        velocities = values[recipe.slices["actual_qd"]]
        if link.first is None and max(map(abs, velocities)) > 0.2:
            link.first = list(values)
        if link.first is not None:
            values[recipe.slices["actual_qd"]] = [0.0] * len(velocities)

    return [link.edit(packet, change)]


def _one_of(name: str, joint: int, value: float | None) -> RobotFault:
    """One component of a field that keeps its first value, or has that value."""

    def fault(link: Link, packet: bytes) -> list[bytes]:
        def change(values: Values, recipe: Recipe) -> None:
            if link.first is None:
                link.first = list(values)
            place = recipe.slices[name].start + joint
            values[place] = link.first[place] if value is None else value

        return [link.edit(packet, change)]

    return fault


def _swapped(link: Link, packet: bytes) -> list[bytes]:
    if link.held:
        held, link.held = link.held, b""
        return [packet, held]
    link.held = packet
    return []


def _missing(link: Link, packet: bytes) -> list[bytes]:
    return [] if random.Random(link.count).random() < 0.1 else [packet]


def _doubled(link: Link, packet: bytes) -> list[bytes]:
    return [packet, packet]


def _held(count: int) -> RobotFault:
    """Bursts of that many packets."""

    def fault(link: Link, packet: bytes) -> list[bytes]:
        link.queue.append(packet)
        if len(link.queue) < count:
            return []
        packets, link.queue = link.queue, []
        return packets

    return fault


def _late(count: int) -> RobotFault:
    """Each packet so many later."""

    def fault(link: Link, packet: bytes) -> list[bytes]:
        link.queue.append(packet)
        return [link.queue.pop(0)] if len(link.queue) > count else []

    return fault


def _jitter(link: Link, packet: bytes) -> list[bytes]:
    link.queue.append(packet)
    if len(link.queue) < random.Random(link.count).randint(1, 6):
        return []
    packets, link.queue = link.queue, []
    return packets


def _spikes(link: Link, packet: bytes) -> list[bytes]:
    def change(values: Values, recipe: Recipe) -> None:
        where = recipe.slices[TORQUE]
        values[where] = [300.0 * (-1.0) ** link.count] * (where.stop - where.start)

    return [link.edit(packet, change) if link.count % 100 == 0 else packet]


TORQUE = "actual_current_as_torque"
ROBOT_FAULTS: dict[str, RobotFault] = {
    "q is NaN": _set("actual_q", math.nan),
    "torque is NaN": _set(TORQUE, math.nan),
    "stamp is NaN": _set("timestamp", math.nan),
    "stamp is frozen": _frozen(("timestamp",)),
    "all but the stamp is frozen": _frozen(("actual_q", "actual_qd", TORQUE)),
    "torque is frozen": _frozen((TORQUE,)),
    "one torque is frozen": _one_of(TORQUE, 2, None),
    "one torque is zero": _one_of(TORQUE, 1, 0.0),
    "velocities are zero": _no_velocities,
    "pairs are swapped": _swapped,
    "10 % are missing": _missing,
    "doubled": _doubled,
    "spikes of 300 Nm": _spikes,
    "velocities are absurd": _set("actual_qd", 1e300),
    "bursts of 50 ms": _held(25),
    "bursts of 400 ms": _held(200),
    "100 ms late": _late(50),
    "jitter of 12 ms": _jitter,
}
