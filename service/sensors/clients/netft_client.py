"""ATI Net F/T (and Axia, OnRobot HEX: the same protocol) read through pynetft.

pynetft receives in its own thread, timestamps every record on arrival and reconnects automatically. This
module converts its readings to newtons and newton metres, and its errors to one readable line.
"""

import threading
import time
from collections.abc import Iterator
from contextlib import suppress
from dataclasses import dataclass, replace
from typing import NamedTuple

import pynetft

from contactsense.sensors.force_units import (
    KILOGRAM_FORCE,
    POUND_FORCE,
    POUND_FORCE_FOOT,
    POUND_FORCE_INCH,
)
from contactsense.service.sensors.clients import receive_buffer
from contactsense.service.sensors.clients.host_names import HostName
from contactsense.service.sensors.clients.robot_stream import Backoff, SensorError, State

DEFAULT_PORT = 49152
DEFAULT_HTTP_PORT = 80

_QUEUE = 8192
"""Readings that pynetft keeps until they are fetched."""
_STUCK = 0.25
"""If all records are rejected for this long, the sensor has reset its counter [s]."""
_STUCK_RECORDS = 20
"""The same, as a number of records."""
_RETRY = 0.5
"""Longest pause between two attempts to connect [s]: a sensor that is back is read soon."""
_NEWTON = {
    pynetft.ForceUnit.NEWTON: 1.0,
    pynetft.ForceUnit.KILO_NEWTON: 1e3,
    pynetft.ForceUnit.KILOGRAM_FORCE: KILOGRAM_FORCE,
    pynetft.ForceUnit.POUND_FORCE: POUND_FORCE,
    pynetft.ForceUnit.KILO_POUND_FORCE: 1e3 * POUND_FORCE,
}
_NEWTON_METRE = {
    pynetft.TorqueUnit.NEWTON_METER: 1.0,
    pynetft.TorqueUnit.NEWTON_MILLIMETER: 1e-3,
    pynetft.TorqueUnit.KILO_NEWTON_METER: 1e3,
    pynetft.TorqueUnit.KILOGRAM_FORCE_CENTIMETER: 1e-2 * KILOGRAM_FORCE,
    pynetft.TorqueUnit.POUND_FORCE_INCH: POUND_FORCE_INCH,
    pynetft.TorqueUnit.POUND_FORCE_FOOT: POUND_FORCE_FOOT,
}
_STATES: dict[pynetft.ClientState, State] = {
    pynetft.ClientState.STOPPED: "closed",
    pynetft.ClientState.CONNECTING: "connecting",
    pynetft.ClientState.STREAMING: "streaming",
    pynetft.ClientState.BACKOFF: "waiting",
    pynetft.ClientState.FAULTED: "waiting",
}


class WrenchRecord(NamedTuple):
    """One reading of a force/torque sensor, in the sensor's own frame and sign."""

    tick: int
    """Sequence number of the reading, which serves as the sensor's clock, modulo 2^32."""
    arrival_ns: int
    """Time of reception on the host's monotonic clock [ns]."""
    wrench: tuple[float, float, float, float, float, float]
    """Force then moment about the sensor's origin, sensor axes [N, Nm]."""


@dataclass(frozen=True, slots=True)
class WrenchHealth:
    """Statistics of the sensor's stream since it was opened."""

    state: State
    error: str
    """The latest problem in one readable line; kept after recovery."""
    received: int
    lost: int
    """Missing records, by sequence number or because they were not fetched (`overrun`)."""
    duplicates: int
    out_of_order: int
    malformed: int
    device_errors: int
    """Records that the sensor itself marked as bad (out of range, or worse); not delivered."""
    reconnects: int
    overrun: int
    """Readings dropped because they were not fetched."""
    rate: float
    """Rate of received records over the last second [Hz]."""
    age: float | None
    """Time since the latest record [s]; None before the first."""
    restarts: int = 0
    """How often the sensor reset its sequence number, as after a restart."""


class NetFtStream:
    """An endless stream of readings of a Net F/T sensor; pynetft retries a silent or absent sensor.

    pynetft rejects records whose sequence number is below the highest one seen. After a restart of the
    sensor, or a record with damaged numbers, it would do so forever; a new client is then created, as for a
    silent sensor whose name has got another address.

    Args:
        host: Name or address of the sensor.
        port: UDP port of its Raw Data Transfer.
        http_port: TCP port of its web server, which provides the counts per unit.
        counts: Counts per newton and per newton metre, instead of querying the web server.
        timeout: Maximum silence before the stream counts as interrupted and is requested again [s].

    Raises:
        SensorError: An argument is invalid.
    """

    def __init__(
        self,
        host: str,
        *,
        port: int = DEFAULT_PORT,
        http_port: int = DEFAULT_HTTP_PORT,
        counts: tuple[float, float] | None = None,
        timeout: float = 0.2,
    ) -> None:
        self._place = f"force/torque sensor at {host}:{port}"
        self._page = f"force/torque sensor at {host}: its configuration page on port {http_port}"
        calibration = None
        if counts is not None:
            calibration = pynetft.Calibration(
                counts[0], counts[1], pynetft.ForceUnit.NEWTON, pynetft.TorqueUnit.NEWTON_METER
            )
        self._config = pynetft.Config(
            sensor_host=host,
            rdt_port=port,
            http_port=http_port,
            receive_timeout=timeout,
            reconnect_initial_delay=0.05,
            reconnect_max_delay=_RETRY,
            calibration_override=calibration,
        )
        try:
            pynetft.Client(self._config)  # only checks it: the name's address is not known yet
        except (pynetft.NetFTError, ValueError) as error:
            raise SensorError(f"{self._place}: {error}") from None
        self._name = HostName(host)
        self._address = ""
        self._start_error = ""
        self._backoff = Backoff(limit=_RETRY)
        self._client: pynetft.Client | None = None
        self._buffered: int | None = None
        self._past = WrenchHealth("connecting", "", 0, 0, 0, 0, 0, 0, 0, 0, 0.0, None)
        self._restarts = 0
        self._delivered_at = time.monotonic()
        self._refused_at_delivery = 0
        self._look_at = 0.0
        self._closed = False
        self._connect()

    def _connect(self) -> None:
        """Start a client as soon as the sensor's address is known."""
        if self._client is not None or self._backoff.wait(time.monotonic_ns()) > 0.0:
            return
        try:
            address = self._name.address()
        except SensorError as error:
            self._start_error = f"{self._place}: {error}"
            return
        if address is not None:
            self._start(address)

    def _start(self, address: str) -> None:
        client = pynetft.Client(replace(self._config, sensor_host=address), queue_size=_QUEUE)
        try:
            client.start()
        except (pynetft.NetFTError, RuntimeError) as error:
            self._start_error = f"{self._place}: its client cannot be started: {error}"
            self._backoff.failed(time.monotonic_ns())
            return
        self._client, self._address, self._start_error = client, address, ""
        self._buffered = None
        self._backoff.succeeded()
        self._delivered_at, self._refused_at_delivery = time.monotonic(), 0

    def _restart(self, address: str, why: str) -> None:
        assert self._client is not None
        self._past = replace(self.health, error=f"{self._place} {why}")
        # Stopping waits for the client's thread.
        threading.Thread(target=self._client.stop, name="stop pynetft", daemon=True).start()
        self._client = None
        self._start(address)

    def _restart_where_stuck(self, now: float) -> None:
        assert self._client is not None
        health = self._client.health()
        refused = health.out_of_order_count + health.duplicate_count + health.ft_backward_count
        if now - self._delivered_at < _STUCK:
            self._refused_at_delivery = refused
        elif refused - self._refused_at_delivery >= _STUCK_RECORDS:
            self._restarts += 1
            self._restart(self._address, "counts its readings anew, as after a restart")

    def _enlarge_buffer(self) -> None:
        """Let the connection's socket hold seconds of readings: pynetft opens one for each connection."""
        assert self._client is not None
        health = self._client.health()
        connection = health.reconnect_count
        if health.state == pynetft.ClientState.STREAMING and connection != self._buffered:
            receive_buffer.enlarge((self._address, self._config.rdt_port))
            self._buffered = connection

    def _restart_where_moved(self) -> None:
        """Look up the name of a silent sensor again, and read the sensor at its new address."""
        if self._client is None or self._client.health().state == pynetft.ClientState.STREAMING:
            return
        try:
            address = self._name.address()
        except SensorError:
            return  # without a resolver, the address that was found before is the best
        if address == self._address:
            self._name.forget()
        elif address is not None:
            self._restart(address, f"has another address: expected {self._address}, got {address}")

    def poll(self, timeout: float = 0.0) -> list[WrenchRecord]:
        """Readings received, oldest first; waits up to `timeout` seconds for the first. Raises nothing: the
        health says why there are none."""
        records: list[WrenchRecord] = []
        if self._closed:
            return records
        self._connect()
        if self._client is None:
            return records
        if timeout > 0.0:
            self._read(self._client.samples(timeout), records, 1)
        self._read(self._client.samples(0.0), records, _QUEUE)
        now = time.monotonic()
        if records:
            self._delivered_at = now
        if self._buffered is None or now - self._look_at > 0.1:
            self._enlarge_buffer()
        if now - self._look_at > 0.1:
            self._look_at = now
            self._restart_where_stuck(now)
            self._restart_where_moved()
        return records

    @staticmethod
    def _read(samples: Iterator[pynetft.Sample], records: list[WrenchRecord], limit: int) -> None:
        # The iterator raises an error when the queue is empty.
        with suppress(TimeoutError):
            for sample in samples:
                n, nm = _NEWTON[sample.force_unit], _NEWTON_METRE[sample.torque_unit]
                (fx, fy, fz), (mx, my, mz) = sample.force, sample.torque
                wrench = (fx * n, fy * n, fz * n, mx * nm, my * nm, mz * nm)
                records.append(WrenchRecord(sample.ft_sequence, sample.received_at_ns, wrench))
                limit -= 1
                if limit == 0:
                    return

    @property
    def health(self) -> WrenchHealth:
        """Counters and the latest problem."""
        past = self._past
        if self._client is None:
            error = self._start_error or past.error
            return replace(past, state="closed" if self._closed else "waiting", error=error, rate=0.0)
        now = self._client.health()
        error = self._explain(now) if now.last_error else past.error
        return WrenchHealth(
            state="closed" if self._closed else _STATES[now.state],
            error=error,
            received=past.received + now.received_count,
            lost=past.lost + now.lost_count + now.python_queue_dropped_count,
            duplicates=past.duplicates + now.duplicate_count,
            out_of_order=past.out_of_order + now.out_of_order_count,
            malformed=past.malformed + now.malformed_count,
            device_errors=past.device_errors + now.device_error_count,
            reconnects=past.reconnects + now.reconnect_count,
            overrun=past.overrun + now.python_queue_dropped_count,
            restarts=self._restarts,
            rate=now.receive_rate_hz,
            age=now.last_record_age,
        )

    def _explain(self, now: pynetft.Health) -> str:
        error = now.last_error
        if error.startswith("no valid RDT record"):
            return f"{self._place}: silent, it sends no readings"
        if error.startswith("serious device status"):
            status = f"status {now.last_status:#010x}"
            return f"{self._place}: it marks its readings as bad ({status}); beyond its range?"
        if error.startswith("sensor configuration request failed: "):
            return f"{self._page} cannot be read: {error.partition(': ')[2]}"
        if error.startswith("sensor configuration"):
            return f"{self._page} is not that of a Net F/T sensor: {error}"
        return f"{self._place}: {error}"

    def close(self) -> None:
        """Tell the sensor to stop sending, and close the connection."""
        self._closed = True
        if self._client is not None:
            self._client.stop()
