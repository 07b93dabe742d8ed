"""The service's side of the reactions: their last reported state, acknowledgement, announcements."""

import asyncio
import contextlib
import itertools
import logging
from collections.abc import Callable, Mapping, Sequence
from functools import partial
from pathlib import Path
from typing import Any

from pydantic import BaseModel, ConfigDict

from contactsense.scene import Scene
from contactsense.service.events.model import ContactEvent
from contactsense.service.reactions.actions.registers import RegistersAction
from contactsense.service.reactions.actions.speed_slider import SpeedSliderAction
from contactsense.service.reactions.actions.webhook import WebhookAction
from contactsense.service.reactions.explain import explain, explain_actions
from contactsense.service.reactions.health import ActionHealth, LatchOut, ReactionsHealth, ReactionsOut
from contactsense.service.reactions.listener import ReactionListener
from contactsense.service.reactions.rules import RTDE_PORT, ReactionRules, RobotAddress, RulesError

FILE = "reactions.yaml"
"""Name of the rules file if it is in the folder of the scene file."""
_ANSWER = 1.0
"""Longest wait for the pipeline to confirm a command [s]."""
log = logging.getLogger("contactsense")


class ReactionSettings(BaseModel):
    """Where the rules are."""

    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False)

    file: Path | None = None
    """Rules file; None: `reactions.yaml` in the folder of the scene file, if there is one."""

    def load(self, scene: Scene, scene_file: Path | None) -> ReactionRules | None:
        """Load the rules; returns None if there are none.

        Raises:
            RulesError: The rules cannot be used.
        """
        file = self.file
        if file is None and scene_file is not None and (scene_file.parent / FILE).is_file():
            file = scene_file.parent / FILE
        if file is None:
            return None
        rules = ReactionRules.load(file)
        try:
            rules.check(scene)
        except RulesError as error:
            raise RulesError(f"{file}: {error}") from None
        for text in rules.shadowed_links(scene):
            log.warning("reactions: %s", text)
        log.info("reactions: rules of %s: %s", file, ", ".join(rule.name for rule in rules.rules))
        return rules


def make_listener(scene: Scene, rules: ReactionRules, host: str | None) -> ReactionListener:
    """Create the listener; called in the pipeline's process."""
    return ReactionListener(rules, scene, host)


class Reactions:
    """What the service's process knows about the reactions.

    Args:
        rules: The rules; None if there are none.
        robot_host: Address of the robot that sends the samples.
        send: Sends a command to the pipeline's process; returns False if there is none.
        robot_port: RTDE port of that robot.
        kept: Whether a later start of the service knows what is latched and lowered: from the journal's file.

    Raises:
        RulesError: An action needs the robot's address, and there is none.
    """

    def __init__(
        self,
        rules: ReactionRules | None,
        robot_host: str | None,
        send: Callable[[dict[str, Any]], bool],
        robot_port: int = RTDE_PORT,
        kept: bool = True,
    ) -> None:
        self._kept = kept
        self._robot_host, self._robot_port, self._send = robot_host, robot_port, send
        self.rules: ReactionRules | None = None
        self._host: str | None = None
        self._report: dict[str, Any] = {"active": [], "expected": [], "actions": {}}
        self._latched: list[dict[str, Any]] = []
        self._lowered: float | None = None
        self.on_lowered: Callable[[float | None], None] | None = None
        """Called with the fraction to which the speed slider is lowered, or None, whenever that changes."""
        self.on_latched: Callable[[list[dict[str, Any]]], None] | None = None
        """Called with the latched collisions whenever they change."""
        self._answers: dict[str, asyncio.Event] = {}
        self._numbers = itertools.count(1)
        self._webhook_health: dict[str, ActionHealth] = {}
        self.replace(rules)

    def replace(self, rules: ReactionRules | None) -> None:
        """Replace the rules. Latched collisions stay latched if their rule still has that level; a lowered
        speed slider is raised if an action still moves it.

        Raises:
            RulesError: An action needs the robot's address, and there is none; nothing has changed.
        """
        host = None if rules is None else rules.robot.host or self._robot_host
        if rules is not None and host is None:
            needed = [n for n, a in rules.actions.items() if a.type not in ("webhook", "command")]
            if needed:
                raise RulesError(
                    f"robot.host: expected the controller's address for {', '.join(needed)}, got none"
                )
        if rules is None and self.rules is not None:
            log.warning("reactions: there are no rules any more: nothing reacts to contacts")
        if rules is not None and rules.robot.host is None and rules.robot.rtde_port is None:
            rules = rules.model_copy(update={"robot": RobotAddress(rtde_port=self._robot_port)})
        before = self._registers
        self.rules, self._host = rules, host
        left = [name for where, name in before if (where, name) not in self._registers]
        if left:
            log.warning(
                "reactions: %s: not written any more; they keep their last values until the controller is "
                "started again or somebody else writes them",
                ", ".join(left),
            )
        if rules is not None:
            for text in (*rules.missing, *(() if self._kept else rules.without_journal)):
                log.warning("reactions: %s", text)
        if self._lowered is not None and self._slider is None:
            log.warning("reactions: the speed slider is at %.3g %%: %s", 100.0 * self._lowered, self._after)
            self._set_lowered(None)

    def restore(self, decisions: Sequence[dict[str, Any]], lowered: float | None = None) -> None:
        """Restore the collisions that were latched when the service last ran, and the fraction to which it
        had lowered the speed slider, None: it had not; call before the pipeline starts."""
        self._latched, self._lowered = list(decisions), lowered
        if lowered is not None:
            log.warning(
                "the service ended with the speed slider at %.3g %%: %s", 100.0 * lowered, self._after
            )
            if self._slider is None:
                self._set_lowered(None)
        self._report = {**self._report, "active": list(decisions)}
        for found in decisions if self.rules is not None else ():
            log.warning(
                "rule %s: the collision on %s is still latched", found["rule"], found["link"] or "the arm"
            )

    def note_end(self) -> None:
        """Log a speed slider that stays low when the service ends.

        It is not raised then: a force may still act, and nothing would see when it has ended.
        """
        if self._lowered is None:
            return
        after = self._after
        if self._raises:
            after = (
                "the next start raises it once no force acts, unless somebody has moved it"
                if self._kept
                else "a force may still act, and without --journal no later start raises it: raise it by hand"
            )
        log.warning("the service ends with the speed slider at %.3g %%: %s", 100.0 * self._lowered, after)

    @property
    def factory(self) -> Callable[[Scene], ReactionListener] | None:
        """Function that creates the listener in the pipeline's process; None if there are no rules."""
        if self.rules is None:
            return None
        return partial(make_listener, rules=self.rules, host=self._host)

    @property
    def _registers(self) -> list[tuple[tuple[str | None, int | None], str]]:
        """The registers that are written: the controller's address and port, and the RTDE field."""
        if self.rules is None:
            return []
        where = self._host, self.rules.robot.rtde_port
        actions = self.rules.actions.values()
        return [(where, n) for a in actions if isinstance(a, RegistersAction) for n in a.names]

    @property
    def _slider(self) -> SpeedSliderAction | None:
        """The action that moves the speed slider. Without one a person must raise it, and nothing here sees
        when."""
        found = {} if self.rules is None else self.rules.actions
        return next((action for action in found.values() if isinstance(action, SpeedSliderAction)), None)

    @property
    def _raises(self) -> bool:
        """Whether the speed slider is raised after it was lowered."""
        return self._slider is not None and self._slider.restore is not None

    @property
    def _after(self) -> str:
        """What becomes of a speed slider that is low."""
        if self._slider is None:
            return "no action raises it any more"
        if not self._raises:
            return "it stays there, as its action has no restore"
        return "it is raised once no force acts, unless somebody has moved it"

    @property
    def webhooks(self) -> dict[str, WebhookAction]:
        """Name -> webhook."""
        found = {} if self.rules is None else self.rules.actions
        return {name: action for name, action in found.items() if isinstance(action, WebhookAction)}

    def handle_report(self, report: dict[str, Any]) -> None:
        """Process a report of type `reactions` from the pipeline's process."""
        if report["started"]:  # a new process: restore the latched collisions
            self._send({"type": "restore", "decisions": self._latched, "lowered": self._lowered})
            return
        # One that has not been told yet does not know what the process before has left.
        lowered = self._lowered if report["lowered"] is None and not report["restored"] else report["lowered"]
        if self._slider is None:  # of a process that still has the rules of before
            lowered = None
        if lowered != self._lowered:
            self._set_lowered(lowered)
        if not report["restored"]:  # its latches are not complete yet
            earlier = [decision for decision in self._latched if decision not in report["active"]]
            report = {**report, "active": [*earlier, *report["active"]]}
        self._report = report
        latched = [d for d in report["active"] if d["level"] == "collision"]
        if latched != self._latched:
            self._latched = latched
            if self.on_latched is not None:
                self.on_latched(latched)
        if report["answer"] in self._answers:
            self._answers[report["answer"]].set()

    def _set_lowered(self, fraction: float | None) -> None:
        self._lowered = fraction
        if self.on_lowered is not None:
            self.on_lowered(fraction)

    def note_webhook(self, name: str, ok: bool, reason: str, decision: Mapping[str, Any]) -> ContactEvent:
        """Record the result of the delivery of a decision, which may be empty, see `WebhookDelivery`; returns
        the event that reports it."""
        health = self._webhook_health.setdefault(name, ActionHealth(type="webhook"))
        health.started += 1
        health.failed += not ok
        health.state, health.error = ("ok", "") if ok else ("failing", reason)
        words = f"{'done' if ok else 'failed'}: {reason}"
        return ContactEvent(
            kind="action", t=decision.get("t"), action=name, reason=words, rule=decision.get("rule", ""),
            link=decision.get("link", ""),
        )  # fmt: skip

    def acknowledge(self, rule: str | None, by: str) -> bool:
        """Clear the latched collisions of all rules or of one; returns False if no pipeline runs."""
        return self._send({"type": "acknowledge", "rule": rule, "by": by})

    def announce(self, name: str) -> bool:
        """Open the window of an expected contact; returns False if the rules have none of that name, or no
        pipeline runs."""
        known = self.rules is not None and any(window.name == name for window in self.rules.expected)
        return known and self._send({"type": "announce", "name": name})

    def withdraw(self, name: str | None = None) -> bool:
        """Close the window of one expected contact, or all windows; returns False if no pipeline runs."""
        return self._send({"type": "withdraw", "name": name})

    async def request(self, command: dict[str, Any]) -> bool:
        """Send a command and wait until it has been executed; returns False if that does not happen."""
        number = str(next(self._numbers))
        done = self._answers[number] = asyncio.Event()
        try:
            if not self._send({**command, "id": number}):
                return False
            with contextlib.suppress(TimeoutError):
                await asyncio.wait_for(done.wait(), _ANSWER)
            return done.is_set()
        finally:
            del self._answers[number]

    @property
    def actions(self) -> dict[str, ActionHealth]:
        """State of each action."""
        found = {name: ActionHealth.model_validate(h) for name, h in self._report["actions"].items()}
        return {**found, **{n: h for n, h in self._webhook_health.items() if n in self.webhooks}}

    @property
    def latches(self) -> list[LatchOut]:
        """Collisions that have not been acknowledged."""
        return [
            LatchOut(rule=d["rule"], t=d["t"], link=d["link"], force=d["force"])
            for d in self._report["active"]
            if d["level"] == "collision"
        ]

    def health(self) -> ReactionsHealth:
        """Response of `GET /v1/health`."""
        if self.rules is None:
            return ReactionsHealth()
        actions = self.actions
        failing = any(action.state == "failing" for action in actions.values())
        return ReactionsHealth(
            status="failing" if failing else "ok",
            latched=len(self.latches),
            lowered=self._lowered,
            actions=actions,
        )

    def out(self, scene: Scene) -> ReactionsOut:
        """Response of `GET /v1/reactions`; `scene`: the scene that the rules fit."""
        if self.rules is None:
            return ReactionsOut()
        health = self.health()
        return ReactionsOut(
            status=health.status,
            rules=[explain(self.rules, rule, scene) for rule in self.rules.rules],
            does=explain_actions(self.rules),
            active=self._report["active"],
            latched=self.latches,
            expected=self._report["expected"],
            actions=health.actions,
        )
