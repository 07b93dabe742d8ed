"""What the service knows of the reactions, from reports of the pipeline's process."""

import asyncio
import logging
from functools import partial
from pathlib import Path
from typing import Any

import pytest

from contactsense.service.reactions import state
from contactsense.service.reactions.actions.registers import RegistersAction
from contactsense.service.reactions.actions.speed_slider import SpeedSliderAction
from contactsense.service.reactions.rules import ReactionRules, RobotAddress, RulesError
from contactsense.service.reactions.state import Reactions, ReactionSettings
from tests.service.reactions.estimates import SCENE

RULES = ReactionRules.model_validate(
    {"rules": [{"name": name, "links": ["any"], "collision": {"force": 50.0}} for name in ("old", "new")]}
)
SLOW = RULES.model_copy(
    update={"actions": {"slow": SpeedSliderAction(type="speed_slider", fraction=0.1, restore=1.0)}}
)


def latch(rule: str, level: str = "collision", link: str = "forearm") -> dict[str, Any]:
    return {"rule": rule, "level": level, "kind": "begin", "t": 1.0, "link": link, "force": 60.0}


def report(
    *active: dict[str, Any], restored: bool, started: bool = False, lowered: float | None = None
) -> dict[str, Any]:
    return {
        "type": "reactions", "started": started, "answer": None, "restored": restored, "active": list(active),
        "expected": [], "actions": {}, "lowered": lowered,
    }  # fmt: skip


def test_latches_of_before_and_of_a_new_process_are_listed_once_each_until_it_has_all() -> None:
    sent: list[dict[str, Any]] = []
    reactions = Reactions(RULES, None, lambda command: sent.append(command) or True)  # type: ignore[func-returns-value]
    stored: list[list[str]] = []
    reactions.on_latched = lambda latched: stored.append([found["rule"] for found in latched])
    reactions.restore([latch("old")])
    reactions.handle_report(report(restored=False, started=True))
    assert sent == [{"type": "restore", "decisions": [latch("old")], "lowered": None}]
    for _ in range(3):
        reactions.handle_report(report(latch("new"), restored=False))
        assert [found.rule for found in reactions.latches] == ["old", "new"]
    reactions.handle_report(report(latch("old"), latch("new"), restored=True))
    assert [found.rule for found in reactions.latches] == ["old", "new"]
    reactions.handle_report(report(latch("new"), restored=True))
    assert [found.rule for found in reactions.latches] == ["new"]
    assert stored == [["old", "new"], ["new"]]


def test_a_contact_level_is_active_and_not_latched() -> None:
    sent: list[dict[str, Any]] = []
    reactions = Reactions(RULES, None, lambda command: sent.append(command) or True)  # type: ignore[func-returns-value]
    reactions.handle_report(report(latch("old", "contact"), latch("new"), restored=True))
    assert (reactions.health().latched, [found.rule for found in reactions.latches]) == (1, ["new"])
    assert [found["rule"] for found in reactions.out(SCENE).active] == ["old", "new"]
    reactions.handle_report(report(restored=False, started=True))
    assert sent == [{"type": "restore", "decisions": [latch("new")], "lowered": None}]
    reactions.handle_report(report(restored=False))
    assert [found["rule"] for found in reactions.out(SCENE).active] == ["new"]


def test_the_state_of_rules_and_actions_is_that_of_the_latest_report() -> None:
    reactions = Reactions(with_actions(note={"type": "command", "command": ["true"]}), None, lambda _: True)
    failing = {"note": {"type": "command", "state": "failing", "error": "exit status 1"}}
    found = {**report(latch("new"), restored=True), "expected": ["insert"], "actions": failing}
    reactions.handle_report(found)
    out = reactions.out(SCENE)
    assert [words.split(":")[0] for words in out.rules] == ["old", "new"]
    assert list(out.does) == ["note"]
    assert (out.status, out.expected, [each.rule for each in out.latched]) == ("failing", ["insert"], ["new"])
    assert (out.actions["note"].error, out.actions) == ("exit status 1", reactions.health().actions)


def test_a_new_process_is_told_that_the_one_before_has_lowered_the_slider() -> None:
    sent: list[dict[str, Any]] = []
    reactions = Reactions(SLOW, "192.0.2.1", lambda command: sent.append(command) or True)  # type: ignore[func-returns-value]
    reactions.handle_report(report(restored=True, lowered=0.1))
    reactions.handle_report(report(restored=False, started=True))
    # It ends before it has been told.
    reactions.handle_report(report(restored=False))
    reactions.handle_report(report(restored=False, started=True))
    reactions.handle_report(report(restored=True))
    reactions.handle_report(report(restored=False, started=True))
    assert [command["lowered"] for command in sent] == [0.1, 0.1, None]


def test_the_event_of_a_delivery_has_the_time_of_the_sample() -> None:
    decision = {"t": 3.5, "rule": "old", "link": "forearm"}
    event = Reactions(RULES, None, lambda _: True).note_webhook("hook", True, "answered 200", decision)
    assert (event.t, event.action, event.reason) == (3.5, "hook", "done: answered 200")
    assert (event.rule, event.link) == ("old", "forearm")
    damaged = Reactions(RULES, None, lambda _: True).note_webhook("hook", False, "lost", {})
    assert (damaged.t, damaged.rule, damaged.link, damaged.reason) == (None, "", "", "failed: lost")


@pytest.mark.parametrize(
    ("robot", "port"), [({}, 30104), ({"host": "192.0.2.2"}, None), ({"rtde_port": 30204}, 30204)]
)
def test_the_registers_are_those_of_the_controller_that_sends_the_samples(
    robot: dict[str, Any], port: int | None
) -> None:
    """The port follows --robot-port, unless the rules name a controller or a port."""
    rules = ReactionRules.model_validate({**RULES.model_dump(by_alias=True), "robot": robot})
    reactions = Reactions(rules, "192.0.2.1", lambda _: True, 30104)
    made = reactions.factory
    assert isinstance(made, partial)
    assert made.keywords["host"] == robot.get("host", "192.0.2.1")
    assert made.keywords["rules"].robot.rtde_port == port


def test_registers_that_a_reload_leaves_with_their_last_values_are_named(
    caplog: pytest.LogCaptureFixture,
) -> None:
    """A robot program that still reads them sees a collision that nobody ends."""

    def rules(**numbers: int) -> ReactionRules:
        tell = RegistersAction(type="registers", **numbers)  # type: ignore[arg-type]
        return RULES.model_copy(update={"actions": {"tell": tell}})

    reactions = Reactions(rules(), "192.0.2.1", lambda command: True)
    reactions.replace(rules(period=1))
    assert "not written any more" not in caplog.text
    reactions.replace(rules(code=46, collision=70))
    assert "input_int_register_47, input_bit_register_66: not written any more" in caplog.text
    caplog.clear()
    reactions.replace(RULES)
    assert "input_int_register_46, input_double_register_47, input_bit_register_64" in caplog.text


@pytest.mark.parametrize(
    ("host", "port", "left"), [("192.0.2.2", 30004, True), (None, 30104, True), (None, 30004, False)]
)
def test_registers_of_another_controller_are_others(
    host: str | None, port: int, left: bool, caplog: pytest.LogCaptureFixture
) -> None:
    def rules(host: str | None, port: int) -> ReactionRules:
        given = with_actions(tell={"type": "registers"})
        return given.model_copy(update={"robot": RobotAddress(host=host, rtde_port=port)})

    reactions = Reactions(rules(None, 30004), "192.0.2.1", lambda _: True)
    reactions.replace(rules(host, port))
    assert ("input_int_register_47, " in caplog.text) == left


def test_rules_that_vanish_are_reported(caplog: pytest.LogCaptureFixture) -> None:
    reactions = Reactions(RULES, None, lambda _: True)
    with caplog.at_level(logging.WARNING, "contactsense"):
        reactions.replace(RULES)
        assert not caplog.messages
        reactions.replace(None)
    assert caplog.messages == ["reactions: there are no rules any more: nothing reacts to contacts"]


@pytest.mark.parametrize(
    ("restore", "kept", "after"),
    [
        (1.0, True, "the next start raises it once no force acts, unless somebody has moved it"),
        (
            1.0,
            False,
            "a force may still act, and without --journal no later start raises it: raise it by hand",
        ),
        (None, True, "it stays there, as its action has no restore"),
    ],
)
def test_a_slider_that_is_low_at_the_end_is_told(
    caplog: pytest.LogCaptureFixture, restore: float | None, kept: bool, after: str
) -> None:
    action = SpeedSliderAction(type="speed_slider", fraction=0.1, restore=restore)
    rules = RULES.model_copy(update={"actions": {"slow": action}})
    reactions = Reactions(rules, "192.0.2.1", lambda _: True, kept=kept)
    with caplog.at_level(logging.WARNING, "contactsense"):
        caplog.clear()
        reactions.note_end()
        assert not caplog.messages
        reactions.handle_report(report(restored=True, lowered=0.1))
        reactions.note_end()
    assert caplog.messages == [f"the service ends with the speed slider at 10 %: {after}"]


@pytest.mark.parametrize(("kept", "times"), [(True, 0), (False, 1)])
def test_a_start_without_a_journal_says_what_becomes_of_the_slider(
    caplog: pytest.LogCaptureFixture, kept: bool, times: int
) -> None:
    with caplog.at_level(logging.WARNING, "contactsense"):
        Reactions(SLOW, "192.0.2.1", lambda _: True, kept=kept)
    told = "reactions: action slow: without --journal FILE the speed slider stays low if the service ends"
    assert [text.startswith(told) for text in caplog.messages] == [True] * times


def test_a_program_that_is_not_there_is_told_at_the_start(caplog: pytest.LogCaptureFixture) -> None:
    note = {"type": "command", "command": ["/no/such/program"]}
    Reactions(with_actions(note=note), None, lambda _: True)
    (text,) = caplog.messages
    assert text.startswith("reactions: action note: ")
    assert "/no/such/program" in text


@pytest.mark.parametrize(
    ("given", "scene", "beside", "found"),
    [
        (None, "scene.yaml", True, "beside"),
        (None, "scene.yaml", False, None),
        (None, None, True, None),
        ("other.yaml", "scene.yaml", True, "other"),
        ("other.yaml", None, True, "other"),
    ],
)
def test_rules_are_those_of_the_file_that_is_given_or_lies_beside_the_scene(
    tmp_path: Path, given: str | None, scene: str | None, beside: bool, found: str | None
) -> None:
    text = "rules: [{name: NAME, links: [any], contact: {force: 10}}]"
    (tmp_path / "other.yaml").write_text(text.replace("NAME", "other"))
    if beside:
        (tmp_path / "reactions.yaml").write_text(text.replace("NAME", "beside"))
    settings = ReactionSettings(file=None if given is None else tmp_path / given)
    rules = settings.load(SCENE, None if scene is None else tmp_path / scene)
    assert (None if rules is None else rules.rules[0].name) == found


def test_rules_in_use_are_named_and_groups_that_hide_a_link(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    file = tmp_path / "rules.yaml"
    file.write_text(
        "groups: {forearm: [upper_arm]}\nrules: [{name: arm, links: [forearm], contact: {force: 10}}]"
    )
    with caplog.at_level(logging.INFO, "contactsense"):
        ReactionSettings(file=file).load(SCENE, None)
    assert caplog.messages == [
        "reactions: group forearm has the name of a link: in rules forearm stands for upper_arm",
        f"reactions: rules of {file}: arm",
    ]


def with_actions(**actions: dict[str, Any]) -> ReactionRules:
    return ReactionRules.model_validate({**RULES.model_dump(by_alias=True), "actions": actions})


def test_actions_on_a_robot_need_its_address() -> None:
    """The rules name it, or samples come from it; others do without."""
    rules = with_actions(note={"type": "command", "command": ["true"]}, tell={"type": "registers"})
    with pytest.raises(
        RulesError, match=r"robot\.host: expected the controller's address for tell, got none"
    ):
        Reactions(rules, None, lambda _: True)
    reactions = Reactions(with_actions(note={"type": "command", "command": ["true"]}), None, lambda _: True)
    with pytest.raises(RulesError):
        reactions.replace(rules)
    assert reactions.rules is not None
    assert list(reactions.rules.actions) == ["note"]  # nothing has changed
    Reactions(rules, "192.0.2.1", lambda _: True)


def test_rules_that_no_longer_move_a_slider_that_is_low_say_so(caplog: pytest.LogCaptureFixture) -> None:
    stored: list[float | None] = []
    reactions = Reactions(SLOW, "192.0.2.1", lambda _: True)
    reactions.on_lowered = stored.append
    reactions.handle_report(report(restored=True, lowered=0.1))
    reactions.replace(SLOW)
    assert reactions.health().lowered == 0.1
    assert not caplog.messages
    reactions.replace(RULES)
    assert reactions.health().lowered is None
    assert caplog.messages == ["reactions: the speed slider is at 10 %: no action raises it any more"]
    reactions.handle_report(report(restored=True, lowered=0.1))  # of the process with the rules of before
    assert reactions.health().lowered is None
    assert stored == [0.1, None]


def test_what_a_process_lowers_before_it_knows_of_the_one_before_is_known() -> None:
    reactions = Reactions(SLOW, "192.0.2.1", lambda _: True)
    reactions.handle_report(report(restored=False, lowered=0.1))
    assert reactions.health().lowered == 0.1


@pytest.mark.parametrize("rules", [SLOW, RULES, None])
def test_a_start_says_what_the_last_end_has_left(
    rules: ReactionRules | None, caplog: pytest.LogCaptureFixture
) -> None:
    reactions = Reactions(rules, "192.0.2.1", lambda _: True)
    reactions.restore([latch("old"), latch("new", link="")], 0.1)
    raised = "it is raised once no force acts, unless somebody has moved it"
    slider = raised if rules is SLOW else "no action raises it any more"
    assert caplog.messages == [
        f"the service ended with the speed slider at 10 %: {slider}",
        *[
            f"rule {name} is still latched"
            for name in ("old: the collision on forearm", "new: the collision on the arm")
            if rules is not None
        ],
    ]
    assert reactions.health().lowered == (0.1 if rules is SLOW else None)
    assert reactions.health().latched == 2 * (rules is not None)


def test_webhooks_that_fail_are_failing_until_one_is_delivered() -> None:
    hook = {"type": "webhook", "url": "http://127.0.0.1/", "secret_file": "none"}
    reactions = Reactions(with_actions(hook=hook, other=hook), None, lambda _: True)
    told = {"t": 0.0, "rule": "old", "link": ""}
    reactions.note_webhook("other", True, "answered 200", told)
    assert reactions.note_webhook("hook", False, "refused", told).reason == "failed: refused"
    found = reactions.health()
    assert (found.status, found.actions["hook"].error) == ("failing", "refused")
    for _ in range(2):
        reactions.note_webhook("hook", True, "answered 200", told)
    found = reactions.health()
    assert (found.status, found.actions["hook"].error) == ("ok", "")
    assert (found.actions["hook"].started, found.actions["hook"].failed) == (3, 1)
    reactions.replace(RULES)
    assert not reactions.health().actions


@pytest.mark.parametrize(("name", "sent"), [("insert", True), ("remove", False)])
@pytest.mark.parametrize("runs", [True, False])
def test_only_what_the_rules_expect_is_announced(name: str, sent: bool, runs: bool) -> None:
    expected = [{"name": known, "links": ["forearm"], "force": 80.0} for known in ("insert", "place")]
    rules = ReactionRules.model_validate({**RULES.model_dump(by_alias=True), "expected": expected})
    commands: list[dict[str, Any]] = []
    reactions = Reactions(rules, None, lambda command: commands.append(command) or runs)  # type: ignore[func-returns-value]
    assert reactions.announce(name) == (sent and runs)
    assert commands == [{"type": "announce", "name": name}] * sent


@pytest.mark.parametrize("runs", [True, False])
def test_other_commands_are_passed_on_while_a_process_runs(runs: bool) -> None:
    commands: list[dict[str, Any]] = []
    reactions = Reactions(RULES, None, lambda command: commands.append(command) or runs)  # type: ignore[func-returns-value]
    assert reactions.acknowledge("old", "a person") == runs
    assert reactions.withdraw("insert") == runs
    assert commands == [
        {"type": "acknowledge", "rule": "old", "by": "a person"},
        {"type": "withdraw", "name": "insert"},
    ]


@pytest.mark.parametrize("runs", [True, False])
def test_a_request_waits_until_it_is_answered(runs: bool) -> None:
    """And not at all where no pipeline runs."""

    async def scenario() -> bool:
        loop = asyncio.get_running_loop()

        def send(command: dict[str, Any]) -> bool:
            answer = {**report(restored=True), "answer": command["id"]}
            loop.call_soon(reactions.handle_report, {**answer, "answer": "another"})
            loop.call_later(0.01, reactions.handle_report, answer)
            return runs

        reactions = Reactions(RULES, None, send)
        begin = loop.time()
        done = await reactions.request({"type": "withdraw", "name": None})
        assert (loop.time() - begin >= 0.009) == runs
        return done

    assert asyncio.run(scenario()) == runs


def test_a_request_that_nobody_answers_has_not_been_executed(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(state, "_ANSWER", 0.01)
    reactions = Reactions(RULES, None, lambda _: True)
    assert not asyncio.run(reactions.request({"type": "withdraw", "name": None}))
    assert not reactions._answers  # nothing waits for it any more
