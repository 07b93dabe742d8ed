"""What docs/service.md shows works as it stands there."""

import json
import re
from pathlib import Path

import pytest

from service.messages import LocateOneIn
from service.mock.arm import simulate
from service.mock.script import Script

PAGE = (Path(__file__).parents[2] / "docs" / "service.md").read_text(encoding="utf-8")


def block(language: str) -> str:
    found = re.search(rf"```{language}\n(.*?)```", PAGE, re.DOTALL)
    assert found is not None
    return found[1]


def test_the_script_can_be_played() -> None:
    motion = simulate(Script.parse(block("yaml")))
    assert len(motion.touches) == 1


def test_the_request_is_accepted() -> None:
    body = re.search(r"-d '(.*?)'", block("sh"), re.DOTALL)
    assert body is not None
    sample = LocateOneIn.model_validate(json.loads(body[1]))
    assert sample.joint_torque == [pytest.approx(x) for x in (0.0, 6.0, 3.5, 0.0, 0.0, 0.0)]


def test_the_client_is_python() -> None:
    compile(block("python"), "docs/service.md", "exec")
