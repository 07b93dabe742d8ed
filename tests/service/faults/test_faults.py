"""Every fault of the wire, with what must be said of it: told with its reason, no false contact, recovered.

The arm moves freely all the time, so that every contact that begins is a false one.

The times that it takes to be told and to recover are printed (`pytest -s tests/service/faults`); no
times are asserted, as a busy computer would fail them.
"""

import json
import os
import re
import signal
import threading
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path

import pytest
from websockets.exceptions import ConnectionClosed
from websockets.sync.client import connect

from contactsense.service.api import READY
from contactsense.service.demo.child_process import child
from contactsense.service.mock.arm.script import Script
from tests.service import http
from tests.service.faults.spoiled_devices import SpoiledDevices
from tests.service.simulated_devices import in_own_process

# On a computer without time the mock is late as well, and no fault could be told from that.
pytestmark = [pytest.mark.slow, pytest.mark.realtime, pytest.mark.timeout(600)]

SCRIPT = Script.model_validate(
    {
        "robot": "ur5e",
        "noise": {"base_force": 0.25, "base_moment": 0.05, "joint_torque": 1.0, "seed": 3},
        "trajectory": {
            "start": [0.0, -1.3, 1.6, -1.9, -1.57, 0.0],
            "dwell": 0.5,
            "moves": [
                {"to": [0.9, -1.0, 1.3, -1.9, -1.2, 0.5], "duration": 3.0, "dwell": 0.1},
                {"to": [0.0, -1.3, 1.6, -1.9, -1.57, 0.0], "duration": 3.0, "dwell": 0.1},
            ],
        },
    }
)
HOLD = 1.5
"""For how long a fault stays at least [s]."""
PATIENCE = 60.0
"""Time to be told of, and to recover [s]: for a computer that is busy with other things."""


@dataclass(frozen=True)
class Row:
    """A fault and what must be said of it."""

    name: str
    where: str
    status: str
    """A pattern; ok where the fault does no harm."""
    reason: str
    """A pattern for the message."""
    onsets: int = 0
    """How many contacts may begin."""
    touched: str = "base"
    """A pattern for the links on which they may."""


ROWS = [
    Row("MUTE", "server", "waiting", "has been silent|gave no answer"),
    Row("CLOSE", "server", "waiting", "closed the connection|cannot be reached"),
    Row("HALF", "server", "waiting", "has been silent|gave no answer"),
    Row("GARBAGE", "server", "waiting", "expected|has been silent|gave no answer"),
    Row("SPLIT", "server", "ok", ""),
    Row("ZERO_LENGTH", "server", "waiting", "expected|has been silent|gave no answer"),
    Row("LOST_BYTE", "server", "waiting", "expected|has been silent|gave no answer"),
    Row("TIME_BACK", "server", "ok|degraded", ""),
    Row("closed", "handshake", "waiting", "closed the connection|connection lost"),
    Row("mute", "handshake", "waiting", "gave no answer|no answer in time"),
    Row("garbage", "handshake", "waiting", "expected"),
    Row("wrong version", "handshake", "waiting", "version"),
    Row("start refused", "handshake", "waiting", "refuse"),
    Row("NOT_FOUND", "handshake", "failing", "does not know|NOT_FOUND"),
    Row("killed", "process", "failing", "exit code -9"),
    Row("stopped", "process", "failing", "was stopped, or dead,|has not reported"),
    Row("velocities are absurd", "robot", "waiting", "velocities far beyond what its joints can do"),
    Row("bursts of 50 ms", "robot", "ok|degraded", ""),
    Row("bursts of 400 ms", "robot", "ok|degraded", ""),
    Row("100 ms late", "robot", "ok|degraded", ""),
    Row("jitter of 12 ms", "robot", "ok|degraded", ""),
    Row("q is NaN", "robot", "waiting", "positions or velocities that are not numbers"),
    Row("torque is NaN", "robot", "degraded", "joint torques that are not numbers"),
    Row("stamp is NaN", "robot", "waiting", "time stamps that are not numbers"),
    Row("stamp is frozen", "robot", "waiting", "repeat the time stamp"),
    Row("all but the stamp is frozen", "robot", "waiting", "its packets are stale"),
    Row("torque is frozen", "robot", "degraded", "joint torques never change"),
    Row("one torque is frozen", "robot", "degraded", r"joint_torque\[2\]: "),
    Row("one torque is zero", "robot", "degraded", r"joint_torque\[1\]: ", onsets=1, touched=".*"),
    # Until the arm has moved by 0.01 rad, what its motion needs looks like a contact.
    Row(
        "velocities are zero",
        "robot",
        "waiting|degraded",
        "joint velocities are not those",
        onsets=1,
        touched=".*",
    ),
    Row("pairs are swapped", "robot", "degraded", "wrong order"),
    Row("10 % are missing", "robot", "degraded", "% of the robot's packets were lost"),
    Row("doubled", "robot", "ok|degraded", "samples arrive|repeat the time stamp"),
    Row("spikes of 300 Nm", "robot", "ok|degraded", ""),
    Row("mute", "sensor", "degraded", "silent, it sends no readings|lack the force/torque reading"),
    Row("frozen", "sensor", "degraded", "repeats the same reading"),
    Row("one component is frozen", "sensor", "degraded", r"base_wrench\[3\]: "),
    Row("one component is zero", "sensor", "degraded", r"base_wrench\[2\]: ", onsets=1, touched=".*"),
    Row("20 ms late", "sensor", "degraded", "later than before"),
    # Nothing tells it from somebody who pushes the base: the joints feel neither.
    Row("biased by 40 N", "sensor", "ok", "", onsets=1),
    Row("all zero", "sensor", "degraded", "exactly zero"),
    Row(
        "restarted, counts from 1",
        "sensor",
        "degraded",
        "lack the force/torque reading|counts its readings anew",
    ),
    Row("counts 1e6 ahead", "sensor", "ok|degraded", ""),
    Row("reordered", "sensor", "ok|degraded", ""),
    Row("doubled", "sensor", "ok", ""),
    Row("30 % lost", "sensor", "ok", ""),
    Row("90 % lost", "sensor", "degraded", "(8[5-9]|9[0-9])% of the readings"),
    Row("saturated", "sensor", "degraded", "beyond its range|lack the force/torque reading"),
    # Random bytes may look like any state of the sensor.
    Row("junk", "sensor", "degraded", "lack the force/torque reading|mute|readings as bad|malformed"),
    Row("bursts of 50 ms", "sensor", "degraded", "lack the force/torque reading"),
]


TRIED_ALWAYS = {
    "server": {"MUTE", "CLOSE", "GARBAGE"},
    "handshake": {"NOT_FOUND"},
    "process": {"killed", "stopped"},
    "robot": {
        "q is NaN",
        "torque is frozen",
        "velocities are zero",
        "bursts of 400 ms",
        "10 % are missing",
    },
    "sensor": {
        "mute",
        "frozen",
        "20 ms late",
        "biased by 40 N",
        "restarted, counts from 1",
        "saturated",
        "junk",
    },
}
"""One fault of each kind, which .ci/run tries; all take three minutes."""


class Cell:
    """A moving mock arm behind proxies, and a service in a process of its own that reads it."""

    def __init__(self, devices: SpoiledDevices, url: str, service: int) -> None:
        self._devices, self.url, self._service = devices, url, service
        self._locates = max(self._workers())  # the younger one: the pipeline was there first
        self._learned = -1
        """Number of the pipeline that has learned how noisy its channels are, counted from 0."""
        self.onsets: list[float] = []
        self.links: list[str] = []
        """The link of each estimate that names one: those that cannot tell (`ambiguous`) claim none."""
        self.last = ""
        self._over = threading.Event()
        self._reader = threading.Thread(target=self._read, daemon=True)
        self._reader.start()

    def set(self, row: Row | None) -> None:
        """Begin that fault; None: end all."""
        if row is None:
            self._devices.end()
        elif row.where == "process":
            (pipeline,) = self._workers() - {self._locates}
            os.kill(pipeline, signal.SIGKILL if row.name == "killed" else signal.SIGSTOP)
        else:
            self._devices.begin(row.where, row.name)

    def _workers(self) -> frozenset[int]:
        """Numbers of the service's processes that work."""
        threads = Path(f"/proc/{self._service}/task").glob("*/children")  # each lists those it has started
        children = [child for thread in threads for child in thread.read_text().split()]
        commands = {int(child): Path(f"/proc/{child}/cmdline").read_bytes() for child in children}
        return frozenset(child for child, command in commands.items() if b"spawn_main" in command)

    def learn(self) -> None:
        """Wait until the arm has rested in the sight of the present pipeline: a channel that repeats its
        values is told from a coarse one by what it did at rest before."""
        number = http.get(f"{self.url}/v1/health").json()["pipeline"]["restarts"]
        if number != self._learned:
            time.sleep(SCRIPT.duration)
            self._learned = number

    def codes(self) -> tuple[int, int]:
        """What `GET /v1/ready` and `GET /v1/contacts` answer."""
        ready, contacts = (http.get(f"{self.url}/v1/{name}").status_code for name in ("ready", "contacts"))
        return ready, contacts

    def until(self, condition: Callable[[str, str], bool]) -> float:
        """How long it took until status and message are so [s]."""
        begin = time.monotonic()
        while True:
            health = http.get(f"{self.url}/v1/health", timeout=10.0).json()
            if not condition(health["status"], health["message"]):
                self.last = health["message"]
            else:
                return time.monotonic() - begin
            assert time.monotonic() - begin < PATIENCE, (health["status"], health["message"])
            time.sleep(0.02)

    def close(self) -> None:
        self._over.set()
        self._reader.join(5.0)

    def _read(self) -> None:
        stream = f"ws{self.url.removeprefix('http')}/v1/stream"
        with connect(stream, close_timeout=0.2) as connection:
            while not self._over.is_set():
                try:
                    message = connection.recv(timeout=0.2)
                except TimeoutError:
                    continue
                except ConnectionClosed:
                    return
                if '"status":"contact"' in str(message):
                    self.links.append(json.loads(message)["contacts"][0]["link"])
                if '"onset"' in str(message):
                    self.onsets.append(json.loads(message)["t"])


@pytest.fixture(scope="module")
def cell() -> Iterator[Cell]:
    with in_own_process(SpoiledDevices, SCRIPT) as devices:
        robot, readings, page = devices.ports()
        options = {
            "--robot-host": "127.0.0.1",
            "--robot-port": robot,
            "--ft-host": "127.0.0.1",
            "--ft-port": readings,
            "--ft-http-port": page,
            "--port": 0,
        }
        arguments = [str(part) for option in options.items() for part in option]
        with child("serve", *arguments) as service:
            url = service.wait_for(READY)
            deadline = time.monotonic() + 280.0  # kernels may have to be compiled
            while http.get(f"{url}/v1/health").json()["status"] != "ok":
                assert time.monotonic() < deadline, http.get(f"{url}/v1/health").json()
                time.sleep(0.1)
            # Also starts the process that locates, which takes the processor for a while.
            body = {"q": [0.0] * 6, "joint_torque": [0.0] * 6}
            http.post(f"{url}/v1/locate", json=body, timeout=280.0).raise_for_status()
            found = Cell(devices, url, service.pid)
            yield found
            found.close()


@pytest.mark.parametrize(
    "row",
    [
        pytest.param(row, marks=() if row.name in TRIED_ALWAYS[row.where] else pytest.mark.long)
        for row in ROWS
    ],
    ids=lambda row: f"{row.where}: {row.name}",
)
def test_a_fault_is_told_does_no_harm_and_is_outlived(cell: Cell, row: Row) -> None:
    cell.set(None)
    cell.until(lambda status, message: status == "ok")
    if row.where in ("robot", "sensor"):
        cell.learn()
    time.sleep(0.5)
    before = len(cell.onsets)
    cell.links.clear()
    begin = time.monotonic()
    cell.set(row)
    try:
        harmless = row.status.startswith("ok")
        if harmless:
            time.sleep(HOLD)
        told = cell.until(
            lambda status, message: bool(re.fullmatch(row.status, status) and re.search(row.reason, message))
        )
        if not harmless:
            expected = 200 if row.status == "degraded" else 503
            # Between two attempts to connect, a mangled packet may pass for a sample.
            deadline = time.monotonic() + PATIENCE
            while (codes := cell.codes()) != (expected, expected):
                assert time.monotonic() < deadline, codes
                time.sleep(0.02)
        time.sleep(max(0.0, HOLD - (time.monotonic() - begin)))
    finally:
        cell.set(None)
    recovered = cell.until(lambda status, message: status == "ok")
    time.sleep(0.5)
    print(
        f"{row.where}: {row.name}: told after {told:.2f} s, well again after {recovered:.2f} s ({cell.last})"
    )
    assert len(cell.onsets) <= before + row.onsets
    assert all(re.fullmatch(row.touched, link) for link in cell.links)
