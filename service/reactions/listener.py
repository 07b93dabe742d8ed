"""Reactions in the pipeline's process: decides right after the localizer's step and writes registers at once.
Passes webhooks to the service and all other actions to the executor's process."""

from collections import deque
from collections.abc import Sequence
from typing import Any, TypeVar

from contactsense.scene import Scene
from contactsense.service.events.model import ContactEvent
from contactsense.service.live.listener import REPORTS
from contactsense.service.reactions.actions.base import ExecutedAction
from contactsense.service.reactions.actions.registers import RegistersAction
from contactsense.service.reactions.actions.speed_slider import NAMES as SLIDER
from contactsense.service.reactions.actions.speed_slider import SLIDER_READING, SpeedSliderAction
from contactsense.service.reactions.actions.webhook import WebhookAction
from contactsense.service.reactions.decision import Decision
from contactsense.service.reactions.engine import Engine
from contactsense.service.reactions.executor_client import ExecutorClient
from contactsense.service.reactions.health import ActionHealth
from contactsense.service.reactions.lowered_slider import RECIPE, LoweredSlider, as_percent
from contactsense.service.reactions.program_signals import ProgramSignals
from contactsense.service.reactions.rtde_inputs import RtdeInputs
from contactsense.service.reactions.rules import RTDE_PORT, ReactionRules
from contactsense.types import Estimate, Sample

_A = TypeVar("_A")
_REPORT_EVERY = 0.25
"""Time between two reports of the state to the service [s]."""
_BLIND = 0.1
"""Time without an estimate after which the degraded bit is set [s]."""
_RESTORE = 1.0
"""Longest wait for the service to send the collisions latched before this process started [s]."""


class ReactionListener:
    """Applies the rules to one stream."""

    def __init__(self, rules: ReactionRules, scene: Scene, host: str | None) -> None:
        """`host`: address of the robot's controller; None if no action needs it."""
        self._rules = rules
        self._engine = Engine(rules, scene)
        self._health = {name: ActionHealth(type=action.type) for name, action in rules.actions.items()}
        self._reports: deque[dict[str, Any]] = deque(maxlen=REPORTS)
        self._registers, self._registers_name = _only(rules, RegistersAction)
        slider, self._slider_name = _only(rules, SpeedSliderAction)
        self._signals = ProgramSignals(rules.inputs)
        self._inputs = self._open_inputs(host, slider)
        self._slider = None
        if slider is not None and self._inputs is not None:
            self._slider = LoweredSlider(slider, self._inputs)
        executed = {n: a for n, a in rules.actions.items() if isinstance(a, ExecutedAction)}
        self._executor = ExecutorClient(executed, host or "")
        self._decision: Decision | None = None
        self._reported_lowered: float | None = None
        self._beat = False
        self._estimated = False
        self._degraded = True
        self._now = self._last_estimate = self._last_write = self._last_report = -1e9
        self._began: float | None = None
        self._t: float | None = None  # of the newest sample
        self._restored = self._informed = False
        self._report_state(started=True)

    def receive(self, sample: Sample, estimate: Estimate) -> None:
        """Decide, and write the registers for the robot program."""
        self._t, self._estimated = sample.t, True
        self._degraded = estimate.status == "degraded"
        decisions = self._engine.step(sample, estimate)
        if decisions:
            self._select()
        if self._decision is not None:
            self._decision = self._engine.updated(self._decision, estimate)
        if decisions or self._decision is not None:
            self._carry_out(decisions, self._write())
        if self._slider is not None:
            self._tell_of_slider(self._slider.watch(estimate, self._lowers_slider))
        if decisions or self._lowered != self._reported_lowered:
            self._report_state()  # at once: a latch and a lowered slider must survive any later failure

    def tick(self, now: float) -> None:
        """Handle heartbeat, connections, results, and outputs of the robot program."""
        self._now = now
        self._began = now if self._began is None else self._began
        if self._estimated:
            self._estimated, self._last_estimate = False, now
        if now - self._last_estimate > _BLIND:
            self._degraded = True
        if not self._restored and now - self._began > _RESTORE:
            self._restored = True
        if self._inputs is not None:
            self._inputs.poll(now)
            self._read_inputs()
            self._note_connection()
            if self._slider is not None:
                self._slider.write()
            if self._registers is not None and now - self._last_write >= self._registers.period - 0.001:
                self._write()
        for result in self._executor.poll(now):
            self._note(result["action"], result["ok"], result["reason"], result["took"])
        if now - self._last_report >= _REPORT_EVERY or self._lowered != self._reported_lowered:
            self._report_state()

    def take_reports(self) -> list[dict[str, Any]]:
        """Return events and the state of the reactions, for the service."""
        reports = list(self._reports)
        self._reports.clear()
        return reports

    def command(self, message: dict[str, Any]) -> None:
        """Execute a command of the service: `acknowledge`, `announce`, `withdraw`, `restore`."""
        kind = message["type"]
        if kind == "acknowledge":
            self.acknowledge(message.get("rule"), message.get("by", "the service"))
        elif kind == "announce":
            self.announce(message["name"])
        elif kind == "withdraw":
            self.withdraw(message.get("name"))
        elif kind == "restore":
            self._restore([Decision(**{k: _tupled(v) for k, v in d.items()}) for d in message["decisions"]])
            if self._slider is not None:
                self._slider.take_over(message.get("lowered"))
        else:
            return
        self._report_state(answer=message.get("id"))

    def _restore(self, decisions: Sequence[Decision]) -> None:
        """Restore the latches of an earlier process. No action is performed again, but the registers show the
        latches from their first write on."""
        for decision in decisions:
            if not self._engine.restore(decision):
                self._report_event(
                    ContactEvent(
                        kind="acknowledged", t=self._t, rule=decision.rule, contact=decision.contact,
                        link=decision.link, reason="by the rules' file: it has no such level any more",
                    )
                )  # fmt: skip
        self._restored = self._informed = True
        self._select()

    def acknowledge(self, rule: str | None, by: str) -> None:
        """Clear latched collisions."""
        decisions = self._engine.acknowledge(rule)
        for decision in decisions:
            self._report_event(
                ContactEvent(
                    kind="acknowledged", t=self._t, rule=decision.rule, contact=decision.contact,
                    link=decision.link, reason=f"by {by}",
                )
            )  # fmt: skip
        if decisions:
            self._select()
            self._carry_out(decisions, self._write())

    def announce(self, name: str) -> None:
        """Open the window of an expected contact."""
        if self._engine.announce(name):
            self._report_event(ContactEvent(kind="expected", t=self._t, reason=f"{name}: the window is open"))

    def withdraw(self, name: str | None) -> None:
        """Close windows of expected contacts."""
        if self._engine.withdraw(name):
            self._report_event(ContactEvent(kind="expected", t=self._t, reason=f"{name or 'all'}: closed"))

    def close(self) -> None:
        """Close the connections; the robot program's watchdog detects this."""
        self._executor.close()
        if self._inputs is not None:
            self._inputs.close()

    def _open_inputs(self, host: str | None, slider: SpeedSliderAction | None) -> RtdeInputs | None:
        recipes: dict[str, Sequence[str]] = {}
        if self._registers is not None:
            recipes["registers"] = self._registers.names
        if slider is not None:
            recipes[RECIPE] = SLIDER
        outputs = list(self._signals.names)
        if slider is not None:
            outputs.append(SLIDER_READING)
        if host is None or not (recipes or outputs):
            return None
        return RtdeInputs(host, self._rules.robot.rtde_port or RTDE_PORT, recipes, outputs)

    def _select(self) -> None:
        """Select the decision that the registers show: the latest of the highest active level."""
        shown = [d for d in self._engine.active if self._registers_name in d.actions]
        self._decision = max(shown, key=lambda d: (d.level == "collision", d.t), default=None)

    def _write(self) -> bool:
        """Write the registers; returns False if that is not possible now."""
        if self._registers is None or self._inputs is None or not self._restored:
            return False
        self._beat = not self._beat
        values = self._registers.values(self._decision, self._t or 0.0, self._beat, self._degraded)
        self._last_write = self._now
        return self._inputs.write("registers", values)

    @property
    def _unwritten(self) -> str:
        """Why the registers cannot be written where their connection tells no error."""
        return "not connected" if self._restored else "the latched collisions of before are not known yet"

    def _carry_out(self, decisions: Sequence[Decision], written: bool) -> None:
        """Report the decisions and start their actions; `written`: whether the registers show them."""
        for decision in decisions:
            begins = decision.kind == "begin"
            if begins and decision.level == "collision":
                self._report_event(
                    ContactEvent(
                        kind="collision", contact=decision.contact, t=decision.t, link=decision.link,
                        point=list(decision.point) or None, point_base=list(decision.point_base) or None,
                        force_base=list(decision.force_base) or None, force=decision.force,
                        probability=decision.probability, rule=decision.rule,
                    )
                )  # fmt: skip
            for name in decision.actions:
                self._act(name, decision, begins, written)

    def _act(self, name: str, decision: Decision, begins: bool, written: bool) -> None:
        action = self._rules.actions[name]
        if isinstance(action, RegistersAction):
            if begins:
                self._health[name].started += 1
                self._note(name, written, "" if written else self._health[name].error or self._unwritten)
        elif isinstance(action, SpeedSliderAction):
            self._move_slider(begins)
        elif begins and isinstance(action, WebhookAction):
            self._health[name].started += 1
            self._reports.append({"type": "webhook", "action": name, "decision": decision.as_dict()})
        elif begins:
            self._health[name].started += 1
            problem = self._executor.start(name, decision.as_dict(), self._now)
            if problem:
                self._note(name, False, problem)

    def _move_slider(self, begins: bool) -> None:
        # While another level wants the arm to be slow, the end of this one changes nothing.
        if self._slider is None or (not begins and self._lowers_slider):
            return
        if begins:
            self._slider.lower()
        elif not self._slider.end():
            self._tell_of_slider(self._slider.raise_left())  # of a latch that was restored
            return
        health = self._health[self._slider_name]
        health.started += 1
        written = self._slider.write()
        if written is None:
            self._note(self._slider_name, False, health.error or "not connected")
        else:
            self._note(self._slider_name, True, f"set to {as_percent(written)}")

    def _tell_of_slider(self, words: str) -> None:
        if words:
            self._report_event(ContactEvent(kind="action", t=self._t, action=self._slider_name, reason=words))

    def _read_inputs(self) -> None:
        assert self._inputs is not None
        values = self._inputs.values
        if self._signals.acknowledged(values):
            self.acknowledge(None, f"the robot program ({self._rules.inputs.acknowledge})")
        value = self._signals.announced(values)
        if value is not None:
            self.withdraw(None)
            expected = self._engine.by_value(value)
            if expected is not None:
                self.announce(expected)

    def _note_connection(self) -> None:
        """Set the state of registers and speed slider from the state of their connection."""
        assert self._inputs is not None
        for name, recipe in ((self._registers_name, "registers"), (self._slider_name, RECIPE)):
            if name:
                health, before = self._health[name], self._health[name].error
                health.error = self._inputs.error or self._inputs.refused.get(recipe, "")
                if health.error:
                    health.state = "failing"
                elif self._inputs.can_write(recipe):
                    health.state = "ok"
                if health.error and health.error != before:
                    health.failed += 1
                    self._report_event(
                        ContactEvent(kind="action", t=self._t, action=name, reason=f"failed: {health.error}")
                    )
                if before and not health.error and name == self._slider_name:
                    self._lower_slider_again()

    def _lower_slider_again(self) -> None:
        """After a lost connection the controller may have restarted. Once the level has ended, the slider
        belongs to whoever has moved it since."""
        if self._slider is not None and self._lowers_slider:
            self._slider.lower()

    @property
    def _lowers_slider(self) -> bool:
        """Whether an active level wants the arm to be slow."""
        return any(self._slider_name in decision.actions for decision in self._engine.active)

    @property
    def _lowered(self) -> float | None:
        """Fraction of the slider that is to be raised; None: nothing is."""
        return None if self._slider is None else self._slider.lowered

    def _note(self, name: str, ok: bool, reason: str, took: float | None = None) -> None:
        """Record the result of an action for health and journal."""
        health = self._health[name]
        health.state, health.took = ("ok" if ok else "failing"), took
        health.error = "" if ok else reason
        health.failed += not ok
        words = (f"done: {reason}" if reason else "done") if ok else f"failed: {reason}"
        self._report_event(ContactEvent(kind="action", t=self._t, action=name, reason=words))

    def _report_event(self, event: ContactEvent) -> None:
        self._reports.append({"type": "event", "event": event.model_dump()})

    def _report_state(self, started: bool = False, answer: str | None = None) -> None:
        self._last_report, self._reported_lowered = self._now, self._lowered
        self._reports.append(
            {
                "type": "reactions",
                "started": started,
                "answer": answer,
                "restored": self._informed,
                "active": [decision.as_dict() for decision in self._engine.active],
                "lowered": self._lowered,
                "expected": list(self._engine.windows),
                "actions": {name: health.model_dump() for name, health in self._health.items()},
            }
        )


def _only(rules: ReactionRules, kind: type[_A]) -> tuple[_A | None, str]:
    return next(((a, n) for n, a in rules.actions.items() if isinstance(a, kind)), (None, ""))


def _tupled(value: Any) -> Any:
    return tuple(value) if isinstance(value, list) else value
