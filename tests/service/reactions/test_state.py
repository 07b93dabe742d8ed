"""What the service knows of the reactions, from reports of the pipeline's process."""

import logging
from typing import Any

import pytest

from contactsense.service.reactions.actions.registers import RegistersAction
from contactsense.service.reactions.actions.speed_slider import SpeedSliderAction
from contactsense.service.reactions.rules import ReactionRules
from contactsense.service.reactions.state import Reactions

RULES = ReactionRules.model_validate(
    {"rules": [{"name": name, "links": ["any"], "collision": {"force": 50.0}} for name in ("old", "new")]}
)
SLOW = RULES.model_copy(
    update={"actions": {"slow": SpeedSliderAction(type="speed_slider", fraction=0.1, restore=1.0)}}
)


def latch(rule: str) -> dict[str, Any]:
    return {"rule": rule, "level": "collision", "kind": "begin", "t": 1.0, "link": "forearm", "force": 60.0}


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


@pytest.mark.parametrize(
    ("robot", "port"), [({}, 30104), ({"host": "192.0.2.2"}, None), ({"rtde_port": 30204}, 30204)]
)
def test_the_registers_are_those_of_the_controller_that_sends_the_samples(
    robot: dict[str, Any], port: int | None
) -> None:
    """The port follows --robot-port, unless the rules name a controller or a port."""
    rules = ReactionRules.model_validate({**RULES.model_dump(by_alias=True), "robot": robot})
    reactions = Reactions(rules, "192.0.2.1", lambda _: True, 30104)
    assert reactions.rules is not None
    assert reactions.rules.robot.rtde_port == port


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
