"""Times at which robot packets left the mock: the start of a latency measurement, shared in a file."""

from pathlib import Path

import numpy as np

SIZE = 1 << 16
"""Number of past packets that can be looked up."""


class SentLog:
    """Host times by packet number, for the latest `SIZE` packets.

    Args:
        path: Shared file; None: this process only.
        rate: Packets per second [Hz]: packet k has the time stamp t0 + k / rate.
        t0: Time stamp of packet 0 [s].
    """

    def __init__(self, path: Path | None = None, *, rate: float = 500.0, t0: float = 0.0) -> None:
        self._rate = rate
        self._t0 = t0
        shape = (SIZE, 2)
        if path is None:
            self._rows = np.zeros(shape, dtype=np.int64)
        else:
            exists = path.exists() and path.stat().st_size == SIZE * 16
            self._rows = np.memmap(path, dtype=np.int64, mode="r+" if exists else "w+", shape=shape)
        """By packet number modulo SIZE: the number, by which it differs from those with the same remainder,
        and the host time."""

    def note(self, packet: int, host_ns: int) -> None:
        """Record that packet number `packet` leaves at this host time [ns]."""
        row = self._rows[packet % SIZE]
        # Readers in other processes find none rather than the time of another packet.
        row[1] = 0
        row[0] = packet
        row[1] = host_ns

    def left_ns(self, timestamp: float) -> int:
        """Host time at which the packet with that time stamp left [ns]; 0 if there is none."""
        packet = round((timestamp - self._t0) * self._rate)
        number, host_ns = self._rows[packet % SIZE]
        return int(host_ns) if number == packet else 0
