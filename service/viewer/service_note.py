"""What a service says of itself, short enough for a phone: many failed actions are one line there."""

from typing import NamedTuple

from contactsense.service.api.messages import HealthOut
from contactsense.service.reactions.health import failure
from contactsense.service.viewer.literal_text import literal


class ServiceNote(NamedTuple):
    """State of the service for the panel."""

    text: str
    """Status and reasons, as Markdown."""
    failures: tuple[str, ...] = ()
    """What is wrong with each action, where `text` has their number only."""


def service_note(health: HealthOut) -> ServiceNote:
    """Status and reasons of a service; two or more failed actions are counted, and told apart from them."""
    actions = {failure(name, action): (name, action) for name, action in health.reactions.actions.items()}
    failed = [reason for reason in health.reasons if reason in actions]
    if len(failed) < 2:
        return ServiceNote(literal(f"{health.status}: {health.message}"))
    reasons = [reason for reason in health.reasons if reason not in actions]
    reasons.append(f"{len(failed)} actions failed at their latest attempts, see below")
    failures = tuple(f"{name}: {action.error}" for name, action in (actions[reason] for reason in failed))
    return ServiceNote(literal(f"{health.status}: {'; '.join(reasons)}"), failures)
