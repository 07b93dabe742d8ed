"""What docs/service.md and docs/mock.md show works as it stands there."""

import json
import re
from pathlib import Path

import numpy as np
import pytest

from contactsense import Localizer, Scene
from contactsense.service.api.messages import LocateOneIn
from contactsense.service.mock.arm.cell import Cell
from contactsense.service.mock.arm.script import Script
from contactsense.service.mock.controller.robot_controller import RobotController

PAGE = (Path(__file__).parents[2] / "docs" / "service.md").read_text(encoding="utf-8")
MOCK = (Path(__file__).parents[2] / "docs" / "mock.md").read_text(encoding="utf-8")


def block(language: str, page: str = PAGE) -> str:
    found = re.search(rf"```{language}\n(.*?)```", page, re.DOTALL)
    assert found is not None
    return found[1]


def test_the_script_can_be_played() -> None:
    script = Script.parse(block("yaml", MOCK))
    robot = RobotController(Cell.of_script(script), script)
    assert len(robot.script.contacts) == 1


def test_the_request_is_answered_as_the_page_says() -> None:
    body = re.search(r"-d '(.*?)'", block("sh"), re.DOTALL)
    assert body is not None
    sample = LocateOneIn.model_validate(json.loads(body[1]))
    (found, *_) = (
        Localizer(Scene.model_validate({"robot": "ur5e"}))
        .locate(
            np.array(sample.q),
            base_wrench=np.array(sample.base_wrench),
            joint_torque=np.array(sample.joint_torque),
            external=sample.external,
        )
        .contacts
    )
    assert found.link == "forearm"
    assert np.linalg.norm(found.point - [-0.1747, 0.0373, 0.0095]) < 0.002
    assert np.linalg.norm(found.force_base) == pytest.approx(20.0, abs=0.1)


def test_the_client_is_python() -> None:
    compile(block("python"), "docs/service.md", "exec")
