"""Lost samples, processor time and read latency of the sources at 500 Hz.

The mock and each reader run in separate processes, as in real use.
"""

import contextlib
import importlib.util
import json
import multiprocessing
import resource
import socket
import sys
import tempfile
import time
from collections.abc import Callable, Iterator
from dataclasses import asdict, dataclass
from multiprocessing.connection import Connection
from pathlib import Path
from typing import Any, Literal

import click
import numpy as np

from contactsense.scene import Scene
from contactsense.service.cli.options.finite_range import FiniteRange
from contactsense.service.mock.interfaces.rtde_server import RATE
from contactsense.service.mock.interfaces.sent_log import SentLog
from contactsense.service.mock.servers import MockServers, MockSettings
from contactsense.service.sensors.clients.robot_stream import RobotStream, SensorError
from contactsense.service.sensors.clients.rtde_client import DEFAULT_PORT, RtdeStream
from contactsense.service.sensors.clients.ur_rtde_client import UrRtdeStream
from contactsense.service.sensors.live_source import LiveSource
from contactsense.service.sensors.source_settings import SourceSettings
from contactsense.types import Sample

Client = Literal["rtde", "ur_rtde", "joined"]

NAMES: dict[Client, str] = {
    "rtde": "own reader",
    "ur_rtde": "ur_rtde's receive interface, in a process of its own",
    "joined": "own reader, joined with the force/torque sensor to samples",
}
FIELDS = ("actual_q", "actual_qd", "actual_current", "target_moment")
"""Fields to read: those that the estimator needs and both clients provide."""

_SPAWN = multiprocessing.get_context("spawn")
_START = 20.0
_WARM_UP = 0.5


@dataclass(frozen=True, slots=True)
class _Place:
    """Address at which the mock listens, and the log of the packets' send times."""

    host: str
    netft_port: int
    http_port: int
    sent_log: Path


@dataclass(frozen=True, slots=True)
class _Waves:
    """Joints that swing for ten seconds; the physics do not matter for the protocol."""

    rate: float
    t: np.ndarray
    q: np.ndarray
    qd: np.ndarray
    joint_torque: np.ndarray
    base_wrench: np.ndarray


@dataclass(frozen=True, slots=True)
class StreamResult:
    """Result of one source."""

    client: Client
    seconds: float
    """Between the first and the last sample, on the robot's clock [s]."""
    samples: int
    """Samples that the robot took in that time."""
    lost: int
    """Number of these that were never received."""
    cpu: float
    """Processor time of the reader divided by that time, including a child process and its start; 1 is one
    core."""
    late_p50: float
    """Latency from the packet sent by the mock to the record in Python: median [ms]."""
    late_p99: float
    """The same, 99th percentile [ms]."""


def waves(seconds: float = 10.0) -> _Waves:
    """A motion of six joints for the mock."""
    t = np.arange(round(seconds * RATE)) / RATE
    rates = 2.0 * np.pi / seconds * np.arange(1, 7)
    sin, cos = np.sin(np.outer(t, rates)), np.cos(np.outer(t, rates))
    return _Waves(RATE, t, sin, rates * cos, 10.0 * sin, 20.0 * cos)


def free_address(port: int = DEFAULT_PORT) -> str:
    """A loopback address on which that port is free; ur_rtde always uses the default port.

    Raises:
        SensorError: None was found.
    """
    for host in ["127.0.0.1", *(f"127.0.{i}.1" for i in range(100, 200))]:
        with contextlib.suppress(OSError), socket.create_server((host, port)):
            return host
    raise SensorError(f"expected a loopback address with port {port} free, found none")


def measure(clients: tuple[Client, ...], seconds: float, tick: Callable[[float], None]) -> list[StreamResult]:
    """Let the clients read from one mock at the same time.

    Args:
        clients: The clients to measure.
        seconds: Duration [s].
        tick: Called repeatedly with the elapsed time [s].

    Raises:
        SensorError: A process did not start or failed.
    """
    host = free_address()
    with tempfile.TemporaryDirectory() as folder:
        sent_log = Path(folder) / "sent"
        with _process(_serve, host, sent_log) as mock:
            place = _answer(mock, "the mock", _START)
            with contextlib.ExitStack() as stack:
                readers = [stack.enter_context(_process(_read, c, place, seconds)) for c in clients]
                begin = time.monotonic()
                while (passed := time.monotonic() - begin) < seconds:
                    tick(passed)
                    time.sleep(0.1)
                return [_answer(r, NAMES[c], _START) for c, r in zip(clients, readers, strict=True)]


@contextlib.contextmanager
def _process(target: Callable[..., None], *arguments: object) -> Iterator[Connection]:
    ours, theirs = _SPAWN.Pipe()
    process = _SPAWN.Process(target=target, args=(theirs, *arguments), daemon=True)
    process.start()
    theirs.close()
    try:
        yield ours
    finally:
        ours.close()
        process.join(5.0)
        if process.is_alive():
            process.kill()
            process.join()


def _answer(connection: Connection, who: str, timeout: float) -> Any:
    try:
        if connection.poll(timeout):
            return connection.recv()
    except EOFError:
        pass
    raise SensorError(f"{who} did not answer within {timeout:g} s, or its process ended")


def _serve(connection: Connection, host: str, sent_log: Path) -> None:
    settings = MockSettings(host=host, netft_port=0, http_port=0, loop=True, sent_log=sent_log)
    with MockServers(waves(), settings) as servers:
        connection.send(_Place(host, servers.netft.port, servers.netft.http_port, sent_log))
        with contextlib.suppress(EOFError):
            connection.recv()  # until the benchmark closes the connection


def _read(connection: Connection, client: Client, place: _Place, seconds: float) -> None:
    stream = _open(client, place)
    log = SentLog(place.sent_log, rate=RATE)
    _collect(stream, _WARM_UP, log)
    begin = time.process_time()
    stamps, late = _collect(stream, seconds, log)
    cpu = time.process_time() - begin
    stream.close()
    children = resource.getrusage(resource.RUSAGE_CHILDREN)
    cpu += children.ru_utime + children.ru_stime
    if len(stamps) < 2:
        raise SensorError(f"{NAMES[client]}: no samples; {stream.health}")
    duration = stamps[-1] - stamps[0]
    samples = round(duration * RATE) + 1
    p50, p99 = np.percentile(late, [50, 99])
    lost = samples - len(stamps)
    connection.send(
        StreamResult(
            client, duration, samples, lost, cpu / duration, round(float(p50), 3), round(float(p99), 3)
        )
    )


def _open(client: Client, place: _Place) -> RobotStream | LiveSource:
    if client == "rtde":
        return RtdeStream(place.host, FIELDS)
    if client == "ur_rtde":
        return UrRtdeStream(place.host, FIELDS)
    settings = SourceSettings(
        place.host,
        wrench_host=place.host,
        wrench_port=place.netft_port,
        wrench_http_port=place.http_port,
    )
    return LiveSource(Scene(robot="ur5e"), settings)


def _collect(
    stream: RobotStream | LiveSource, seconds: float, log: SentLog
) -> tuple[list[float], list[float]]:
    stamps: list[float] = []
    late: list[float] = []
    end = None
    give_up = time.monotonic() + _START
    while time.monotonic() < (give_up if end is None else end):
        for item in stream.poll(0.1):
            stamp = item.t if isinstance(item, Sample) else item.timestamp
            stamps.append(stamp)
            late.append(1e-6 * (time.monotonic_ns() - log.left_ns(stamp)))
        if stamps and end is None:
            end = time.monotonic() + seconds  # counted from the first sample: the start-up is not a loss
    return stamps, late


@click.command()
@click.option(
    "--seconds", default=60.0, show_default=True, type=FiniteRange(1.0), help="How long to read [s]."
)
@click.option("--json", "as_json", is_flag=True, help="Print the numbers as JSON.")
def stream(seconds: float, as_json: bool) -> int:
    """Measure samples lost at 500 Hz: by our own reader, ur_rtde if it is installed, and our reader combined
    with the sensor under the base.

    Exit status 1 if our own reader lost any.
    """
    clients: tuple[Client, ...] = ("rtde", "ur_rtde", "joined")
    if importlib.util.find_spec("rtde_receive") is None:
        click.echo("ur_rtde is not installed and is left out: it has no wheels for this Python", err=True)
        clients = ("rtde", "joined")
    with click.progressbar(length=round(seconds * 10), label="reading", file=sys.stderr) as bar:
        done = 0

        def tick(passed: float) -> None:
            nonlocal done
            bar.update(round(passed * 10) - done)
            done = round(passed * 10)

        try:
            results = measure(clients, seconds, tick)
        except SensorError as error:
            raise click.ClickException(str(error)) from None
    if as_json:
        click.echo(json.dumps([asdict(result) for result in results]))
    else:
        for line in table(results):
            click.echo(line)
    return int(results[0].lost > 0)


def table(results: list[StreamResult]) -> Iterator[str]:
    """The results as text, line by line."""
    head = ("samples", 10), ("lost", 8), ("lost %", 9), ("core %", 9), ("late p50 ms", 13), ("p99 ms", 9)
    yield f"{'source':<12}" + "".join(f"{name:>{width}}" for name, width in head)
    for r in results:
        share = 100.0 * r.lost / r.samples
        yield (
            f"{r.client:<12}{r.samples:>10}{r.lost:>8}{share:>9.3f}{100.0 * r.cpu:>9.1f}"
            f"{r.late_p50:>13.2f}{r.late_p99:>9.2f}"
        )
