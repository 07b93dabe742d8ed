"""A proxy between the mock sensor and the service that spoils what passes: Net F/T over UDP.

It knows the protocol but nothing of the mock, so a fault is the same whatever makes the records.
"""

import random
import select
import socket
import struct
import threading
from collections.abc import Callable
from contextlib import suppress

SensorFault = Callable[["NetFtProxy", bytes], list[bytes]]
_RECORD = struct.Struct(">III6i")


class NetFtProxy:
    """Stands between a Net F/T sensor and one client. Set `fault` to spoil the records."""

    def __init__(self, host: str, port: int) -> None:
        self._sensor = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self._sensor.connect((host, port))
        self._client = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self._client.bind((host, 0))
        self.port: int = self._client.getsockname()[1]
        self._fault: SensorFault | None = None
        self.held: list[bytes] = []
        self.count = 0
        self.offset = 0
        self._stop = threading.Event()
        self._thread = threading.Thread(target=self._run, daemon=True)
        self._thread.start()

    @property
    def fault(self) -> SensorFault | None:
        return self._fault

    @fault.setter
    def fault(self, fault: SensorFault | None) -> None:
        self.held, self.count, self.offset = [], 0, 0
        self._fault = fault

    def close(self) -> None:
        self._stop.set()
        self._thread.join(5.0)
        self._sensor.close()
        self._client.close()

    def _run(self) -> None:
        address = None
        while not self._stop.is_set():
            for end in select.select([self._client, self._sensor], [], [], 0.1)[0]:
                with suppress(ConnectionError):
                    if end is self._client:
                        request, address = self._client.recvfrom(2048)
                        self._sensor.send(request)
                    else:
                        record = self._sensor.recv(2048)
                        self.count += 1
                        fault = self._fault
                        for datagram in [record] if fault is None else fault(self, record):
                            if address is not None:
                                self._client.sendto(datagram, address)


def _counts(change: Callable[[list[int]], list[int]]) -> SensorFault:
    def fault(proxy: NetFtProxy, record: bytes) -> list[bytes]:
        rdt, ft, status, *counts = _RECORD.unpack(record)
        return [_RECORD.pack(rdt, ft, status, *change(counts))]

    return fault


def _same(proxy: NetFtProxy, record: bytes) -> list[bytes]:
    if not proxy.held:
        proxy.held.append(record)
    return [record[:12] + proxy.held[0][12:]]


def _one_same(proxy: NetFtProxy, record: bytes) -> list[bytes]:
    if not proxy.held:
        proxy.held.append(record)
    return [record[:24] + proxy.held[0][24:28] + record[28:]]  # the moment about x


def _renumbered(by: int) -> SensorFault:
    """Numbers that start at `by`, or run ahead by it where it is positive."""

    def fault(proxy: NetFtProxy, record: bytes) -> list[bytes]:
        rdt, ft, *rest = _RECORD.unpack(record)
        if by > 0:
            return [_RECORD.pack((rdt + by) & 0xFFFFFFFF, (ft + by) & 0xFFFFFFFF, *rest)]
        return [_RECORD.pack(proxy.count, proxy.count, *rest)]

    return fault


def _reordered(proxy: NetFtProxy, record: bytes) -> list[bytes]:
    proxy.held.append(record)
    if len(proxy.held) < 4:
        return []
    held, proxy.held = proxy.held, []
    return [held[i] for i in (2, 0, 3, 1)]


SENSOR_FAULTS: dict[str, SensorFault] = {
    "mute": lambda proxy, record: [],
    "frozen": _same,
    "all zero": _counts(lambda counts: [0] * 6),
    "one component is frozen": _one_same,
    "one component is zero": _counts(lambda counts: [*counts[:2], 0, *counts[3:]]),
    "biased by 40 N": _counts(lambda counts: [counts[0] + 40_000_000, *counts[1:]]),
    "restarted, counts from 1": _renumbered(0),
    "counts 1e6 ahead": _renumbered(1_000_000),
    "reordered": _reordered,
    "doubled": lambda proxy, record: [record, record],
    "30 % lost": lambda proxy, record: [] if random.Random(proxy.count).random() < 0.3 else [record],
    "90 % lost": lambda proxy, record: [] if random.Random(proxy.count).random() < 0.9 else [record],
    "20 ms late": lambda proxy, record: _late_record(proxy, record, 20),
    "saturated": lambda proxy, record: [record[:8] + struct.pack(">I", 0x40000000) + record[12:]],
    "junk": lambda proxy, record: [random.Random(proxy.count).randbytes(36)],
    "bursts of 50 ms": lambda proxy, record: _burst(proxy, record, 50),
}


def _burst(proxy: NetFtProxy, record: bytes, size: int) -> list[bytes]:
    proxy.held.append(record)
    if len(proxy.held) < size:
        return []
    held, proxy.held = proxy.held, []
    return held


def _late_record(proxy: NetFtProxy, record: bytes, count: int) -> list[bytes]:
    """Each record so many later."""
    proxy.held.append(record)
    return [proxy.held.pop(0)] if len(proxy.held) > count else []
