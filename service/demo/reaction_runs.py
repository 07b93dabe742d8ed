"""The sweeps with a reaction: the service stops the arm by a rule."""

import json
import socket
import time
from pathlib import Path
from typing import BinaryIO

import yaml

from contactsense.service.api.client import Client
from contactsense.service.demo.child_process import ChildError
from contactsense.service.demo.processes import Stage
from contactsense.service.demo.sweeps import SCRIPT, SETTLE, SWEEPS, Collision, move_program
from contactsense.service.mock.arm.script import Script
from contactsense.service.mock.controller.contact_log import ContactRecord

DECELERATION = 20.0
"""Deceleration of the reaction's stop [rad/s^2]."""
LEVEL = 15.0
"""Force on any link above which the reaction stops the arm [N]."""
LEAD = 3.0
"""Time that the service has to settle before the first sweep [s]."""
RETURNS = 3
"""Largest number of attempts to return: while the arm leaves the obstacle, the rule may stop it again."""
PATIENCE = 60.0
"""Longest time for one motion [s]."""


def rules(stage: Stage) -> dict[str, object]:
    """The rules: a touch of any link stops the arm and writes registers."""
    return {
        "robot": {"rtde_port": stage.rtde_port},
        "actions": {
            "registers": {"type": "registers"},
            "stop": {"type": "stop_program", "deceleration": DECELERATION, "port": stage.secondary_port},
        },
        "rules": [
            {
                "name": "touch",
                "links": ["any"],
                "contact": {"force": LEVEL, "probability": 0.9, "actions": ["stop", "registers"]},
            }
        ],
    }


def with_reactions(stage: Stage, folder: Path) -> list[Collision | None]:
    """Run all sweeps one after another, over the real protocols.

    Args:
        stage: Starts service and arm.
        folder: A folder for the rules and the log of contacts.

    Raises:
        ChildError: Service or arm did not start.
        ClientError: The service ended.
    """
    rules_file, log = folder / "reactions.yaml", folder / "contacts.json"
    rules_file.write_text(yaml.safe_dump(rules(stage)))
    client = stage.start_service("--reactions", str(rules_file))
    arm = stage.start_arm("--script", str(SCRIPT), "--contact-log", str(log))
    start = Script.load(SCRIPT).trajectory.start
    _wait(client, LEAD)
    client.close()  # nobody reads the stream from here on
    with (
        _connected(stage.secondary_port) as robot,
        _connected(stage.dashboard_port) as dashboard,
        dashboard.makefile("rb") as answers,
    ):
        answers.readline()  # the dashboard's greeting
        for sweep in SWEEPS:
            robot.sendall(sweep.program(start).encode())
            _until_stopped(dashboard, answers)
            for _ in range(RETURNS):
                robot.sendall(move_program("back", start).encode())
                _until_stopped(dashboard, answers)
    arm.end()
    records = [ContactRecord(**record) for record in json.loads(log.read_text())]
    return [Collision.of(records, sweep.obstacle) for sweep in SWEEPS]


def _connected(port: int) -> socket.socket:
    return socket.create_connection(("127.0.0.1", port), 5.0)


def _wait(client: Client, seconds: float) -> None:
    """Read estimates until this much of the robot's time has passed."""
    until: float | None = None
    for message in client.stream():
        if not isinstance(message, int):
            until = message.t + seconds if until is None else until
            if message.t >= until:
                return


def _until_stopped(dashboard: socket.socket, answers: BinaryIO) -> None:
    """Wait until the arm's program has ended, or was stopped."""
    deadline = time.monotonic() + PATIENCE
    time.sleep(SETTLE)
    while time.monotonic() < deadline:
        dashboard.sendall(b"programState\n")
        if not answers.readline().startswith(b"PLAYING"):
            return
        time.sleep(0.05)
    raise ChildError(f"the mock arm's program has not ended after {PATIENCE:g} s")
