"""A reaction listener whose robot is the mock controller."""

import time
from collections.abc import Callable
from typing import Any

from contactsense import Estimate
from contactsense.service.reactions.listener import ReactionListener
from contactsense.service.reactions.rtde_inputs import RtdeInputs
from contactsense.service.reactions.rules import ReactionRules
from tests.service.reactions.estimates import SCENE, sample

RULES: dict[str, Any] = {
    "actions": {
        "tell": {"type": "registers"},
        "slow": {"type": "speed_slider", "fraction": 0.1, "restore": 1.0},
    },
    "inputs": {"acknowledge": "output_bit_register_70", "announce": "output_int_register_20"},
    "rules": [
        {
            "name": "arm",
            "links": ["any"],
            "contact": {"force": 15.0, "actions": ["tell", "slow"]},
            "collision": {"force": 50.0, "actions": ["tell"]},
        }
    ],
    "expected": [{"name": "insert", "links": ["forearm"], "force": 100.0, "value": 3}],
}


class Play:
    """A listener whose robot is the mock.

    Args:
        server: The mock.
        rules: Content of the rules' file; None: `RULES`.
        told: Whether the service has told what an earlier process has left: nothing.
    """

    def __init__(self, server: Any, rules: dict[str, Any] | None = None, told: bool = True) -> None:
        found = ReactionRules.model_validate({**(rules or RULES), "robot": {"rtde_port": server.port}})
        self.server, self.inputs = server, server.controller.inputs
        self.listener = ReactionListener(found, SCENE, "127.0.0.1")
        if told:
            self.listener.command({"type": "restore", "decisions": []})
        self.reports: list[dict[str, Any]] = []

    def until(self, condition: Callable[[], object]) -> None:
        deadline = time.monotonic() + 60.0
        while not condition():
            assert time.monotonic() < deadline, (self.inputs, self.reports[-1:])
            self.listener.tick(time.monotonic())
            self.reports += self.listener.take_reports()
            time.sleep(0.002)
        self.reports += self.listener.take_reports()

    def code(self) -> int:
        return int(self.inputs.get("input_int_register_47", (-1,))[0])

    def step(self, what: Estimate) -> None:
        self.listener.receive(sample(what.t), what)
        self.reports += self.listener.take_reports()

    def events(self, kind: str) -> list[dict[str, Any]]:
        return [r["event"] for r in self.reports if r["type"] == "event" and r["event"]["kind"] == kind]

    def slider_is_read(self) -> bool:
        inputs = self.listener._inputs
        return inputs is not None and inputs.ready and "target_speed_fraction" in inputs.values

    def state(self) -> dict[str, Any]:
        return next(r for r in reversed(self.reports) if r["type"] == "reactions")


def poll_until(inputs: RtdeInputs, condition: Callable[[], bool]) -> None:
    """Poll inputs of the controller until a condition holds."""
    deadline = time.monotonic() + 60.0
    while not condition():
        assert time.monotonic() < deadline
        inputs.poll(time.monotonic())
        time.sleep(0.002)
