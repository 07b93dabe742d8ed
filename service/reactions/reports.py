"""What the pipeline's process tells the service of the reactions: events, webhooks to deliver, the state."""

from collections import deque
from collections.abc import Mapping, Sequence
from typing import Any

from contactsense.service.events.model import ContactEvent
from contactsense.service.live.listener import REPORTS
from contactsense.service.reactions.actions import Action
from contactsense.service.reactions.decision import Decision, Origin
from contactsense.service.reactions.health import ActionHealth

NO_RULE = Origin()
"""Of what no decision has started."""


class Reports:
    """Reports that wait for the service, and the health of the actions as they tell it.

    Args:
        actions: The actions by name.
    """

    def __init__(self, actions: Mapping[str, Action]) -> None:
        self.health = {name: ActionHealth(type=action.type) for name, action in actions.items()}
        self.t: float | None = None
        """Time of the newest sample, on the robot's clock; None: there was none [s]."""
        self._waiting: deque[dict[str, Any]] = deque(maxlen=REPORTS)

    def take(self) -> list[dict[str, Any]]:
        """The reports since the last call."""
        taken = list(self._waiting)
        self._waiting.clear()
        return taken

    def collision(self, decision: Decision) -> None:
        """A collision level has begun."""
        self._event(
            ContactEvent(
                kind="collision", contact=decision.contact, t=decision.t, link=decision.link,
                point=list(decision.point) or None, point_base=list(decision.point_base) or None,
                force_base=list(decision.force_base) or None, force=decision.force,
                probability=decision.probability, rule=decision.rule,
            )
        )  # fmt: skip

    def acknowledged(self, decision: Decision, by: str) -> None:
        """A latched collision has been cleared; `by` whom."""
        self._event(
            ContactEvent(
                kind="acknowledged", t=self.t, rule=decision.rule, contact=decision.contact,
                link=decision.link, reason=f"by {by}",
            )
        )  # fmt: skip

    def expected(self, reason: str) -> None:
        """The window of an expected contact has been opened or closed."""
        self._event(ContactEvent(kind="expected", t=self.t, reason=reason))

    def action(self, name: str, reason: str, origin: Origin = NO_RULE) -> None:
        """Something happened to an action."""
        self._event(
            ContactEvent(
                kind="action", t=self.t, action=name, reason=reason, rule=origin.rule, link=origin.link
            )
        )

    def started(self, name: str) -> None:
        """An action is started."""
        self.health[name].started += 1

    def result(
        self, name: str, ok: bool, reason: str, took: float | None = None, origin: Origin = NO_RULE
    ) -> None:
        """An action has been carried out or has failed.

        Args:
            name: Of the action.
            ok: Whether it was carried out.
            reason: What was done, or why it failed; empty: nothing more is known.
            took: Time that it took [s].
            origin: Of the decision that started it.
        """
        health = self.health[name]
        health.state, health.took = ("ok" if ok else "failing"), took
        health.error = "" if ok else reason
        health.failed += not ok
        words = ("done: " if reason else "done") + reason if ok else f"failed: {reason}"
        self.action(name, words, origin)

    def connection(self, name: str, error: str, usable: bool) -> bool:
        """The state of the connection that an action uses.

        Args:
            name: Of the action.
            error: What is wrong with the connection; empty: nothing.
            usable: Whether the action can be carried out now.

        Returns:
            Whether the connection is in order again after an error.
        """
        health, before = self.health[name], self.health[name].error
        health.error = error
        if error:
            health.state = "failing"
        elif usable:
            health.state = "ok"
        if error and error != before:
            health.failed += 1
            self.action(name, f"failed: {error}")
        return bool(before and not error)

    def webhook(self, name: str, decision: Decision) -> None:
        """The service is to deliver a webhook."""
        self._waiting.append({"type": "webhook", "action": name, "decision": decision.as_dict()})

    def state(
        self,
        *,
        started: bool,
        answer: str | None,
        restored: bool,
        active: Sequence[Decision],
        lowered: float | None,
        expected: Sequence[str],
    ) -> None:
        """The state of the reactions.

        Args:
            started: Whether this process has just started.
            answer: Identifier of the command that this answers; None: of none.
            restored: Whether the service has sent the latches of an earlier process.
            active: Levels that have begun and not ended.
            lowered: Fraction of the speed slider that is to be raised; None: nothing is.
            expected: Names of expected contacts whose windows are open.
        """
        self._waiting.append(
            {
                "type": "reactions",
                "started": started,
                "answer": answer,
                "restored": restored,
                "active": [decision.as_dict() for decision in active],
                "lowered": lowered,
                "expected": list(expected),
                "actions": {name: health.model_dump() for name, health in self.health.items()},
            }
        )

    def _event(self, event: ContactEvent) -> None:
        self._waiting.append({"type": "event", "event": event.model_dump()})
