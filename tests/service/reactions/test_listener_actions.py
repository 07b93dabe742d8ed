"""What a listener reports of the actions of a decision."""

import socket
import time
from typing import Any

from contactsense.service.reactions.listener import ReactionListener
from contactsense.service.reactions.rules import ReactionRules
from tests.service.loopback import rtde_server, until
from tests.service.reactions.estimates import SCENE, contact, estimate, sample
from tests.service.reactions.listener_play import Play


def rules(**actions: dict[str, Any]) -> dict[str, Any]:
    """Rules of which a force above 50 N starts all of these actions."""
    collision = {"force": 50.0, "actions": list(actions)}
    return {"actions": actions, "rules": [{"name": "arm", "links": ["any"], "collision": collision}]}


def hit(listener: ReactionListener) -> list[dict[str, Any]]:
    """What is reported of a collision."""
    listener.take_reports()
    listener.receive(sample(0.5), estimate(0.5, contact(newtons=60.0)))
    return listener.take_reports()


def results(reports: list[dict[str, Any]]) -> dict[str, str]:
    """Action -> what is said of it."""
    events = [report["event"] for report in reports if report["type"] == "event"]
    return {event["action"]: event["reason"] for event in events if event["kind"] == "action"}


def test_a_webhook_is_passed_on_with_its_decision() -> None:
    hook = {"type": "webhook", "url": "http://127.0.0.1/", "secret_file": "none"}
    listener = ReactionListener(ReactionRules.model_validate(rules(hook=hook)), SCENE, None)
    reports = hit(listener)
    listener.close()
    (passed,) = (report for report in reports if report["type"] == "webhook")
    assert passed["action"] == "hook"
    decision = passed["decision"]
    assert (decision["rule"], decision["link"], decision["t"]) == ("arm", "forearm", 0.5)
    (state,) = (report for report in reports if report["type"] == "reactions")
    assert state["actions"]["hook"]["started"] == 1


def test_an_action_that_cannot_be_started_has_failed() -> None:
    note = {"type": "command", "command": ["true"]}
    listener = ReactionListener(ReactionRules.model_validate(rules(note=note)), SCENE, None)
    listener._executor.close()  # as if it had just ended
    assert results(hit(listener)) == {
        "note": "failed: the executor's process is not running; it is being restarted"
    }
    listener.close()


WRITTEN = {"tell": {"type": "registers"}, "slow": {"type": "speed_slider", "fraction": 0.1}}


def test_what_is_written_is_done() -> None:
    with rtde_server() as server:
        made = Play(server, rules(**WRITTEN))
        try:
            made.until(lambda: made.slider_is_read() and made.code() == 0)
            reports = hit(made.listener)
            assert results(reports) == {"tell": "done", "slow": "done: set to 10 %"}
            (state,) = (report for report in reports if report["type"] == "reactions")
            assert [action["started"] for action in state["actions"].values()] == [1, 1]
        finally:
            made.listener.close()


def test_what_cannot_be_written_is_told_with_what_is_wrong_with_the_connection() -> None:
    with socket.create_server(("127.0.0.1", 0)) as taken:
        port = taken.getsockname()[1]
    found = ReactionRules.model_validate({**rules(**WRITTEN), "robot": {"rtde_port": port}})
    listener = ReactionListener(found, SCENE, "127.0.0.1")
    listener.command({"type": "restore", "decisions": []})

    def is_refused() -> bool:
        listener.tick(time.monotonic())
        return "refused" in results(listener.take_reports()).get("slow", "")

    assert until(is_refused)
    why = f"failed: RTDE inputs of the robot at 127.0.0.1:{port}: cannot be reached: Connection refused"
    assert results(hit(listener)) == {"tell": why, "slow": why}
    listener.close()


def test_what_cannot_be_written_as_nobody_answers_yet_is_told() -> None:
    with socket.create_server(("127.0.0.1", 0)) as mute:
        given = {**rules(**WRITTEN), "robot": {"rtde_port": mute.getsockname()[1]}}
        listener = ReactionListener(ReactionRules.model_validate(given), SCENE, "127.0.0.1")
        listener.command({"type": "restore", "decisions": []})
        assert results(hit(listener)) == {"tell": "failed: not connected", "slow": "failed: not connected"}
        listener.close()
