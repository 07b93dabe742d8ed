"""RTDE server of a simulated UR controller at 500 Hz.

Two threads: one accepts clients and answers requests, the other sends packets at absolute deadlines
(`time.sleep` meets them within some tenths of a millisecond, asyncio's clock does not). Every packet is sent,
late ones at once, so a stall of the host appears as a delay, never as a missing sample.
"""

import math
import selectors
import socket
import threading
import time
from collections.abc import Callable
from contextlib import suppress

from contactsense.service.mock.interfaces.received_log import ReceivedLog
from contactsense.service.mock.interfaces.rtde_fields import Controller
from contactsense.service.mock.interfaces.sent_log import SentLog
from contactsense.service.mock.interfaces.wire_faults import Fault, mangle
from contactsense.service.mock.playback import NS, SimClock
from contactsense.service.wire import rtde as wire
from contactsense.service.wire import rtde_v1

PORT = 30004
"""Usual port of RTDE."""
RATE = 500.0
"""Packets per second of an e-Series controller [Hz]."""

_CHUNK = 1 << 16
_OUTPUT_SETUP = ord("O")


class _Client:
    """One connected client: its subscription and the data that waits to be sent."""

    def __init__(self, connection: socket.socket) -> None:
        self.connection = connection
        self.decoder = wire.FrameDecoder()
        self.lock = threading.Lock()
        self.pack: Callable[[float], bytes] | None = None
        self.version = 1
        self.frequency = RATE
        self.started = False
        self.inputs: dict[int, wire.Recipe] = {}
        self.backlog = bytearray()
        self.stuck_ns = 0
        self.half_sent = False
        self.rest = b""
        self.gone = False

    def is_due(self, k: int) -> bool:
        """Whether this client receives packet k of the controller's 500 Hz. The average rate is the requested
        one, because that frequency need not divide the controller's."""
        share = self.frequency / RATE
        return math.floor((k + 1) * share) > math.floor(k * share)

    def send(self, data: bytes, now_ns: int) -> None:
        """Send without waiting; data that the socket does not accept is kept. Call with the lock held."""
        self.backlog += data
        try:
            sent = self.connection.send(self.backlog)
        except BlockingIOError:
            sent = 0
        except OSError:
            self.gone = True
            return
        del self.backlog[:sent]
        if sent or not self.backlog:
            self.stuck_ns = now_ns

    def hang_up(self) -> None:
        """Close the connection; the thread that reads from this client wakes up and cleans up."""
        self.gone = True
        with suppress(OSError):
            self.connection.shutdown(socket.SHUT_RDWR)


class RtdeServer:
    """Serves the fields of a simulated controller to any number of RTDE clients.

    Args:
        controller: The source of the values.
        clock: Simulated time, shared with the other sensors.
        host: Address to listen on.
        port: Port to listen on; 0: any free port, see `port`.
        delay: Delay between the instant of the values and the sending of their packet [s].
        drop_after: A client that reads nothing for this time is disconnected, as by UR's controllers [s].
        sent: Log of the times at which packets were sent.
        received: Log of the times at which inputs were written.
    """

    def __init__(
        self,
        controller: Controller,
        clock: SimClock,
        *,
        host: str = "127.0.0.1",
        port: int = PORT,
        delay: float = 0.0,
        drop_after: float = 10.0,
        sent: SentLog | None = None,
        received: ReceivedLog | None = None,
    ) -> None:
        self.controller = controller
        self.host = host
        self.sent = sent or SentLog(rate=RATE)
        self._received = received
        self._clock = clock
        self._delay_ns = round(delay * NS)
        self._drop_ns = round(drop_after * NS)
        self._fault = Fault.NONE
        self._clients: list[_Client] = []
        self._clients_lock = threading.Lock()
        self._stopping = threading.Event()
        self._listener = socket.create_server((host, port), backlog=16)
        self._listener.setblocking(False)
        self.port: int = self._listener.getsockname()[1]
        """Port that clients connect to."""
        self._selector = selectors.DefaultSelector()
        self._selector.register(self._listener, selectors.EVENT_READ)
        self._wake, waker = socket.socketpair()
        self._waker = waker
        self._selector.register(self._wake, selectors.EVENT_READ)
        self._threads = [
            threading.Thread(target=self._answer, name=f"rtde-answers-{self.port}", daemon=True),
            threading.Thread(target=self._stream, name=f"rtde-packets-{self.port}", daemon=True),
        ]
        for thread in self._threads:
            thread.start()

    @property
    def clients(self) -> int:
        """Number of connected clients."""
        with self._clients_lock:
            return len(self._clients)

    @property
    def streams(self) -> int:
        """Number of clients that are sent packets."""
        with self._clients_lock:
            return sum(client.started for client in self._clients)

    @property
    def fault(self) -> Fault:
        """The injected fault; set it to make the server misbehave."""
        return self._fault

    @fault.setter
    def fault(self, fault: Fault) -> None:
        self._fault = self.controller.fault = fault
        if fault is Fault.CLOSE:
            self._everybody(_Client.hang_up)

    def say(self, message: str, *, source: str = "RTDE", level: int = 3) -> None:
        """Send a text message to all clients."""
        data = wire.encode(wire.TextMessage(message, source, level))
        self._everybody(lambda client: self._send(client, data))

    def close(self) -> None:
        """Disconnect all clients and stop."""
        self._stopping.set()
        with suppress(OSError):
            self._waker.send(b"x")
        for thread in self._threads:
            thread.join(5.0)
        self._everybody(lambda client: client.connection.close())
        self._clients.clear()
        for each in (self._listener, self._wake, self._waker):
            each.close()
        self._selector.close()

    def __enter__(self) -> "RtdeServer":
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def _everybody(self, action: Callable[[_Client], None]) -> None:
        with self._clients_lock:
            clients = list(self._clients)
        for client in clients:
            action(client)

    def _answer(self) -> None:
        while not self._stopping.is_set():
            for key, _ in self._selector.select(1.0):
                if key.fileobj is self._listener:
                    self._accept()
                elif isinstance(key.data, _Client):
                    self._read(key.data)

    def _accept(self) -> None:
        try:
            connection, _ = self._listener.accept()
        except OSError:
            return
        if self._fault is Fault.CLOSE:
            connection.close()
            return
        connection.setblocking(False)
        connection.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        client = _Client(connection)
        self._selector.register(connection, selectors.EVENT_READ, client)
        with self._clients_lock:
            self._clients.append(client)

    def _read(self, client: _Client) -> None:
        try:
            chunk = client.connection.recv(_CHUNK)
        except BlockingIOError:
            return
        except OSError:
            chunk = b""
        if not chunk or client.gone:
            self._forget(client)
            return
        if self._fault is Fault.MUTE:
            return
        client.decoder.feed(chunk)
        try:
            while (frame := client.decoder.next_frame()) is not None:
                old = client.version == 1 and frame.kind == _OUTPUT_SETUP
                request = rtde_v1.parse_output_setup(frame.payload) if old else wire.parse_request(frame)
                self._execute(client, request)
        except wire.RtdeProtocolError as error:
            self._send(client, wire.encode(wire.TextMessage(str(error), "RTDE", 0)))
            self._forget(client)

    def _forget(self, client: _Client) -> None:
        with self._clients_lock:
            if client in self._clients:
                self._clients.remove(client)
        self._selector.unregister(client.connection)
        with client.lock:
            client.gone = True
            client.connection.close()

    def _execute(self, client: _Client, request: wire.Request) -> None:
        reply: wire.Reply | None = None
        match request:
            case wire.ProtocolVersionRequest(version):
                accepted = version in (1, wire.PROTOCOL_VERSION)
                client.version = version if accepted else client.version
                reply = wire.ProtocolVersionReply(accepted)
            case wire.ControllerVersionRequest():
                reply = wire.ControllerVersion(*self.controller.version)
            case wire.OutputSetup():
                reply = self._set_up_outputs(client, request)
            case wire.InputSetup(names):
                reply = self._set_up_inputs(client, names)
            case wire.Start():
                client.started = client.pack is not None
                reply = wire.StartReply(client.started)
            case wire.Pause():
                client.started = False
                reply = wire.PauseReply(True)
            case wire.Data():
                self._take(client, request)
            case _:
                pass  # text messages would go to a log, which the mock does not have
        if reply is not None:
            answer = wire.encode(reply)
            outputs = isinstance(reply, wire.SetupReply) and not reply.inputs
            old = outputs and client.version == 1
            self._send(client, rtde_v1.without_recipe_number(answer) if old else answer)

    def _set_up_outputs(self, client: _Client, setup: wire.OutputSetup) -> wire.SetupReply:
        types = tuple(self.controller.output_types(setup.names))
        if not setup.names or "NOT_FOUND" in types or not 0.0 < setup.frequency <= RATE:
            return wire.SetupReply(False, 0, types)
        client.pack = self.controller.packer(wire.Recipe(1, setup.names, types))
        client.frequency = setup.frequency
        return wire.SetupReply(False, 1, types)

    def _set_up_inputs(self, client: _Client, names: tuple[str, ...]) -> wire.SetupReply:
        with self._clients_lock:
            others = [r for c in self._clients if c is not client for r in c.inputs.values()]
        taken = {name for recipe in others for name in recipe.names}
        known = zip(names, self.controller.input_types(names), strict=True)
        types = tuple("IN_USE" if name in taken else kind for name, kind in known)
        if not names or "NOT_FOUND" in types or "IN_USE" in types:
            return wire.SetupReply(True, 0, types)
        number = len(client.inputs) + 1
        client.inputs[number] = wire.Recipe(number, names, types)
        return wire.SetupReply(True, number, types)

    def _take(self, client: _Client, data: wire.Data) -> None:
        recipe = client.inputs.get(data.recipe_id)
        if recipe is None:
            raise wire.RtdeProtocolError(
                f"expected data of a recipe out of {sorted(client.inputs)}, got recipe {data.recipe_id}"
            )
        arrival = time.monotonic_ns()
        values = recipe.unpack(data.payload)
        self.controller.receive({name: values[where] for name, where in recipe.slices.items()})
        if self._received is not None:
            self._received.note(self.controller.inputs, arrival)

    def _send(self, client: _Client, data: bytes) -> None:
        with client.lock:
            if not client.gone:
                client.send(data, time.monotonic_ns())

    def _stream(self) -> None:
        k = max(0, int(self._clock.now() * RATE))
        while not self._stopping.is_set():
            # In steps: a clock that starts later does not delay `close`, and may be started meanwhile.
            while (deadline := self._deadline_ns(k)) - time.monotonic_ns() > NS // 5:
                if self._stopping.is_set():
                    return
                time.sleep(0.05)
            self._clock.sleep_until(deadline)
            self.controller.advance(k / RATE)
            with self._clients_lock:
                due = [c for c in self._clients if c.started and c.pack is not None and c.is_due(k)]
            now = time.monotonic_ns()
            if due:
                self.sent.note(k, now)
            for client in due:
                self._send_packet(client, k, now)
            k += 1

    def _deadline_ns(self, k: int) -> int:
        """Host time at which packet k is sent [ns]."""
        return self._clock.deadline_ns(k / RATE) + self._delay_ns

    def _send_packet(self, client: _Client, k: int, now: int) -> None:
        assert client.pack is not None
        packet = client.pack(k / RATE)
        if client.version == 1:
            packet = rtde_v1.without_recipe_number(packet)
        middle = len(packet) // 2
        if self._fault is Fault.HALF and not client.half_sent:
            client.half_sent = True
            data = packet[:middle]
        elif self._fault is Fault.SPLIT:
            data, client.rest = client.rest + packet[:middle], packet[middle:]
        else:
            data, client.rest = client.rest + mangle(self._fault, packet), b""
        with client.lock:
            if client.gone:
                return
            client.send(data, now)
        if client.backlog and now - client.stuck_ns > self._drop_ns:
            client.hang_up()
