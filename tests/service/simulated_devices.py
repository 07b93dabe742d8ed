"""A simulated robot and its force/torque sensor in a process of their own.

Where they share a process with the tests, whatever holds up the tests (a garbage collection, a thread that
parses messages) holds them up as well: a burst on both wires, which no robot and no sensor would cause.
"""

import multiprocessing
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from multiprocessing.managers import BaseManager
from typing import Any

from contactsense.service.live.scheduling import prefer_low_latency
from contactsense.service.mock.arm.script import Script
from contactsense.service.mock.arm.simulated_arm import simulate
from contactsense.service.mock.servers import MockServers, MockSettings


class SimulatedDevices:
    """They play a script's motion again and again, on free ports of a host."""

    def __init__(self, script: Script, host: str = "127.0.0.1") -> None:
        settings = MockSettings(host=host, rtde_port=0, netft_port=0, http_port=0, loop=True)
        self.servers = MockServers(simulate(script), settings)
        prefer_low_latency()

    def ports(self) -> tuple[int, int, int]:
        """Where clients find RTDE, the sensor's readings and its configuration page."""
        return self.servers.rtde.port, self.servers.netft.port, self.servers.netft.http_port


class _Process(BaseManager):
    """Holds one object."""


@contextmanager
def in_own_process(make: Callable[..., object], *arguments: object) -> Iterator[Any]:
    """Make an object in another process, for the length of a `with` block; yields what calls its methods."""
    _Process.register("make", make)
    with _Process(ctx=multiprocessing.get_context("spawn")) as process:
        yield process.make(*arguments)  # type: ignore[attr-defined]
