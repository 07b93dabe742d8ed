"""Commands that the service sends to all listeners of the pipeline."""

from contactsense.service.reactions.listener import ReactionListener
from contactsense.service.reactions.rules import ReactionRules
from tests.service.reactions.estimates import SCENE, contact, estimate, sample


def test_a_command_to_another_listener_is_left_to_it() -> None:
    rules = {"rules": [{"name": "r", "links": ["any"], "contact": {"force": 9.0}}]}
    listener = ReactionListener(ReactionRules.model_validate(rules), SCENE, None)
    listener.take_reports()
    listener.command({"type": "clip", "number": 1, "id": "7"})
    assert listener.take_reports() == []
    listener.command({"type": "restore", "decisions": [], "id": "8"})
    assert [report["answer"] for report in listener.take_reports()] == ["8"]
    listener.close()


def test_collisions_of_one_rule_or_of_all_are_acknowledged() -> None:
    rules = [{"name": name, "links": ["any"], "collision": {"force": 50.0}} for name in ("a", "b")]
    listener = ReactionListener(ReactionRules.model_validate({"rules": rules}), SCENE, None)

    def latched() -> list[str]:
        reports = [each for each in listener.take_reports() if each["type"] == "reactions"]
        return [decision["rule"] for decision in reports[-1]["active"]]

    for t, rule, left in ((0.0, "b", ["a"]), (1.0, None, [])):
        listener.receive(sample(t), estimate(t, contact(newtons=60.0)))
        assert sorted(latched()) == ["a", "b"]
        listener.receive(sample(t + 0.1), estimate(t + 0.1))
        listener.command({"type": "acknowledge", "rule": rule, "by": "a test", "id": "1"})
        assert latched() == left
    listener.close()
