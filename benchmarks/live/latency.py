"""Latency from the sending of a robot packet by the mock to its estimate at a WebSocket client."""

import json
import sys
import tempfile
import time
from collections.abc import Callable
from dataclasses import asdict, dataclass
from pathlib import Path

import click
import numpy as np

from contactsense.benchmarks.live import reaction_latency, track_latency
from contactsense.service.api.client import Client, ClientError
from contactsense.service.cli.options.finite_range import FiniteRange
from contactsense.service.demo.child_process import ChildError
from contactsense.service.demo.processes import Stage
from contactsense.service.mock.interfaces.rtde_server import RATE
from contactsense.service.mock.interfaces.sent_log import SentLog

_WARM_UP = 2.0


@dataclass(frozen=True, slots=True)
class LatencyResult:
    """Latencies from packet to message [ms], and losses."""

    seconds: float
    """Between the first and the last estimate, on the robot's clock [s]."""
    samples: int
    """Samples that the robot took in that time."""
    estimates: int
    """Estimates that arrived."""
    p50: float
    p90: float
    p99: float
    p999: float
    worst: float
    step: float
    """Typical share of the localizer in that [ms]."""


def measure(seconds: float, tick: Callable[[float], None]) -> LatencyResult:
    """Run service and mock in separate processes, and read the stream for a while.

    Args:
        seconds: Duration [s].
        tick: Called repeatedly with the elapsed time [s].

    Raises:
        ChildError: A process did not start.
        ClientError: The service stopped sending.
    """
    with tempfile.TemporaryDirectory() as folder, Stage("ur5e") as stage:
        path = Path(folder) / "sent"
        log = SentLog(path, rate=RATE)
        client = stage.start_service()
        stage.start_arm("--loop", "--sent-log", str(path))
        stamps, late = collect(client, log, seconds, tick)
        step = client.health().pipeline.step or float("nan")
    duration = stamps[-1] - stamps[0]
    p50, p90, p99, p999, worst = np.percentile(late, [50, 90, 99, 99.9, 100]).round(3).tolist()
    samples = round(duration * RATE) + 1
    return LatencyResult(
        round(duration, 3), samples, len(stamps), p50, p90, p99, p999, worst, round(1e3 * step, 3)
    )


def collect(
    client: Client, log: SentLog, seconds: float, tick: Callable[[float], None] = lambda passed: None
) -> tuple[list[float], list[float]]:
    """Read the stream for `seconds` [s] after a warm-up.

    Returns:
        Time stamp of each estimate [s], and the time from its robot packet to its arrival here [ms].

    Raises:
        ClientError: The service stopped sending.
    """
    stamps: list[float] = []
    late: list[float] = []
    client.receive()
    begin = time.monotonic()
    while (passed := time.monotonic() - begin) < seconds + _WARM_UP:
        message = client.receive()
        arrival = time.monotonic_ns()
        tick(passed)
        content = json.loads(message)
        if passed > _WARM_UP and "t" in content:
            stamps.append(content["t"])
            late.append(1e-6 * (arrival - log.left_ns(content["t"])))
    return stamps, late


@click.command()
@click.option(
    "--seconds", default=20.0, show_default=True, type=FiniteRange(1.0), help="How long to read [s]."
)
@click.option(
    "--reaction",
    is_flag=True,
    help="Measure the time to a reaction's register write instead, with 8 readers and a POST a second.",
)
@click.option(
    "--track",
    type=click.Choice(["push", "own"]),
    is_flag=False,
    flag_value="push",
    help="Measure the round trip of samples sent to WS /v1/track instead: into the pipeline (push, as with "
    "--track alone) or to a localizer of the connection's own.",
)
@click.option("--messagepack", is_flag=True, help="With --track: MessagePack instead of JSON.")
@click.option("--json", "as_json", is_flag=True, help="Print the numbers as JSON.")
def latency(
    seconds: float, reaction: bool, track: track_latency.Way | None, messagepack: bool, as_json: bool
) -> int:
    """Measure the latency from a robot packet sent by the mock to the WebSocket message with its estimate.

    The demo script is run; mock, pipeline, web server and client are four processes on this host.
    """
    if reaction:
        return reaction_latency.report(seconds, as_json)
    if track is not None:
        return track_latency.report(seconds, track, messagepack, as_json)
    with click.progressbar(length=round(10 * (seconds + _WARM_UP)), label="reading", file=sys.stderr) as bar:
        done = 0

        def tick(passed: float) -> None:
            nonlocal done
            if round(10 * passed) > done:
                bar.update(round(10 * passed) - done)
                done = round(10 * passed)

        try:
            result = measure(seconds, tick)
        except (ChildError, ClientError) as error:
            raise click.ClickException(str(error)) from None
    if as_json:
        click.echo(json.dumps(asdict(result)))
    else:
        click.echo(
            f"{result.estimates} of {result.samples} samples in {result.seconds:.1f} s\n"
            f"packet to WebSocket message [ms]: p50 {result.p50:.2f}, p90 {result.p90:.2f}, "
            f"p99 {result.p99:.2f}, p99.9 {result.p999:.2f}, worst {result.worst:.2f}; "
            f"the localizer's step takes {result.step:.2f}"
        )
    return 0
