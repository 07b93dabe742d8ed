"""What is reported of collisions and actions."""

from dataclasses import replace
from typing import Any

from contactsense.service.reactions.actions.command import CommandAction
from contactsense.service.reactions.decision import Decision, Origin
from contactsense.service.reactions.reports import Reports
from tests.service.reactions.estimates import contact

BEGIN = Decision("arm", "collision", "begin", ("a",), 2.0, 0.97)


def reports() -> Reports:
    return Reports({"a": CommandAction(type="command", command=("true",))})


def event(made: Reports) -> dict[str, Any]:
    (report,) = made.take()
    found: dict[str, Any] = report["event"]
    return found


def test_a_collision_has_the_place_of_its_contact_if_it_has_one() -> None:
    made = reports()
    touched = BEGIN.with_contact(contact())
    made.collision(touched)
    told = event(made)
    assert (told["point"], told["point_base"], told["force_base"]) == (
        [0.1, 0.0, 0.0], [0.5, 0.0, 0.4], [0.0, -20.0, 0.0]
    )  # fmt: skip
    assert (told["t"], told["rule"], told["probability"], told["force"]) == (2.0, "arm", 0.97, 20.0)
    made.collision(replace(BEGIN, force=30.0))
    told = event(made)
    assert (told["point"], told["point_base"], told["force_base"], told["force"]) == (None, None, None, 30.0)


def test_the_state_of_an_action_is_that_of_its_latest_result() -> None:
    made, origin = reports(), Origin("arm", "forearm")
    health = made.health["a"]
    results = [(True, "sent"), (False, "no answer"), (True, "")]
    for count, (ok, reason) in enumerate(results, 1):
        made.started("a")
        made.result("a", ok, reason, 0.5 * count, origin)
        assert (health.started, health.took) == (count, 0.5 * count)
        assert (health.state, health.error) == ("ok" if ok else "failing", "" if ok else reason)
    assert health.failed == 1
    told = [report["event"] for report in made.take()]
    assert [each["reason"] for each in told] == ["done: sent", "failed: no answer", "done"]
    assert {(each["action"], each["rule"], each["link"]) for each in told} == {("a", "arm", "forearm")}
    assert made.take() == []


def test_a_connection_that_fails_is_told_once_and_is_in_order_again_once() -> None:
    made = reports()
    health = made.health["a"]
    assert not made.connection("a", "", False)
    assert health.state == "idle"
    assert not made.connection("a", "refused", False)
    assert event(made)["reason"] == "failed: refused"
    assert not made.connection("a", "refused", False)
    assert made.take() == []
    assert (health.state, health.error, health.failed) == ("failing", "refused", 1)
    assert made.connection("a", "", False)
    assert (health.state, health.error) == ("failing", "")
    assert not made.connection("a", "", True)
    assert (health.state, health.failed) == ("ok", 1)
    assert made.take() == []
