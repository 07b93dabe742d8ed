"""Time that a controller waits for the estimate of a sample sent to `WS /v1/track`.

One thread sends the demo's motion at 500 Hz, on schedule whether or not answers have arrived, and another
reads the answers: a late answer delays no sample, and no waiting time is hidden.
"""

import contextlib
import json
import threading
import time
import urllib.request
from dataclasses import asdict, dataclass
from typing import Literal

import click
import msgpack
import numpy as np
from websockets.exceptions import WebSocketException
from websockets.sync.client import connect
from websockets.sync.connection import Connection

from contactsense.benchmarks.live.echo import Echo, EchoTimes, set_apart
from contactsense.benchmarks.live.histogram import Histogram, bars, histogram
from contactsense.service.api import READY
from contactsense.service.api.client import ClientError
from contactsense.service.demo.child_process import ChildError, child
from contactsense.service.mock.arm.script import Script
from contactsense.service.mock.arm.simulated_arm import simulate

Way = Literal["push", "own"]
"""`push`: the samples go to the pipeline; `own`: the connection has its own localizer."""
RATE = 500.0
_WARM_UP = 2.0
_LOADING = 900.0
_SILENCE = 15.0


@dataclass(frozen=True, slots=True)
class TrackLatency:
    """Times from sending a sample to receiving its estimate [ms]."""

    way: Way
    binary: bool
    """Whether messages were MessagePack; otherwise JSON."""
    samples: int
    """Number of samples sent after the warm-up."""
    estimates: int
    """Number of these that were answered."""
    p50: float
    p90: float
    p99: float
    p999: float
    worst: float
    histogram: Histogram
    """Of the estimates."""
    echo: EchoTimes
    """Round trips of plain messages during the same time."""


def measure(seconds: float, way: Way, binary: bool) -> TrackLatency:
    """Start a service, send samples to it for a while, and return the round-trip times.

    Raises:
        ChildError: The service did not start.
        ClientError: It refused the connection, or stopped sending.
    """
    messages = _messages(round((seconds + _WARM_UP) * RATE), binary)
    options = ("--source", "push") if way == "push" else ()
    with child("serve", "--port", "0", *options) as service:
        url = service.wait_for(READY)
        if way == "push":
            _until_it_listens(url)
        _until_it_locates(url)
        address = url.replace("http", "ws", 1) + "/v1/track"
        try:
            with connect(address, compression=None, close_timeout=0.5) as connection:
                echo = Echo()
                sent, arrived = _exchange(connection, messages, echo)
        except TimeoutError:
            raise ClientError(f"{address}: no estimate for {_SILENCE:g} s") from None
        except (OSError, WebSocketException) as error:
            raise ClientError(f"{address}: {error}") from None
    first = round(_WARM_UP * RATE)
    waited = (arrived - sent)[first:]
    answered = 1e3 * waited[np.isfinite(waited)]
    if not answered.size:
        raise ClientError(f"{address}: no sample was answered")
    p50, p90, p99, p999, worst = np.percentile(answered, [50, 90, 99, 99.9, 100]).round(3).tolist()
    return TrackLatency(
        way, binary, waited.size, answered.size, p50, p90, p99, p999, worst,
        histogram(answered), echo.times(),
    )  # fmt: skip


def _messages(n: int, binary: bool) -> list[bytes]:
    motion = simulate(Script.demo())
    contents = (
        {
            "t": i / RATE,
            "q": motion.q[i % len(motion.q)].tolist(),
            "qd": motion.qd[i % len(motion.q)].tolist(),
            "joint_torque": motion.joint_torque[i % len(motion.q)].tolist(),
            "base_wrench": motion.base_wrench[i % len(motion.q)].tolist(),
        }
        for i in range(n)
    )
    return [msgpack.packb(content) if binary else json.dumps(content).encode() for content in contents]


def _exchange(connection: Connection, messages: list[bytes], echo: Echo) -> tuple[np.ndarray, np.ndarray]:
    """Time at which each sample was sent and at which its estimate arrived, NaN if it did not, each (n,)
    [s]."""
    binary = messages[0][:1] != b"{"
    sent, arrived = np.full(len(messages), np.nan), np.full(len(messages), np.nan)

    def transmit(i: int) -> None:
        sent[i] = time.monotonic()
        connection.send(messages[i] if binary else messages[i].decode())

    def receive(timeout: float) -> int:
        answer = connection.recv(timeout=timeout)
        arrival = time.monotonic()
        content = msgpack.unpackb(answer) if binary else json.loads(answer)
        if "errors" in content:
            raise ClientError(f"refused: {content['errors']}")
        if "t" not in content:
            return 0
        i: int = round(content["t"] * RATE)
        arrived[i] = arrival
        return i

    transmit(0)
    receive(_LOADING)  # a separate localizer is loaded first

    def send_all() -> None:
        begin = time.monotonic()
        with contextlib.suppress(OSError, WebSocketException):  # reported by the reader of the answers
            for i in range(1, len(messages)):
                time.sleep(max(0.0, begin + i / RATE - time.monotonic()))
                transmit(i)

    sender = threading.Thread(target=send_all, name="sender", daemon=True)
    with echo.run():
        sender.start()
        set_apart()  # including the client's own threads
        while receive(_SILENCE) < len(messages) - 1:
            pass
        sender.join()
    return sent, arrived


def _until_it_listens(url: str) -> None:
    deadline = time.monotonic() + _LOADING
    while True:
        with urllib.request.urlopen(f"{url}/v1/health", timeout=_SILENCE) as answer:
            status = json.load(answer)["status"]
        if status == "waiting":
            return
        if time.monotonic() > deadline or status == "failing":
            raise ChildError(f"the pipeline did not come up: {status}")
        time.sleep(0.1)


def _until_it_locates(url: str) -> None:
    """Wait until the service has loaded what POST /v1/locate needs; this takes processor time from the
    measurement."""
    sample = {"q": [0.0, -1.3, 1.6, -1.9, -1.57, 0.0], "base_wrench": [5.9, 2.4, -19.0, -1.1, -2.3, -0.6]}
    request = urllib.request.Request(
        f"{url}/v1/locate", json.dumps(sample).encode(), {"Content-Type": "application/json"}
    )
    urllib.request.urlopen(request, timeout=_LOADING).close()


def report(seconds: float, way: Way, binary: bool, as_json: bool) -> int:
    """Measure and print."""
    click.echo(f"sending for {seconds + _WARM_UP:g} s ...", err=True)
    try:
        result = measure(seconds, way, binary)
    except (ChildError, ClientError) as error:
        raise click.ClickException(str(error)) from None
    if as_json:
        click.echo(json.dumps(asdict(result)))
        return 0
    click.echo(
        f"{result.estimates} of {result.samples} samples answered "
        f"({'MessagePack' if binary else 'JSON'}, {'pipeline' if way == 'push' else 'own localizer'})\n"
        f"round trip [ms]: p50 {result.p50:.2f}, p90 {result.p90:.2f}, p99 {result.p99:.2f}, "
        f"p99.9 {result.p999:.2f}, worst {result.worst:.2f}\n"
        f"{result.echo}"
    )
    for bar in bars(result.histogram):
        click.echo(bar)
    return 0
