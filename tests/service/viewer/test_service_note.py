"""The state of the service in the panel: short, whatever number of actions fail."""

from contactsense.service.api.messages import HealthOut
from contactsense.service.reactions.health import ActionHealth, ReactionsHealth, failure
from contactsense.service.viewer.service_note import ServiceNote, service_note


def health(reasons: list[str], **actions: str) -> HealthOut:
    """A degraded service whose actions have these errors."""
    failed = {name: ActionHealth(type="webhook", state="failing", error=e) for name, e in actions.items()}
    reasons = [*(failure(name, action) for name, action in failed.items()), *reasons]
    return HealthOut.model_construct(
        status="degraded", message="; ".join(reasons), reasons=reasons,
        reactions=ReactionsHealth(status="failing", actions=failed),
    )  # fmt: skip


def test_one_failed_action_is_told_with_its_error() -> None:
    assert service_note(health(["base_wrench: 9 % are lost"], tell="Connection refused")) == ServiceNote(
        "degraded: action tell failed at its latest attempt: Connection refused; base_wrench: 9 % are lost"
    )


def test_several_are_counted_and_do_not_hide_what_else_is_wrong() -> None:
    note = service_note(health(["base_wrench: 9 % are lost"], tell="Connection refused", stop="no *answer*"))
    assert note == ServiceNote(
        "degraded: base_wrench: 9 % are lost; 2 actions failed at their latest attempts, see below",
        ("tell: Connection refused", "stop: no *answer*"),
    )


def test_what_a_device_answers_is_no_html() -> None:
    assert "<" not in service_note(health([], tell="it printed <b>")).text.replace("\\<", "")
