"""Reference for round trips: plain messages between two processes, in parallel with the actual measurement.

One process sends at 500 Hz, with real-time scheduling if permitted. The other is scheduled like the pipeline
and returns each message. Times longer than a fraction of a millisecond are caused by the host.
"""

import contextlib
import multiprocessing
import os
import socket
import sys
import time
from collections.abc import Iterator
from dataclasses import dataclass
from multiprocessing.connection import Connection

import numpy as np

from contactsense.service.live.scheduling import PIPELINE, Scheduling, prioritize

RATE = 500.0
SIZE = 500
"""Size of a message [bytes], about that of a robot packet."""


@dataclass(frozen=True, slots=True)
class EchoTimes:
    """Round trips of plain messages [ms]."""

    scheduling: Scheduling
    """Scheduling of the process that returns messages, and of the pipeline."""
    p50: float
    p99: float
    p999: float
    worst: float

    def __str__(self) -> str:
        """One readable line."""
        return (
            f"beside it, plain messages between two processes ({self.scheduling}) took [ms]: "
            f"p50 {self.p50:.2f}, p99 {self.p99:.2f}, p99.9 {self.p999:.2f}, worst {self.worst:.2f}"
        )


class Echo:
    """Measures while `run` is active."""

    def __init__(self) -> None:
        self._times: tuple[Scheduling, list[float]] = ("normal", [])

    @contextlib.contextmanager
    def run(self) -> Iterator[None]:
        """Measure for the length of a `with` block, which is entered once messages go to and fro.

        Raises:
            EOFError: A process ended by itself.
        """
        spawn = multiprocessing.get_context("spawn")
        here, there = socket.socketpair()
        ours, theirs = spawn.Pipe()
        processes = (
            spawn.Process(target=_send_back, args=(there,), daemon=True),
            spawn.Process(target=_send, args=(here, theirs), daemon=True),
        )
        with here, there, theirs:
            for process in processes:
                process.start()
        with ours:
            ours.recv()  # on a busy computer processes take seconds to start
            yield
            ours.send("enough")
            self._times = ours.recv()
        for process in processes:
            process.join()

    def times(self) -> EchoTimes:
        """The measured times."""
        scheduling, times = self._times
        p50, p99, p999, worst = (1e3 * np.percentile(times, [50, 99, 99.9, 100])).round(3).tolist()
        return EchoTimes(scheduling, p50, p99, p999, worst)


def set_apart(process: int | None = None) -> None:
    """Give all threads of a process, by default this one, real-time scheduling if permitted, as if they ran
    on another machine."""
    if sys.platform == "linux":
        for thread in os.listdir(f"/proc/{process or os.getpid()}/task"):
            with contextlib.suppress(OSError):
                os.sched_setscheduler(int(thread), os.SCHED_FIFO, os.sched_param(PIPELINE + 1))


def _send_back(connection: socket.socket) -> None:
    connection.send(prioritize(PIPELINE).encode())
    with connection, contextlib.suppress(OSError):
        while message := connection.recv(SIZE):
            connection.sendall(message)


def _send(connection: socket.socket, control: Connection) -> None:
    scheduling = connection.recv(SIZE).decode()
    control.send("ready")
    set_apart()
    message, due = bytes(SIZE), time.monotonic()
    times: list[float] = []
    with connection:
        while not times or not control.poll():
            due += 1.0 / RATE
            time.sleep(max(0.0, due - time.monotonic()))
            begin = time.monotonic()
            connection.send(message)
            left = SIZE
            while left:
                left -= len(connection.recv(left))
            times.append(time.monotonic() - begin)
    control.send((scheduling, times))
