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
        if path is None:
            self._times = np.zeros(SIZE, dtype=np.int64)
        else:
            exists = path.exists() and path.stat().st_size == SIZE * 8
            self._times = np.memmap(path, dtype=np.int64, mode="r+" if exists else "w+", shape=(SIZE,))

    def note(self, packet: int, host_ns: int) -> None:
        """Record that packet number `packet` leaves at this host time [ns]."""
        self._times[packet % len(self._times)] = host_ns

    def left_ns(self, timestamp: float) -> int:
        """Host time at which the packet with that time stamp left [ns]; 0 if there is none."""
        return int(self._times[round((timestamp - self._t0) * self._rate) % len(self._times)])
