"""Latency from the sending of a robot packet by the mock to the arrival of a reaction's register write.

The arm is pushed and released again and again; during a push, registers are written with every sample. In
parallel, 8 clients read the whole stream and one sample is posted every second, as in a busy cell.
"""

import asyncio
import contextlib
import json
import multiprocessing
import os
import sys
import tempfile
import time
import urllib.request
from collections.abc import Iterator
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import click
import numpy as np
import yaml
from websockets.asyncio.client import connect

from contactsense.benchmarks.live.echo import Echo, EchoTimes, set_apart
from contactsense.benchmarks.live.histogram import Histogram, bars, histogram
from contactsense.service.api.client import Client, ClientError
from contactsense.service.demo.child_process import ChildError
from contactsense.service.demo.processes import Stage
from contactsense.service.mock.interfaces.rtde_server import RATE
from contactsense.service.mock.interfaces.sent_log import SIZE, SentLog

READERS = 8
_WARM_UP = 3.0
_PUSHES = 20
_POSE = [0.0, -1.3, 1.6, -1.9, -1.57, 0.0]
_SAMPLE = {"q": _POSE, "base_wrench": [5.9, 2.4, -19.0, -1.1, -2.3, -0.6]}


@dataclass(frozen=True, slots=True)
class ReactionLatency:
    """Times from packet to register write [ms]."""

    seconds: float
    """Duration of the measurement [s]."""
    writes: int
    """Register writes that could be assigned to a sample."""
    onsets: int
    """Number of these that are the first of a push."""
    p50: float
    p90: float
    p99: float
    p999: float
    worst: float
    onset_p50: float
    onset_worst: float
    """The same, only for the first write of each push."""
    step: float
    """Typical share of the localizer in that [ms]."""
    histogram: Histogram
    """Of the writes."""
    echo: EchoTimes
    """Round trips of plain messages during the same time."""


def script() -> dict[str, Any]:
    """Pushes of 30 N on the forearm, half of the time."""
    push = {
        "link": "forearm",
        "point": [-0.1747, 0.0373, 0.0095],
        "normal": [-0.0008, 0.9931, 0.1174],
        "push": 30.0,
        "duration": 0.4,
        "ramp": 0.01,
    }
    return {
        "robot": "ur5e",
        "rate": RATE,
        "noise": {"base_force": 0.25, "base_moment": 0.05, "joint_torque": 1.0, "seed": 1},
        "trajectory": {"start": _POSE, "dwell": 0.5 + 0.8 * _PUSHES},
        "contacts": [{**push, "start": 0.5 + 0.8 * k} for k in range(_PUSHES)],
    }


def rules(rtde_port: int) -> dict[str, Any]:
    """One rule on all links that writes registers."""
    return {
        "robot": {"rtde_port": rtde_port},
        "actions": {"registers": {"type": "registers", "time": 46}},
        "rules": [{"name": "any", "links": ["any"], "contact": {"force": 10.0, "actions": ["registers"]}}],
    }


def measure(seconds: float) -> ReactionLatency:
    """Run service, mock and readers in separate processes.

    Raises:
        ChildError: A process did not start.
        ClientError: The service stopped sending.
    """
    seconds = min(seconds, SIZE / RATE - _WARM_UP - 5.0)
    with tempfile.TemporaryDirectory() as name, Stage("ur5e") as stage:
        folder = Path(name)
        (folder / "reactions.yaml").write_text(yaml.safe_dump(rules(stage.rtde_port)))
        (folder / "push.yaml").write_text(yaml.safe_dump(script()))
        sent, received = SentLog(folder / "sent", rate=RATE), SentLog(folder / "received", rate=RATE)
        client = stage.start_service("--reactions", str(folder / "reactions.yaml"))
        with _load(client.url):
            arm = stage.start_arm(
                "--loop", "--script", str(folder / "push.yaml"),
                "--sent-log", str(folder / "sent"), "--received-log", str(folder / "received"),
            )  # fmt: skip
            set_apart(arm.pid)
            echo = Echo()
            with echo.run():
                first, last = _wait(client, seconds)
            step = client.health().pipeline.step or float("nan")
            numbers = range(round(first * RATE), round(last * RATE))
            late = [1e-6 * (received.left_ns(k / RATE) - sent.left_ns(k / RATE)) for k in numbers]
            there = [received.left_ns(k / RATE) > 0 for k in numbers]
    return _result(last - first, np.array(late), np.array(there, dtype=bool), step, echo.times())


def _result(
    seconds: float, late: np.ndarray, there: np.ndarray, step: float, echo: EchoTimes
) -> ReactionLatency:
    begins = there & ~np.concatenate(([True], there[:-1]))
    values, onsets = late[there], late[begins]
    if len(onsets) == 0:
        raise ClientError("no register was written: see the health of the service's reactions")
    p50, p90, p99, p999, worst = np.percentile(values, [50, 90, 99, 99.9, 100]).round(3).tolist()
    return ReactionLatency(
        round(seconds, 3), len(values), len(onsets), p50, p90, p99, p999, worst,
        round(float(np.median(onsets)), 3), round(float(onsets.max()), 3), round(1e3 * step, 3),
        histogram(values), echo,
    )  # fmt: skip


def _wait(client: Client, seconds: float) -> tuple[float, float]:
    """Read the stream for `seconds`; returns the times of the first and last sample that count [s]."""
    client.receive()
    begin, first, t = time.monotonic(), None, 0.0
    while (passed := time.monotonic() - begin) < seconds + _WARM_UP:
        content = json.loads(client.receive())
        t = content.get("t", t)
        if first is None and passed > _WARM_UP:
            first = t
    return first if first is not None else t, t


@contextlib.contextmanager
def _load(url: str) -> Iterator[None]:
    process = multiprocessing.get_context("spawn").Process(target=_read_and_post, args=(url,), daemon=True)
    process.start()
    try:
        yield
    finally:
        process.kill()
        process.join()


def _read_and_post(url: str) -> None:
    os.nice(10)  # readers represent other machines: they should not compete with the service
    asyncio.run(_readers(url))


async def _readers(url: str) -> None:
    await asyncio.gather(*[_reader(url) for _ in range(READERS)], _poster(url))


async def _reader(url: str) -> None:
    async with connect(url.replace("http", "ws", 1) + "/v1/stream", compression=None) as stream:
        async for _ in stream:
            pass


async def _poster(url: str) -> None:
    request = urllib.request.Request(
        f"{url}/v1/locate", json.dumps(_SAMPLE).encode(), {"Content-Type": "application/json"}
    )

    def post() -> None:
        with urllib.request.urlopen(request, timeout=280.0) as answer:
            answer.read()

    while True:
        await asyncio.to_thread(post)
        await asyncio.sleep(1.0)


def report(seconds: float, as_json: bool) -> int:
    """Measure and print."""
    print(f"reading for {seconds:g} s ...", file=sys.stderr)
    try:
        result = measure(seconds)
    except (ChildError, ClientError) as error:
        raise click.ClickException(str(error)) from None
    if as_json:
        click.echo(json.dumps(asdict(result)))
        return 0
    click.echo(
        f"{result.writes} register writes in {result.seconds:.1f} s, {result.onsets} of them at the "
        f"beginning of a push, {READERS} readers and a POST a second beside it\n"
        f"packet to register write [ms]: p50 {result.p50:.2f}, p90 {result.p90:.2f}, p99 {result.p99:.2f}, "
        f"p99.9 {result.p999:.2f}, worst {result.worst:.2f}; the localizer's step takes {result.step:.2f}\n"
        f"first writes of a push [ms]: p50 {result.onset_p50:.2f}, worst {result.onset_worst:.2f}\n"
        f"{result.echo}"
    )
    for bar in bars(result.histogram):
        click.echo(bar)
    return 0
