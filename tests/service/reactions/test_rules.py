"""The rules' file: what it may say, and how it is refused."""

from pathlib import Path
from typing import Any

import pytest
from click.testing import CliRunner
from pydantic import ValidationError

from contactsense import Scene
from contactsense.service.cli.reactions import check
from contactsense.service.reactions.actions.command import CommandAction
from contactsense.service.reactions.actions.registers import RegistersAction
from contactsense.service.reactions.explain import explain, explain_actions
from contactsense.service.reactions.rules import Inputs, ReactionRules, RulesError
from tests.service.reactions.estimates import SCENE

FILE = """
groups: {arm: [upper_arm, forearm]}
actions:
  tell: {type: registers}
  slow: {type: speed_slider, fraction: 0.1}
rules:
  - name: arm
    links: [arm, wrist_1]
    while: moving
    contact: {force: 15, actions: [tell, slow]}
    collision: {force: 60, probability: 0.95, duration: 0.01, actions: [tell]}
    direction: {axis: [0, 0, -1], half_angle: 0.5}
"""


def load(tmp_path: Path, text: str, scene: Scene = SCENE) -> ReactionRules:
    path = tmp_path / "reactions.yaml"
    path.write_text(text)
    rules = ReactionRules.load(path)
    rules.check(scene)
    return rules


def test_a_rule_in_words(tmp_path: Path) -> None:
    rules = load(tmp_path, FILE)
    words = explain(rules, rules.rules[0], SCENE)
    for part in (
        "arm: on upper_arm, forearm, wrist_1 while a joint is faster than 0.02 rad/s",
        "for forces within 29 degrees of (0, 0, -1) in base axes",
        "contact above 15 N with probability 0.9: tell, slow, until the force has gone",
        "collision above 60 N with probability 0.95 for 10 ms",
        "latched until it is acknowledged",
    ):
        assert part in words, words
    actions = explain_actions(rules)
    assert list(actions) == ["tell", "slow"]
    assert actions["tell"].startswith("write input_int_register_47")
    assert actions["slow"] == "set the speed slider to 10 %, it stays there"


def test_links_of_groups(tmp_path: Path) -> None:
    rules = load(tmp_path, FILE)
    assert rules.links_of(("arm", "wrist_1"), SCENE) == {"upper_arm", "forearm", "wrist_1"}
    assert rules.links_of(("any",), SCENE) == set(SCENE.link_names)


def test_groups_of_groups(tmp_path: Path) -> None:
    """Else a rule on such a group would never begin."""
    groups = (
        "groups: {arm: [upper_arm, forearm], both: [arm, wrist], wrist: [wrist_1], forearm: [forearm, tip]}"
    )
    rules = load(
        tmp_path, FILE.replace("groups: {arm: [upper_arm, forearm]}", groups.replace("tip", "wrist_3"))
    )
    assert rules.links_of(("both",), SCENE) == {"upper_arm", "forearm", "wrist_1", "wrist_3"}
    assert rules.links_of(("forearm",), SCENE) == {"forearm", "wrist_3"}
    with pytest.raises(RulesError, match=r"groups: a: group a contains itself, through b$"):
        load(tmp_path, FILE.replace("groups: {arm: [upper_arm, forearm]}", "groups: {a: [b], b: [a]}"))


def test_a_group_that_contains_itself_is_named(tmp_path: Path) -> None:
    with pytest.raises(RulesError, match=r"groups: arm: group arm contains itself$"):
        load(tmp_path, FILE.replace("[upper_arm, forearm]", "[upper_arm, arm]"))


def test_a_group_with_the_name_of_a_link_is_told(tmp_path: Path) -> None:
    """Whoever reads `links: [forearm]` thinks of that link."""
    text = FILE.replace("groups: {arm: [upper_arm, forearm]}", "groups: {forearm: [wrist_1], arm: [forearm]}")
    rules = load(tmp_path, text.replace("links: [arm, wrist_1]", "links: [forearm]"))
    assert explain(rules, rules.rules[0], SCENE).startswith("arm: on wrist_1 while")
    told = CliRunner().invoke(check, [str(tmp_path / "reactions.yaml")])
    assert told.exit_code == 0
    text = "group forearm has the name of a link: in rules forearm stands for wrist_1"
    assert f"warning: {text}" in told.stderr
    assert "arm: on wrist_1 while" in told.stdout
    assert load(tmp_path, FILE).shadowed_links(SCENE) == ()


@pytest.mark.parametrize(
    ("before", "after", "complaint"),
    [
        (
            "{arm: [upper_arm, forearm]}",
            "{arm: [base], any: [base]}",
            "groups: expected names of groups other",
        ),
        ("force: 15", "force: -15", "rules[0].contact.force: expected a number above 0"),
        ("force: 60", "force: 60000", "collision.force: expected a number of at most 5000, got 60000"),
        ("duration: 0.01", "duration: 100", "duration: expected a number of at most 60, got 100"),
        (
            "contact: {force: 15, actions: [tell, slow]}",
            "force: 15",
            "rules[0].force: unknown field (did you mean rules[0].contact.force or rules[0].coll",
        ),
        (
            "groups:",
            "expected: [{name: i, links: [any], point: [450, 0, 0], force: 80}]\ngroups:",
            "expected[0].point: expected x, y, z in m, none above 5, got [450.0, 0.0, 0.0]",
        ),
        ("groups:", "moving_speed: 20\ngroups:", "moving_speed: expected a number of at most 10, got 20"),
        *(
            (
                "groups:",
                f"expected: [{{name: i, links: [any], {field}: {given}, force: 80}}]\ngroups:",
                f"expected[0].{field}: expected a number of at most {most}, got {given}",
            )
            for field, given, most in (("radius", 50, 5), ("timeout", 5000, 3600))
        ),
        ("force: 60", "force: 10", "collision.force: expected at least contact.force (15 N), got 10 N"),
        ("half_angle: 0.5", "half_angle: 30", "half_angle: expected a number of at most 3.14"),
        ("[0, 0, -1]", "[0, 0, 0]", "axis: expected a direction, got three zeros"),
        ("[tell]", "[call]", "rules: arm: expected actions of tell, slow, got 'call'"),
        ("fraction: 0.1", "fraction: 0.0", "fraction: expected a number of at least 0.01"),
        ("type: registers", "type: telepathy", "actions.tell: expected 'type' to be one of"),
        ("type: registers", "type: registers, code: 48", "code: expected a number of at most 47"),
        ("type: registers", "type: registers, link: 47", "expected different registers, got input_int_re"),
        ("while: moving", "while: flying", "while: expected 'moving', 'rest' or 'any'"),
        ("while: moving", "wile: moving", "wile: unknown field (did you mean while?)"),
        ("wrist_1]", "wrist_9]", "rules: arm: links: expected some of base, shoulder"),
        ("wrist_1]", "tool]", "got 'tool'; the scene has no tool with a surface"),
        ("rules:", "rule:", "rules: expected a value, the field is missing"),
        ("groups:", "robot: {host: ''}\ngroups:", "robot.host: expected text that is not empty"),
        pytest.param(
            *("force: 60", "force: 0x" + 5000 * "f", "collision.force: expected a finite number, got inf"),
            id="thousands of digits",
        ),
        ("groups:", "- groups:", "not YAML"),
    ],
)
def test_what_is_wrong_is_named(tmp_path: Path, before: str, after: str, complaint: str) -> None:
    assert before in FILE
    with pytest.raises(RulesError) as refused:
        load(tmp_path, FILE.replace(before, after))
    assert complaint in str(refused.value)
    assert "\n" not in str(refused.value)


def test_a_missing_file_is_named() -> None:
    with pytest.raises(RulesError, match=r"/nowhere/reactions\.yaml: cannot read the rules: No such file"):
        ReactionRules.load("/nowhere/reactions.yaml")


@pytest.mark.parametrize(
    ("action", "complaint"),
    [
        ("{type: webhook, url: 'http://h/'}", "expected either secret or secret_file, got neither"),
        (
            "{type: webhook, url: 'http://h/', secret: hunter2, secret_file: f}",
            "expected either secret or secret_file, got both",
        ),
        ("{type: webhook, url: 'http://h/', secret: hunter2}", "secret: expected whsec_"),
        (
            "{type: webhook, url: 'ftp://h/', secret_file: f}",
            "url: expected an address such as https://example.com/contacts, got 'ftp://h/'",
        ),
        ("{type: stop_program, deceleration: 1e-300}", "deceleration: expected a number of at least 0.01"),
        ("{type: ur_rtde_stop, deceleration: 0}", "deceleration: expected a number of at least 0.01"),
        ("{type: ur_rtde_stop, frequency: 1e-300}", "frequency: expected a number of at least 1"),
        ("{type: command, command: []}", "command: expected a length of at least 1, got 0"),
        ("{type: dashboard, command: unlock protective stop}", "command: expected"),
        (
            '{type: dashboard, command: popup, text: "a\\nplay"}',
            "text: expected a single line, got 'a\\nplay'",
        ),
        (
            '{type: dashboard, command: popup, text: "a\\rplay"}',
            "text: expected a single line, got 'a\\rplay'",
        ),
        (
            "{type: dashboard, command: popup, text: '{force} N at {place}'}",
            "actions.tell.text: expected only {rule}, {level}, {link}, {force} in braces, got {place}",
        ),
    ],
)
def test_wrong_actions(tmp_path: Path, action: str, complaint: str) -> None:
    with pytest.raises(RulesError) as refused:
        load(tmp_path, FILE.replace("{type: registers}", action))
    assert complaint in str(refused.value)
    assert "hunter2" not in str(refused.value)


def test_a_secret_is_beside_its_rules_and_what_is_missing_is_told(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Whatever the working folder is; before the first contact, not after it."""
    monkeypatch.chdir("/")
    text = FILE.replace("{type: registers}", "{type: webhook, url: 'http://h/', secret_file: own.secret}")
    text = text.replace("actions:", "actions:\n  note: {type: command, command: [/absent/program]}", 1)
    rules = load(tmp_path, text)
    assert rules.missing == (
        "action note: /absent/program: expected a program that can be run, found none",
        f"action tell: secret_file: {tmp_path / 'own.secret'}: No such file or directory",
    )
    (tmp_path / "own.secret").write_text("whsec_" + "A" * 32)
    assert len(rules.missing) == 1
    result = CliRunner().invoke(check, [str(tmp_path / "reactions.yaml")])
    assert result.exit_code == 0
    assert "warning: action note: /absent/program" in result.stderr


def test_a_program_that_is_a_path_is_beside_its_rules(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Not where the service happens to be started; a name alone is looked for on the path."""
    (tmp_path / "note.sh").write_text('#!/bin/sh\ncat > "$1"\n')
    (tmp_path / "note.sh").chmod(0o755)
    elsewhere = tmp_path / "elsewhere"
    elsewhere.mkdir()
    monkeypatch.chdir(elsewhere)
    command = "{type: command, command: [./note.sh, " + str(tmp_path / "told") + "]}"
    rules = load(tmp_path, FILE.replace("{type: registers}", command))
    assert rules.missing == ()
    action = rules.actions["tell"]
    assert isinstance(action, CommandAction)
    assert action.perform({"rule": "arm"}, "") == "exit status 0"
    assert (tmp_path / "told").read_text() == '{"rule": "arm"}'
    alone = load(tmp_path, FILE.replace("{type: registers}", "{type: command, command: [sh]}"))
    assert alone.actions["tell"].describe() == "run sh (at most 10 s)"


@pytest.mark.parametrize(
    ("given", "complaint"),
    [
        (
            {"acknowledge": "input_bit_register_64"},
            "expected output_bit_register_64 to 127 or output_int_register_0 to 47, "
            "got 'input_bit_register_64'",
        ),
        ({"announce": "output_int_register_48"}, "expected output_int_register_0 to 47, got"),
        ({"announce": "output_bit_register_64"}, "expected output_int_register_0 to 47, got"),
        ({"announce": 24}, "expected the name of a register, such as output_int_register_24, got the number"),
    ],
)
def test_inputs_are_registers_that_a_program_can_write(given: dict[str, Any], complaint: str) -> None:
    Inputs(acknowledge="output_bit_register_127", announce="output_int_register_47")
    with pytest.raises(ValidationError, match=complaint):
        Inputs.model_validate(given)


@pytest.mark.parametrize(
    ("field", "given", "name"),
    [
        ("code", 0, "input_int_register_0"),
        ("code", "input_int_register_47", "input_int_register_47"),
        ("link", "24", "input_int_register_24"),
        ("force", "input_double_register_0", "input_double_register_0"),
        ("force", 47, "input_double_register_47"),
        ("time", 46, "input_double_register_46"),
        ("heartbeat", 64, "input_bit_register_64"),
        ("heartbeat", "input_bit_register_127", "input_bit_register_127"),
        ("contact", 68, "input_bit_register_68"),
    ],
)
def test_a_register_is_stated_by_its_number_or_its_name(field: str, given: Any, name: str) -> None:
    assert name in RegistersAction.model_validate({"type": "registers", field: given}).names


@pytest.mark.parametrize(
    ("field", "given"),
    [
        *(("code", given) for given in ("input_double_register_46", "input_int_register_", "\u00b2", 48, -1)),
        *(("force", given) for given in ("input_int_register_46", 48, -1)),
        *(("heartbeat", given) for given in ("input_int_register_70", 63, 128)),
    ],
)
def test_what_is_no_register_is_refused(field: str, given: Any) -> None:
    told = f"{field}\n.*expected the number N of a register" if isinstance(given, str) else field
    with pytest.raises(ValidationError, match=told):
        RegistersAction.model_validate({"type": "registers", field: given})
