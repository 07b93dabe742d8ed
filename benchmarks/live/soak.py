"""Soak test: minutes at 500 Hz with readers that connect, disconnect and stall. It checks whether samples are
lost, whether memory grows, and whether every subscribed reader receives all events."""

import contextlib
import json
import logging
import os
import sys
import threading
import time
from collections.abc import Callable, Iterator
from dataclasses import asdict, dataclass
from pathlib import Path

import click
import httpx
import numpy as np
from websockets.exceptions import ConnectionClosed, InvalidStatus, WebSocketException
from websockets.sync.client import connect

from contactsense.service.api.client import Client, ClientError
from contactsense.service.cli.options.finite_range import FiniteRange
from contactsense.service.demo.child_process import ChildError
from contactsense.service.demo.processes import Stage
from contactsense.service.mock.interfaces.rtde_server import RATE

_SILENT = logging.Logger("contactsense.soak", logging.CRITICAL + 1)
"""For connections that a reader breaks off on purpose: the client would log each as an error of its own.

It is not registered: a service in this process configures logging, which enables registered loggers again."""
_WARM_UP = 5.0
_QUIET = 2.0
"""If no event comes for this long, none is in transit [s]."""
_VISIT = 2.0
"""Duration of the connection of a reader that connects and disconnects [s]."""


@dataclass(frozen=True, slots=True)
class SoakResult:
    """Results for samples, memory and events."""

    seconds: float
    """Between the first and the last estimate, on the robot's clock [s]."""
    samples: int
    """Samples that the robot took in that time."""
    lost: int
    """Number of these without an estimate at the steady reader, for any reason."""
    lost_on_the_wire: int
    """Number of these that the service itself missed, by the robot's time stamps."""
    restarts: int
    """Number of restarts of the pipeline."""
    visits: int
    """Number of readers that connected and disconnected."""
    dropped: int
    """Number of readers disconnected by the service because they read nothing."""
    memory: float
    """Memory of the service's processes at the end [MB]."""
    memory_slope: float
    """Its growth rate over the second half [MB per minute]."""
    events: int | None
    """Number of events in the journal during that time; None if this service has no events."""
    events_missed: int | None
    """Number of these that at least one subscribed reader did not receive."""


def measure(seconds: float, tick: Callable[[float], None]) -> SoakResult:
    """Run service and mock with readers that connect, disconnect and stall.

    Args:
        seconds: Duration [s].
        tick: Called repeatedly with the elapsed time [s].

    Raises:
        ChildError: A process did not start.
        ClientError: The service stopped sending.
    """
    with Stage("ur5e") as stage, contextlib.ExitStack() as stack:
        client = stage.start_service()
        arm = stage.start_arm("--loop")
        over = threading.Event()
        visits = [0]
        threads = [
            threading.Thread(target=_come_and_go, args=(client.stream_url, over, visits), daemon=True),
            threading.Thread(target=_stall, args=(client.stream_url, over), daemon=True),
        ]
        watchers = [_EventReader(client.url, over) for _ in range(2)]
        for thread in (*threads, *watchers):
            thread.start()
        stack.callback(over.set)
        stamps, memory = _read(client, seconds, tick)
        health = client.health()
        arm.end()  # or events would begin while the readers compare
        _settle(watchers)
        over.set()
        for thread in (*threads, *watchers):
            thread.join(10.0)
    events, missed = _compare(watchers)
    duration = stamps[-1] - stamps[0]
    samples = round(duration * RATE) + 1
    times, sizes = np.array(memory).T
    late = times > 0.5 * times[-1]
    slope = 60.0 * float(np.polyfit(times[late], sizes[late], 1)[0]) if late.sum() > 2 else float("nan")
    return SoakResult(
        round(duration, 3),
        samples,
        samples - len(stamps),
        health.source.robot.lost,
        health.pipeline.restarts,
        visits[0],
        health.clients.dropped,
        round(float(sizes[-1]), 1),
        round(slope, 3),
        events,
        missed,
    )


def _read(
    client: Client, seconds: float, tick: Callable[[float], None]
) -> tuple[list[float], list[tuple[float, float]]]:
    stamps: list[float] = []
    memory: list[tuple[float, float]] = []
    client.receive()
    begin = time.monotonic()
    while (passed := time.monotonic() - begin) < seconds + _WARM_UP:
        content = json.loads(client.receive())
        if passed < _WARM_UP:
            continue
        if "t" in content:
            stamps.append(content["t"])
        if not memory or passed - memory[-1][0] > 1.0:
            memory.append((passed, service_memory()))
            tick(passed)
    return stamps, memory


def service_memory() -> float:
    """Memory of all processes of the service that we started, from /proc on Linux [MB]."""
    children: dict[int, list[int]] = {}
    sizes: dict[int, float] = {}
    names: dict[int, str] = {}
    for folder in Path("/proc").iterdir():
        if not folder.name.isdigit():
            continue
        with contextlib.suppress(OSError, ValueError, IndexError):
            pid = int(folder.name)
            stat = (folder / "stat").read_text().rpartition(")")[2].split()
            children.setdefault(int(stat[1]), []).append(pid)
            sizes[pid] = int((folder / "statm").read_text().split()[1]) * 4096 / 1e6
            names[pid] = (folder / "cmdline").read_text().replace("\0", " ")
    ours = [pid for pid in children.get(os.getpid(), []) if " serve " in names.get(pid, "")]
    return sum(sizes[pid] for root in ours for pid in _descendants(root, children))


def _descendants(pid: int, children: dict[int, list[int]]) -> Iterator[int]:
    yield pid
    for child in children.get(pid, []):
        yield from _descendants(child, children)


def _come_and_go(url: str, over: threading.Event, visits: list[int]) -> None:
    """A reader that repeatedly connects for a moment; every other time it disconnects without closing."""
    while not over.is_set():
        with (
            contextlib.suppress(OSError, WebSocketException, ConnectionClosed, TimeoutError),
            connect(
                url, compression=None, ping_interval=None, close_timeout=0.2, logger=_SILENT
            ) as connection,
        ):
            end = time.monotonic() + _VISIT
            while time.monotonic() < end and not over.is_set():
                connection.recv(timeout=1.0)
            visits[0] += 1
            if visits[0] % 2 == 0:
                connection.socket.close()


def _stall(url: str, over: threading.Event) -> None:
    """A reader that reads nothing, and reconnects when it was disconnected."""
    while not over.is_set():
        with (
            contextlib.suppress(OSError, WebSocketException),
            connect(
                url, compression=None, max_queue=1, ping_interval=None, close_timeout=0.2, logger=_SILENT
            ) as connection,
        ):
            with contextlib.suppress(Exception):
                while not over.wait(0.5):
                    connection.ping()
            connection.socket.close()
        over.wait(0.5)


class _EventReader(threading.Thread):
    """Reads the events from `WS /v1/events`, if the service has it."""

    def __init__(self, url: str, over: threading.Event) -> None:
        super().__init__(daemon=True)
        self._http = url
        self._url = url.replace("http", "ws", 1) + "/v1/events"
        self._over = over
        self.seen: set[int] = set()
        """Numbers of the received events."""
        self.journal: set[int] | None = None
        """Numbers of the events in the journal at the end; None if there is no journal."""

    def run(self) -> None:
        """Read until the end, then read the journal."""
        try:
            with connect(self._url, compression=None, close_timeout=0.2) as connection:
                while not self._over.is_set():
                    with contextlib.suppress(TimeoutError):
                        content = json.loads(connection.recv(timeout=0.2))
                        if "id" in content:
                            self.seen.add(content["id"])
                self._look()
        except (OSError, InvalidStatus, ConnectionClosed):
            return

    def _look(self) -> None:
        first = min(self.seen, default=0)
        with contextlib.suppress(httpx.HTTPError):
            answer = httpx.get(
                f"{self._http}/v1/events", params={"since": max(0, first - 1), "limit": 10_000}
            )
            if answer.status_code == 200:
                self.journal = {event["id"] for event in answer.json()["events"] if event["id"] >= first}


def _settle(readers: list[_EventReader]) -> None:
    """Wait until no event has come for a while."""
    count = -1
    while count != (count := sum(len(reader.seen) for reader in readers)):
        time.sleep(_QUIET)


def _compare(readers: list[_EventReader]) -> tuple[int | None, int | None]:
    journal = [reader.journal for reader in readers if reader.journal is not None]
    if not journal:
        return None, None
    known = set.union(*journal, *(reader.seen for reader in readers))
    common = max(min(reader.seen, default=0) for reader in readers)
    expected = {number for number in known if number >= common}
    return len(expected), len(expected) - len(set.intersection(*(r.seen for r in readers)) & expected)


@click.command()
@click.option(
    "--minutes", default=10.0, show_default=True, type=FiniteRange(0.1), help="How long to run [min]."
)
@click.option("--json", "as_json", is_flag=True, help="Print the numbers as JSON.")
def soak(minutes: float, as_json: bool) -> int:
    """Run for minutes at 500 Hz with readers that connect, disconnect and stall: losses, memory, events.

    Exit status 1 if the service missed samples or was restarted, or if a reader missed an event.
    """
    seconds = 60.0 * minutes
    with click.progressbar(length=round(seconds + _WARM_UP), label="reading", file=sys.stderr) as bar:
        done = 0

        def tick(passed: float) -> None:
            nonlocal done
            bar.update(round(passed) - done)
            done = round(passed)

        try:
            result = measure(seconds, tick)
        except (ChildError, ClientError) as error:
            raise click.ClickException(str(error)) from None
    if as_json:
        click.echo(json.dumps(asdict(result)))
    else:
        seen = (
            "this service has no events"
            if result.events is None
            else f"{result.events_missed} of {result.events} events missed"
        )
        click.echo(
            f"{result.lost} of {result.samples} samples lost ({result.lost_on_the_wire} by the service) in "
            f"{result.seconds:.0f} s; {result.restarts} restarts; {result.visits} readers came and went, "
            f"{result.dropped} were dropped; {result.memory:.0f} MB, growing by {result.memory_slope:.2f} MB "
            f"a minute; {seen}"
        )
    return int(bool(result.lost_on_the_wire or result.restarts or result.events_missed))
