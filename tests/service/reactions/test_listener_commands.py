"""Commands that the service sends to all listeners of the pipeline."""

from contactsense.service.reactions.listener import ReactionListener
from contactsense.service.reactions.rules import ReactionRules
from tests.service.reactions.estimates import SCENE


def test_a_command_to_another_listener_is_left_to_it() -> None:
    rules = {"rules": [{"name": "r", "links": ["any"], "contact": {"force": 9.0}}]}
    listener = ReactionListener(ReactionRules.model_validate(rules), SCENE, None)
    listener.take_reports()
    listener.command({"type": "clip", "number": 1, "id": "7"})
    assert listener.take_reports() == []
    listener.command({"type": "restore", "decisions": [], "id": "8"})
    assert [report["answer"] for report in listener.take_reports()] == ["8"]
    listener.close()
