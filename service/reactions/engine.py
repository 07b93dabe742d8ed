"""Evaluates the rules: samples and estimates in, decisions out. Uses the robot's time; no clock, no sockets.

A rule considers the contacts on its links. The explanations of one contact exclude each other, so the
probability that its force exceeds a level is the sum over them. If several contacts act at the same time, the
largest of their probabilities counts. Measurements that no single push explains count for rules on all links.
"""

import math
from dataclasses import dataclass, replace

import numpy as np

from contactsense.kinematics.forward_kinematics import forward_kinematics
from contactsense.kinematics.model import build_model, empty_motion
from contactsense.scene import Scene
from contactsense.service.reactions.decision import Decision, LevelName
from contactsense.service.reactions.levels import exceedance
from contactsense.service.reactions.rules import ANY, Direction, ExpectedContact, Level, ReactionRules, Rule
from contactsense.types import Contact, Estimate, Sample


@dataclass
class _LevelState:
    """Present state of one level of a rule."""

    rule: Rule
    name: LevelName
    level: Level
    above_since: float | None = None
    active: bool = False
    begin: Decision | None = None


@dataclass(frozen=True, slots=True)
class Latch:
    """A collision that has not been acknowledged."""

    rule: str
    t: float
    link: str
    force: float


@dataclass
class _Window:
    """The window of an expected contact, and the time at which it opened."""

    expected: ExpectedContact
    links: frozenset[str]
    opened: float | None
    """On the robot's clock [s]; None before the first sample."""


@dataclass
class _Evidence:
    """Probability that the force exceeds one level, and the contact that contributes most to it."""

    probability: float = 0.0
    share: float = -1.0
    contact: Contact | None = None


class Engine:
    """State of all rules of one stream."""

    def __init__(self, rules: ReactionRules, scene: Scene) -> None:
        """Create the state of the rules, with no level active.

        Raises:
            RulesError: The rules do not fit the scene.
        """
        rules.check(scene)
        self._rules = rules
        self._links = {rule.name: rules.links_of(rule.links, scene) for rule in rules.rules}
        self._all_links = {rule.name: ANY in rule.links for rule in rules.rules}
        self._expected = {window.name: window for window in rules.expected}
        self._window_links = {window.name: rules.links_of(window.links, scene) for window in rules.expected}
        self._levels = [
            _LevelState(rule, name, level) for rule in rules.rules for name, level in _levels_of(rule)
        ]
        self._windows: dict[str, _Window] = {}
        self._lapsed: list[str] = []
        self._t = -math.inf
        self._busy = False
        self._joints = len(scene.robot.joints)
        self._flange = scene.robot.flange_rotation
        self._model = build_model(scene.robot)
        self._motion = empty_motion(self._joints)
        if any(rule.direction is not None and rule.direction.frame == "link" for rule in rules.rules):
            forward_kinematics(self._model, np.zeros(self._joints), self._motion)  # compile it in advance

    @property
    def latches(self) -> tuple[Latch, ...]:
        """Collisions that have not been acknowledged."""
        return tuple(
            Latch(state.rule.name, state.begin.t, state.begin.link, state.begin.force)
            for state in self._levels
            if state.name == "collision" and state.begin is not None
        )

    @property
    def active(self) -> tuple[Decision, ...]:
        """The decisions that began the levels that are still active."""
        return tuple(state.begin for state in self._levels if state.begin is not None)

    @property
    def windows(self) -> tuple[str, ...]:
        """Names of the expected contacts whose windows are open."""
        return tuple(self._windows)

    def step(self, sample: Sample, estimate: Estimate) -> tuple[Decision, ...]:
        """Process the next estimate of the stream; returns the levels that begin or end with it."""
        t, before = estimate.t, self._t
        self._t = t
        if t < before:  # another stream, or the clock was set back: restart durations and windows
            self._lapsed += [f"{name}: closed, as the clock was set back" for name in self._windows]
            self._windows.clear()
            for state in self._levels:
                state.above_since = None
        for name, window in list(self._windows.items()):
            if window.opened is None:
                window.opened = t
            elif t > window.opened + window.expected.timeout:
                del self._windows[name]
                self._lapsed.append(f"{name}: closed after {window.expected.timeout:g} s, its timeout")
        degraded = estimate.status == "degraded"
        if not (estimate.contacts or estimate.other > 0.0 or self._busy):
            return ()
        moving = bool(np.abs(sample.qd).max() > self._rules.moving_speed)
        decisions = []
        for state in self._levels:
            decision = self._step_level(state, sample, estimate, degraded, moving)
            if decision is not None:
                decisions.append(decision)
        self._busy = any(state.active or state.above_since is not None for state in self._levels)
        return tuple(decisions)

    def acknowledge(self, rule: str | None = None) -> tuple[Decision, ...]:
        """Clear the latches of all rules, or of one; returns the decisions that end their levels.

        A force that is still above its level latches again with the next sample, and its actions are started
        again.
        """
        return tuple(
            self._end(state, self._t)
            for state in self._levels
            if state.name == "collision" and state.begin is not None and rule in (None, state.rule.name)
        )

    def restore(self, begin: Decision) -> bool:
        """Restore a latch of an earlier process; returns False if the rules no longer have that level."""
        for state in self._levels:
            if (state.rule.name, state.name, "collision") == (begin.rule, begin.level, begin.level):
                # The rules may have other actions now; an acknowledgement must end the present ones.
                state.active, state.begin = True, replace(begin, actions=state.level.actions)
                return True
        return False

    def announce(self, name: str) -> bool:
        """Open the window of an expected contact now; returns False if there is none of that name."""
        if name not in self._expected:
            return False
        opened = self._t if math.isfinite(self._t) else None
        self._windows[name] = _Window(self._expected[name], self._window_links[name], opened)
        return True

    def withdraw(self, name: str | None = None) -> tuple[str, ...]:
        """Close one window, or all; returns the names of those that were open."""
        closed = tuple(open_name for open_name in self._windows if name in (None, open_name))
        for open_name in closed:
            del self._windows[open_name]
        return closed

    def take_lapsed(self) -> list[str]:
        """Which windows have closed of themselves since the last call, and why."""
        lapsed, self._lapsed = self._lapsed, []
        return lapsed

    def updated(self, decision: Decision, estimate: Estimate) -> Decision:
        """Return a decision with place and force of the estimate: of the most probable explanation of its
        contact on the rule's links. Unchanged if there is none, as when the contact has ended."""
        links = self._links.get(decision.rule, frozenset())
        explanations = (c for c in estimate.contacts if c.id == decision.contact and c.link in links)
        contact = max(explanations, key=lambda c: c.probability, default=None)
        return decision if contact is None else decision.with_contact(contact)

    def by_value(self, value: int) -> str | None:
        """Return the name of the expected contact that a robot program announces with this value."""
        return next((name for name, window in self._expected.items() if window.value == value), None)

    def _step_level(
        self, state: _LevelState, sample: Sample, estimate: Estimate, degraded: bool, moving: bool
    ) -> Decision | None:
        rule, level, t = state.rule, state.level, estimate.t
        if degraded and (rule.on_degraded == "hold" or (rule.on_degraded == "act" and not estimate.contacts)):
            state.above_since = None
            return None
        holds = rule.condition == "any" or (rule.condition == "moving") == moving
        if degraded and rule.on_degraded == "ignore":
            holds = False
        release = level.release if state.active else 1.0
        evidence = self._evidence(rule, level.force, release, sample, estimate) if holds else _Evidence()
        above = evidence.probability >= level.probability
        if state.active:
            if not above and state.name == "contact":
                return self._end(state, t)
            return None
        if not above:
            state.above_since = None
            return None
        if state.above_since is None:
            state.above_since = t
        if t - state.above_since < level.duration - 1e-9:
            return None
        state.active = True
        state.begin = self._begin(state, estimate, evidence)
        return state.begin

    def _begin(self, state: _LevelState, estimate: Estimate, evidence: _Evidence) -> Decision:
        begin = Decision(
            state.rule.name, state.name, "begin", state.level.actions, estimate.t, evidence.probability
        )
        if evidence.contact is not None:
            return begin.with_contact(evidence.contact)
        force = estimate.wrench[:3].tolist()
        return replace(begin, force_base=tuple(force), force=math.hypot(*force))

    @staticmethod
    def _end(state: _LevelState, t: float) -> Decision:
        begin = state.begin
        state.active, state.begin, state.above_since = False, None, None
        assert begin is not None
        return Decision(
            state.rule.name, state.name, "end", state.level.actions, t, 0.0, begin.contact, begin.link,
            begin.link_index,
        )  # fmt: skip

    def _evidence(
        self, rule: Rule, force: float, release: float, sample: Sample, estimate: Estimate
    ) -> _Evidence:
        """Evidence that a force exceeds a level [N], of which an active one needs the fraction `release`."""
        links, covariance = self._links[rule.name], estimate.covariance[:3, :3].tolist()
        several = estimate.status == "multiple"
        evidence = _Evidence()
        for contact in estimate.contacts:
            if contact.link not in links or not self._within(rule.direction, contact, sample):
                continue
            level = release * self._raised(contact, force)
            share = contact.probability * exceedance(contact.force_base.tolist(), covariance, level)
            total = evidence.probability
            evidence.probability = max(total, share) if several else min(1.0, total + share)
            if share > evidence.share:
                evidence.share, evidence.contact = share, contact
        if self._all_links[rule.name] and estimate.other > 0.0:
            self._add_unexplained(evidence, rule, release * force, estimate, covariance)
        return evidence

    @staticmethod
    def _add_unexplained(
        evidence: _Evidence, rule: Rule, force: float, estimate: Estimate, covariance: list[list[float]]
    ) -> None:
        total = estimate.wrench[:3].tolist()
        direction = rule.direction
        if direction is not None and (direction.frame == "link" or not _in_cone(direction, total)):
            return
        share = estimate.other * exceedance(total, covariance, force)
        evidence.probability = min(1.0, evidence.probability + share)
        if share > evidence.share:
            evidence.share, evidence.contact = share, None

    def _raised(self, contact: Contact, force: float) -> float:
        """Return the level [N], raised if a window of an expected contact is open."""
        for window in self._windows.values():
            expected = window.expected
            if contact.link not in window.links or expected.force <= force:
                continue
            if expected.point is not None:
                distance = float(np.linalg.norm(contact.point_base - np.array(expected.point)))
                if distance > expected.radius:
                    continue
            force = expected.force
        return force

    def _within(self, direction: Direction | None, contact: Contact, sample: Sample) -> bool:
        if direction is None:
            return True
        force = contact.force_base
        if direction.frame == "link":
            forward_kinematics(self._model, sample.q, self._motion)
            if contact.link_index > self._joints:  # a tool's frame is the flange's
                rotation = self._motion.rotation[-1] @ self._flange
            else:
                rotation = self._motion.rotation[contact.link_index]
            force = rotation.T @ force
        return _in_cone(direction, force.tolist())


def _levels_of(rule: Rule) -> list[tuple[LevelName, Level]]:
    found: list[tuple[LevelName, Level]] = []
    if rule.contact is not None:
        found.append(("contact", rule.contact))
    if rule.collision is not None:
        found.append(("collision", rule.collision))
    return found


def _in_cone(direction: Direction, force: list[float]) -> bool:
    along = sum(f * a for f, a in zip(force, direction.axis, strict=True))
    return along >= math.cos(direction.half_angle) * math.hypot(*force) * math.hypot(*direction.axis)
