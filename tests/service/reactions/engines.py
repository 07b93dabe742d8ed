"""An engine of a few rules, and what it decides."""

from typing import Any

from contactsense import Estimate
from contactsense.service.reactions.engine import Engine
from contactsense.service.reactions.rules import ReactionRules
from tests.service.reactions.estimates import SCENE, contact, sample

HIGH = contact(newtons=60.0)
"""A contact beyond the level of `rule`."""


def engine(*rules: dict[str, Any], **more: Any) -> Engine:
    return Engine(ReactionRules.model_validate({"rules": rules, **more}), SCENE)


def rule(**fields: Any) -> dict[str, Any]:
    return {"name": "r", "links": ["forearm"], "collision": {"force": 50.0}, **fields}


def run(machine: Engine, *estimates: Estimate, speed: float = 0.0) -> list[tuple[float, str, str]]:
    return [(d.t, d.level, d.kind) for e in estimates for d in machine.step(sample(e.t, speed), e)]
