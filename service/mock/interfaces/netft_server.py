"""Simulates an ATI Net F/T sensor for its clients: RDT over UDP and the configuration page over HTTP.

The sensor is under the base of the simulated arm and uses the same clock as the RTDE server.
"""

import select
import socket
import threading
import time
from collections.abc import Callable
from contextlib import suppress
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from typing import Any

import numpy as np

from contactsense.service.mock.playback import NS, SimClock
from contactsense.service.wire import netft as wire


class _Stream:
    """The stream that one client has requested."""

    def __init__(self, count: int) -> None:
        self.sequence = 0
        self.left = count  # 0: unlimited


class NetFtServer:
    """Serves a sensor's readings to any number of RDT clients.

    Args:
        reading: Returns the sensor's reading at a simulated time [s]: force then moment, shape (6,) [N, Nm].
        clock: Simulated time, shared with the robot.
        host: Address to listen on.
        port: UDP port; 0: any free port, see `port`.
        http_port: TCP port of the configuration page; 0: any free port, see `http_port`.
        rate: Readings per second [Hz].
        configuration: Counts per unit and units (`N`, `Nm` or `Nmm`).
        limits: Largest force and moment component in the sensor's range [N, Nm]; readings beyond it are
            marked as invalid.
        delay: Delay between the instant of the values and the sending of their record [s].
        clock_scale: Factor by which the sensor's clock is too fast.
    """

    def __init__(
        self,
        reading: Callable[[float], np.ndarray],
        clock: SimClock,
        *,
        host: str = "127.0.0.1",
        port: int = 49152,
        http_port: int = 0,
        rate: float = 1000.0,
        configuration: wire.Configuration | None = None,
        limits: tuple[float, float] = (2000.0, 2000.0),
        delay: float = 0.0,
        clock_scale: float = 1.0,
    ) -> None:
        self.host = host
        self._reading = reading
        self._clock = clock
        self._rate = rate * clock_scale
        self._delay_ns = round(delay * NS)
        self._configuration = configuration or wire.Configuration()
        self._limits = np.repeat(limits, 3)
        self._scale = self._counts_per_unit()
        self._bias = np.zeros(6)
        self.mute = False
        """Set to send no readings and answer no requests."""
        self.status = 0
        """Status word of all records; a nonzero value marks them as invalid."""
        self._streams: dict[tuple[str, int], _Stream] = {}
        self._stopping = threading.Event()
        self._socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self._socket.bind((host, port))
        self._socket.setblocking(False)
        self.port: int = self._socket.getsockname()[1]
        """UDP port that clients send their requests to."""
        self._http = _page_server(host, http_port, self._configuration.encode())
        self.http_port: int = self._http.server_address[1]
        """TCP port of the configuration page."""
        self._threads = [
            threading.Thread(target=self._run, name=f"netft-readings-{self.port}", daemon=True),
            threading.Thread(
                target=self._http.serve_forever, args=(0.05,), name=f"netft-page-{self.http_port}"
            ),
        ]
        for thread in self._threads:
            thread.start()

    def _counts_per_unit(self) -> np.ndarray:
        units = {"N": 1.0, "Nm": 1.0, "N-m": 1.0, "Nmm": 1e3, "N-mm": 1e3}
        configuration = self._configuration
        force = configuration.counts_per_force * units[configuration.force_unit]
        torque = configuration.counts_per_torque * units[configuration.torque_unit]
        return np.repeat((force, torque), 3)

    @property
    def clients(self) -> int:
        """Number of clients that receive records."""
        return len(self._streams)

    def close(self) -> None:
        """Stop the server."""
        self._stopping.set()
        self._http.shutdown()
        for thread in self._threads:
            thread.join(5.0)
        self._http.server_close()
        self._socket.close()

    def __enter__(self) -> "NetFtServer":
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def _run(self) -> None:
        k = max(0, int(self._clock.now() * self._rate))
        while not self._stopping.is_set():
            # As in the RTDE server.
            while (deadline := self._deadline_ns(k)) - time.monotonic_ns() > NS // 5:
                if self._stopping.is_set():
                    return
                time.sleep(0.05)
                self._read()
            if not self._streams:
                # No clients: no need to wake up for every reading.
                select.select([self._socket], [], [], 0.1)
                self._read()
                k = max(k, int(self._clock.now() * self._rate) + 1)
                continue
            self._clock.sleep_until(deadline)
            self._read()
            if not self.mute:
                self._send(k)
            k += 1

    def _deadline_ns(self, k: int) -> int:
        """Host time at which record k is sent [ns]."""
        return self._clock.deadline_ns(k / self._rate) + self._delay_ns

    def _read(self) -> None:
        while True:
            try:
                datagram, address = self._socket.recvfrom(1500)
            except (BlockingIOError, ConnectionError):
                return
            if self.mute:
                continue
            with suppress(wire.RdtProtocolError):
                self._execute(wire.parse_request(datagram), address)

    def _execute(self, request: wire.Request, address: tuple[str, int]) -> None:
        match request.command:
            case wire.Command.START_REALTIME | wire.Command.START_BUFFERED:
                self._streams[address] = _Stream(request.count)
            case wire.Command.STOP:
                self._streams.pop(address, None)
            case wire.Command.SET_BIAS:
                self._bias = np.rint(self._reading(self._clock.now()) * self._scale)

    def _send(self, k: int) -> None:
        reading = self._reading(k / self._rate)
        value = np.rint(reading * self._scale) - self._bias
        counts, clipped = wire.to_counts(value.tolist(), 1.0)
        bad = clipped or bool(np.any(np.abs(reading) > self._limits))
        status = self.status or (wire.SATURATED if bad else 0)
        for address, stream in list(self._streams.items()):
            stream.sequence = (stream.sequence + 1) & 0xFFFFFFFF
            record = wire.Record(stream.sequence, k & 0xFFFFFFFF, status, tuple(counts))  # type: ignore[arg-type]
            try:
                self._socket.sendto(record.encode(), address)
            except BlockingIOError:
                continue  # as on a real network: a datagram that does not fit the buffer is lost
            except OSError:
                self._streams.pop(address, None)
                continue
            stream.left -= 1
            if stream.left == 0:
                self._streams.pop(address, None)


def _page_server(host: str, port: int, page: bytes) -> ThreadingHTTPServer:
    class Handler(BaseHTTPRequestHandler):
        def do_GET(self) -> None:
            """Answer with the configuration page, or with 404."""
            found = self.path == wire.CONFIGURATION_PATH
            body = page if found else b""
            with suppress(ConnectionError):  # the client did not wait for the answer
                self.send_response(200 if found else 404)
                self.send_header("Content-Type", "text/xml")
                self.send_header("Content-Length", str(len(body)))
                self.end_headers()
                self.wfile.write(body)

        def log_message(self, format: str, *args: Any) -> None:
            """Log nothing."""

    server = ThreadingHTTPServer((host, port), Handler)
    server.daemon_threads = True
    return server
