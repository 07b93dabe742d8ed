"""What docs/controllers.md and the examples for robot programs show is what there is."""

import json
import re
from pathlib import Path

import pytest

from contactsense import Scene
from contactsense.service.controllers import robot_program, sample_message, settings
from contactsense.service.controllers.scene_message import make_scene
from contactsense.service.live.hub import Hub
from contactsense.service.mock.urscript.parser import parse
from contactsense.service.reactions.state import Reactions

ROOT = Path(__file__).parents[3]
PAGE = (ROOT / "docs" / "controllers.md").read_text(encoding="utf-8")
SCRIPTS = sorted((ROOT / "examples" / "urscript").glob("*.script"))
METHODS = robot_program.RobotProgramMethods(
    robot_program.NewestEstimate(Hub(), lambda: False), Reactions(None, None, lambda _: False)
)


def test_the_messages_can_be_used() -> None:
    sample, scene = re.findall(r"```json\n(.*?)```", PAGE, re.DOTALL)
    decoder = sample_message.SampleDecoder(Scene(robot="ur5e"))
    assert decoder.sample(sample_message.decode(sample.encode(), False)).t == 12.5
    assert make_scene(json.loads(scene)["scene"]).robot.name == "ur10e"


def test_the_table_lists_all_methods() -> None:
    assert tuple(re.findall(r"^\| `(\w+)\(\w*\)` \|", PAGE, re.MULTILINE)) == METHODS.names


def test_limits_are_as_they_are() -> None:
    defaults = settings.ControllerSettings()
    assert f"at most {defaults.tracks} connections" in PAGE
    assert f"nothing for {defaults.idle:g} s" in PAGE
    assert f"at most {defaults.connections} connections" in PAGE


@pytest.mark.parametrize("script", SCRIPTS, ids=lambda script: script.stem)
def test_robot_programs_call_what_there_is(script: Path) -> None:
    text = re.sub(r"#.*", "", script.read_text(encoding="utf-8"))
    called = set(re.findall(r"contactsense\.contactsense_(\w+)\(", text))
    called |= set(re.findall(r'socket_send_line\("(\w+)', text))
    assert called
    assert called <= set(METHODS.names)
    for count in re.findall(r"socket_read_ascii_float\((\d+)", text):
        assert int(count) == len(METHODS.call("contact", []))
    answers = re.findall(r"(\w+) = contactsense\.contactsense_(\w+)\(", text)
    methods = dict(answers)
    assert set(answers) == set(methods.items())  # a variable keeps its type, a list its length
    for variable, index in re.findall(r"(\w+)\[(\d+)\]", text):
        if variable in methods:
            assert int(index) < len(METHODS.call(methods[variable], []))
        else:  # the first number is how many have been read
            assert int(index) <= len(METHODS.call("contact", []))
    assert text.count("(") == text.count(")")
    # Who moves cannot watch: a touch during the motion would pass unseen.
    watched = re.findall(r"^( *)while touch_status.*\n((?:\1 .*\n)*)", text, re.MULTILINE)
    assert watched or "touch_status" not in text
    assert all("move" not in body for _, body in watched)
    # Before the first answer there is none, which ends the loop.
    assert not watched or re.search(r"run watch\(\)\s+sleep\(", text)
    # A touch has several statuses: several contacts at a time are one, too.
    assert not re.search(r"touch\[0\] ==", text)
    blocks = len(re.findall(r"^\s*(?:def|if|while|thread)\b", text, re.MULTILINE))
    assert len(re.findall(r"^\s*end\b", text, re.MULTILINE)) == blocks


@pytest.mark.parametrize("script", SCRIPTS, ids=lambda script: script.stem)
def test_the_page_says_that_the_mock_runs_no_such_programs(script: Path) -> None:
    unknown = " ".join(parse(script.read_text(encoding="utf-8")).unknown)
    assert "if " in unknown
    assert "The programs in `examples/urscript` cannot run on `contactsense mock`" in PAGE
