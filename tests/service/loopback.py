"""Helpers for tests over loopback: a small motion to serve, addresses of one's own, peers of few words."""

import os
import socket
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field

import numpy as np

from contactsense.service.mock.interfaces.playback_fields import PlaybackController
from contactsense.service.mock.interfaces.rtde_server import RtdeServer
from contactsense.service.mock.playback import NS, Playback, SimClock


def _columns(rate: float, n: int) -> np.ndarray:
    return np.sin(np.outer(np.arange(n) / rate, np.arange(1, 7)))


@dataclass(frozen=True)
class SmallFeed:
    """Ten seconds of six joints; every number differs from sample to sample."""

    rate: float = 500.0
    n: int = 5000
    t0: float = 0.0
    base_wrench: np.ndarray = field(default_factory=lambda: np.zeros((5000, 6)))

    @property
    def t(self) -> np.ndarray:
        return self.t0 + np.arange(self.n) / self.rate

    @property
    def q(self) -> np.ndarray:
        return _columns(self.rate, self.n)

    @property
    def qd(self) -> np.ndarray:
        rates = np.arange(1, 7)
        return rates * np.cos(np.outer(np.arange(self.n) / self.rate, rates))

    @property
    def joint_torque(self) -> np.ndarray:
        return 10.0 * _columns(self.rate, self.n) + 1.0


FEED = SmallFeed()


@contextmanager
def rtde_server(feed=FEED, *, host="127.0.0.1", port=0, version=(5, 23, 0, 0), fields=None, **options):
    """A mock controller on a free port."""
    playback = Playback(feed, loop=True)
    controller = PlaybackController(feed, playback, version=version, fields=fields)
    with RtdeServer(controller, SimClock(), host=host, port=port, **options) as server:
        yield server


def waiting_clock() -> SimClock:
    """Simulated time that waits for its start: a busy computer connects late."""
    return SimClock(time.monotonic_ns() + 3600 * NS)


def own_address() -> str:
    """A loopback address that no other test process uses: ur_rtde knows only one port."""
    global _count
    _count += 1
    pid = os.getpid()
    return f"127.{64 + pid % 64}.{pid // 64 % 256}.{_count % 250 + 1}"


_count = 0


def until(condition: Callable[[], object], timeout: float = 30.0, step: float = 0.005) -> bool:
    """Wait for something to come true; it is tried every `step` [s]."""
    end = time.monotonic() + timeout
    while time.monotonic() < end:
        if condition():
            return True
        time.sleep(step)
    return False


@contextmanager
def peer(*answers: bytes, hang_up: bool = False) -> Iterator[int]:
    """A TCP server that answers whatever comes by the given bytes in turn, then is mute; yields its port."""
    listener = socket.create_server(("127.0.0.1", 0))
    listener.settimeout(10.0)
    stop = threading.Event()

    def serve() -> None:
        try:
            connection, _ = listener.accept()
        except OSError:
            return
        with connection:
            connection.settimeout(0.05)
            waiting = list(answers)
            while not stop.is_set():
                try:
                    if not connection.recv(4096):
                        return
                except TimeoutError:
                    continue
                except OSError:
                    return
                if waiting:
                    connection.sendall(waiting.pop(0))
                elif hang_up:
                    return

    thread = threading.Thread(target=serve, daemon=True)
    thread.start()
    try:
        yield listener.getsockname()[1]
    finally:
        stop.set()
        listener.close()
        thread.join(5.0)
