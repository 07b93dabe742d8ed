"""Reactions in the pipeline's process: decides right after the localizer's step and writes registers at once.
Passes webhooks to the service and all other actions to the executor's process."""

import time
from collections.abc import Sequence
from typing import Any, TypeVar

from contactsense.scene import Scene
from contactsense.service.reactions.actions.base import ExecutedAction
from contactsense.service.reactions.actions.registers import RegistersAction
from contactsense.service.reactions.actions.speed_slider import NAMES as SLIDER
from contactsense.service.reactions.actions.speed_slider import SLIDER_READING, SpeedSliderAction
from contactsense.service.reactions.actions.webhook import WebhookAction
from contactsense.service.reactions.decision import Decision
from contactsense.service.reactions.engine import Engine
from contactsense.service.reactions.executor_client import ExecutorClient
from contactsense.service.reactions.lowered_slider import RECIPE as SLIDER_RECIPE
from contactsense.service.reactions.lowered_slider import LoweredSlider, as_percent
from contactsense.service.reactions.program_signals import ProgramSignals
from contactsense.service.reactions.register_output import RECIPE as REGISTERS_RECIPE
from contactsense.service.reactions.register_output import RegisterOutput
from contactsense.service.reactions.reports import Reports
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
        self._reports = Reports(rules.actions)
        registers, registers_name = _only(rules, RegistersAction)
        slider, self._slider_name = _only(rules, SpeedSliderAction)
        self._signals = ProgramSignals(rules.inputs)
        self._inputs = self._open_inputs(host, registers, slider)
        self._registers = None
        if registers is not None:
            self._registers = RegisterOutput(registers, registers_name, self._inputs)
        of_actions = ((registers_name, REGISTERS_RECIPE), (self._slider_name, SLIDER_RECIPE))
        self._recipes = {name: recipe for name, recipe in of_actions if name}
        self._slider = None
        if slider is not None and self._inputs is not None:
            self._slider = LoweredSlider(slider, self._inputs)
        executed = {n: a for n, a in rules.actions.items() if isinstance(a, ExecutedAction)}
        self._executor = ExecutorClient(executed, host or "")
        self._reported_lowered: float | None = None
        self._estimated = False
        self._degraded = True
        self._now = self._last_estimate = self._last_report = -1e9
        self._began: float | None = None
        self._restored = False  # by the service's command
        self._report_state(started=True)

    def receive(self, sample: Sample, estimate: Estimate) -> None:
        """Decide, and write the registers for the robot program."""
        self._reports.t, self._estimated = sample.t, True
        self._degraded = estimate.status == "degraded"
        decisions = self._engine.step(sample, estimate)
        for reason in self._engine.take_lapsed():
            self._reports.expected(reason)
        if decisions:
            self._select()
        if self._registers is not None:
            self._registers.follow(self._engine, estimate)
        if decisions or (self._registers is not None and self._registers.shown is not None):
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
        if self._registers is not None and now - self._began > _RESTORE:
            self._registers.latches_known = True
        if self._inputs is not None:
            self._inputs.poll(now)
            self._read_inputs()
            self._note_connection()
            if self._slider is not None:
                self._slider.write()
            if self._registers is not None and self._registers.is_due(now):
                self._write()
        for result in self._executor.poll(now):
            took, origin = result["took"], result["origin"]
            self._reports.result(result["action"], result["ok"], result["reason"], took, origin)
        if now - self._last_report >= _REPORT_EVERY or self._lowered != self._reported_lowered:
            self._report_state()

    def take_reports(self) -> list[dict[str, Any]]:
        """Return events and the state of the reactions, for the service."""
        return self._reports.take()

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
                self._reports.acknowledged(decision, "the rules' file: it has no such level any more")
        self._restored = True
        if self._registers is not None:
            self._registers.latches_known = True
        self._select()

    def acknowledge(self, rule: str | None, by: str) -> None:
        """Clear latched collisions."""
        decisions = self._engine.acknowledge(rule)
        for decision in decisions:
            self._reports.acknowledged(decision, by)
        if decisions:
            self._select()
            self._carry_out(decisions, self._write())

    def announce(self, name: str) -> None:
        """Open the window of an expected contact."""
        if self._engine.announce(name):
            self._reports.expected(f"{name}: the window is open")

    def withdraw(self, name: str | None) -> None:
        """Close windows of expected contacts."""
        if self._engine.withdraw(name):
            self._reports.expected(f"{name or 'all'}: closed")

    def close(self) -> None:
        """Close the connections; the robot program's watchdog detects this."""
        self._executor.close()
        if self._inputs is not None:
            self._inputs.close()

    def _open_inputs(
        self, host: str | None, registers: RegistersAction | None, slider: SpeedSliderAction | None
    ) -> RtdeInputs | None:
        recipes: dict[str, Sequence[str]] = {}
        if registers is not None:
            recipes[REGISTERS_RECIPE] = registers.names
        if slider is not None:
            recipes[SLIDER_RECIPE] = SLIDER
        outputs = list(self._signals.names)
        if slider is not None:
            outputs.append(SLIDER_READING)
        if host is None or not (recipes or outputs):
            return None
        return RtdeInputs(host, self._rules.robot.rtde_port or RTDE_PORT, recipes, outputs)

    def _select(self) -> None:
        if self._registers is not None:
            self._registers.select(self._engine.active)

    def _write(self) -> bool:
        """Write the registers; returns False if that is not possible now."""
        return self._registers is not None and self._registers.write(
            self._reports.t or 0.0, self._degraded, self._now
        )

    def _carry_out(self, decisions: Sequence[Decision], written: bool) -> None:
        """Report the decisions and start their actions; `written`: whether the registers show them."""
        for decision in decisions:
            begins = decision.kind == "begin"
            if begins and decision.level == "collision":
                self._reports.collision(decision)
            for name in decision.actions:
                self._act(name, decision, begins, written)

    def _act(self, name: str, decision: Decision, begins: bool, written: bool) -> None:
        action = self._rules.actions[name]
        if isinstance(action, SpeedSliderAction):
            self._move_slider(begins, decision)
            return
        if not begins:
            return
        self._reports.started(name)
        if self._registers is not None and isinstance(action, RegistersAction):
            problem = self._reports.health[name].error or self._registers.problem
            self._reports.result(name, written, "" if written else problem, origin=decision.origin)
        elif isinstance(action, WebhookAction):
            self._reports.webhook(name, decision)
        else:
            # Not the time of the latest tick: if this process stood still, that is long past.
            problem = self._executor.start(name, decision.as_dict(), time.monotonic())
            if problem:
                self._reports.result(name, False, problem, origin=decision.origin)

    def _move_slider(self, begins: bool, decision: Decision) -> None:
        # While another level wants the arm to be slow, the end of this one changes nothing.
        if self._slider is None or (not begins and self._lowers_slider):
            return
        if begins:
            self._slider.lower()
        elif not self._slider.end():
            self._tell_of_slider(self._slider.raise_left())  # of a latch that was restored
            return
        name = self._slider_name
        self._reports.started(name)
        written = self._slider.write()
        if written is None:
            self._reports.result(
                name, False, self._reports.health[name].error or "not connected", origin=decision.origin
            )
        else:
            self._reports.result(name, True, f"set to {as_percent(written)}", origin=decision.origin)

    def _tell_of_slider(self, words: str) -> None:
        if words:
            self._reports.action(self._slider_name, words)

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
        for name, recipe in self._recipes.items():
            error = self._inputs.error or self._inputs.refused.get(recipe, "")
            again = self._reports.connection(name, error, self._inputs.can_write(recipe))
            if again and name == self._slider_name:
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

    def _report_state(self, started: bool = False, answer: str | None = None) -> None:
        self._last_report, self._reported_lowered = self._now, self._lowered
        self._reports.state(
            started=started,
            answer=answer,
            restored=self._restored,
            active=self._engine.active,
            lowered=self._lowered,
            expected=self._engine.windows,
        )


def _only(rules: ReactionRules, kind: type[_A]) -> tuple[_A | None, str]:
    return next(((a, n) for n, a in rules.actions.items() if isinstance(a, kind)), (None, ""))


def _tupled(value: Any) -> Any:
    return tuple(value) if isinstance(value, list) else value
