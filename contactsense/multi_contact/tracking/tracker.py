"""Tracks several contacts in a live stream: distinguishes a further contact from a change of the first.

A stream with contact is in one of three states:

- single: there are no members. `FurtherContactTest` tests the earlier estimate of the contact, until it finds
  a further one; the stream is then settling.
- settling: `_before_onset` has the hypotheses from before the newest onset. As the force of the new contact
  grows, its place is searched again (`_reestimate_newest`), until it no longer grows or is not found again.
- several: the hypotheses are tested (`_release_unloaded`, `_test_release`); where they explain a sample no
  longer, a change is searched (`_detect_change`). Another onset leads to settling, a single member that is
  left to single.

In the last two states a multiple-hypothesis filter tracks the contacts. The points of each hypothesis are the
prior of the next samples, the forces may drift, and the log evidence accumulates. The noise of the observers
is correlated in time, so the prior is updated only every few time constants: `_prior_time` is the time of the
last update, `_explained_time` that of the last sample that the hypotheses explained, `_next_search` that of
the next search for a change.
"""

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from contactsense.multi_contact.contact_set_builder import ContactSetBuilder, ContactSets
from contactsense.multi_contact.locator import MultiContactLocator
from contactsense.multi_contact.tracking.further_contact_test import FurtherContactTest
from contactsense.multi_contact.tracking.hypothesis_test import (
    PRIOR_INTERVAL,
    SEARCH_INTERVAL,
    SETTLING_TIME,
    SLIDE_DEVIATION,
    is_more_probable,
)
from contactsense.multi_contact.tracking.multi_hypothesis_filter import (
    FORCE_DRIFT,
    Hypothesis,
    HypothesisFit,
    MultiHypothesisFilter,
    without_contact,
)
from contactsense.multi_contact.tracking.tracked_contacts import TrackedContact
from contactsense.runtime.buffers import KernelBuffers
from contactsense.runtime.result_rows import PROBABILITY
from contactsense.scene import Scene
from contactsense.sensors.usable_sensors import Usable
from contactsense.tracking.contact_tracker import NEW_TIME_CONSTANTS
from contactsense.tracking.window_averages import restart_windows
from contactsense.types import Estimate, Event, Phase

FORCE_CHANGE_LOG_ODDS = math.log(0.2)
"""Log prior odds of forces that change by more than `FORCE_DRIFT`."""
RELEASE_LOG_ODDS = math.log(0.02)
"""Log prior odds of a sudden release."""
WEAK_RELEASE_LOG_ODDS = math.log(0.5)
"""Log prior odds of the release of a contact that pushes less than `WEAK_FORCE`."""
FORCE_GROWTH_RATIO = 1.25
"""The force of the newest contact is growing if it exceeds this many times its last value."""
MAX_SETTLING_FACTOR = 5.0
"""A growing contact is searched again for at most this many times `SETTLING_TIME`."""
WEAK_FORCE = 5.0
"""A contact that pushes less than this may have been released [N]."""
RELEASE_FORCE = 1.0
"""A contact that pushes less than this for `PRIOR_INTERVAL` is released [N]."""


class Member(NamedTuple):
    """One of several contacts."""

    number: int
    since: float
    """Time of its onset [s]."""
    last_pushing: float
    """Time at which it last pushed with more than `RELEASE_FORCE` [s]."""
    phase: Phase


class MultiContactTracker:
    """Tracks several contacts of one stream."""

    def __init__(
        self,
        scene: Scene,
        kernel_buffers: KernelBuffers,
        locator: MultiContactLocator,
        builder: ContactSetBuilder,
    ) -> None:
        """Prepare for the scene and the kernel buffers of a `Localizer`, to which `locator` and `builder`
        belong too."""
        self._max_contacts, self._state = scene.contacts, kernel_buffers.state
        self._filter, self._builder = MultiHypothesisFilter(scene, kernel_buffers, locator), builder
        self._tau = 1.0 / (2.0 * math.pi * scene.bandwidth)
        self._single = FurtherContactTest(kernel_buffers, self._filter, self._tau)
        self.forget()

    def forget(self) -> None:
        """Forget all contacts."""
        self._members: list[Member] = []
        self._events: list[Event] = []
        self._filter.hypotheses = []
        self._single.restart()
        self._before_onset: list[Hypothesis] = []
        self._onset_force = 0.0
        self._prior_time = self._explained_time = self._next_search = -math.inf

    def end(self, t: float, number: int, unseen: str) -> tuple[Event, ...]:
        """Release all contacts; returns the release events, whose reason is `unseen`, except that of contact
        `number`. Of several, none resumes: an onset does not tell which."""
        if self._members:
            self._state.track.status[0].time_since_end = math.inf
        released = tuple(
            Event("release", member.number, t, reason=unseen)
            for member in self._members
            if member.number != number
        )
        self.forget()
        return released

    def step(
        self, t: float, present: Usable, number: int, explained: bool, reason: str
    ) -> tuple[Estimate | None, int, tuple[Event, ...]]:
        """Explain the sample last taken by the kernels, while there is contact.

        Args:
            t: Time of the sample [s].
            present: Which sensors can be used.
            number: Number of the single contact.
            explained: Whether a single contact explains the sample.
            reason: Why the estimate is `degraded`, empty if it is not.

        Returns:
            The estimate if there are several contacts, else None; the number of the first contact; and what
            happened to the others, where no estimate contains it.
        """
        if not self._members:
            extended = self._single.find(t, present, explained)
            if not extended:
                return None, number, ()
            self._next_search = t + SEARCH_INTERVAL * self._tau
            self._members = [Member(number, -math.inf, t, "hold")]
            self._add_contact(t, extended, self._single.before)
        estimate = self._update(t, present, reason)
        events: tuple[Event, ...] = ()
        if estimate is None:
            events = self._abandon(t)
        number = self._members[0].number
        if len(self._members) == 1:
            self._return_to_single_contact()
        return estimate, number, events

    def _update(self, t: float, present: Usable, reason: str) -> Estimate | None:
        """Estimate from the hypotheses; None if they explain nothing."""
        fits = self._filter.evaluate(present)
        limit = self._filter.energy_limit(present, len(self._members), FORCE_DRIFT)
        changed = False
        if self._before_onset:
            if t - self._prior_time > PRIOR_INTERVAL * self._tau:
                changed = self._reestimate_newest(t, present, fits, limit)
        elif fits and fits[0].hypothesis.energy <= limit:
            self._explained_time = t
            changed = self._release_unloaded(t, fits[0].hypothesis)
            if not changed and t - self._prior_time > PRIOR_INTERVAL * self._tau:
                unchanged = [fit.hypothesis for fit in fits]
                weak = [i for i, c in enumerate(unchanged[0].contacts) if _normal_force(c) < WEAK_FORCE]
                changed = self._test_release(t, present, weak, unchanged, FORCE_DRIFT, WEAK_RELEASE_LOG_ODDS)
                if not changed:
                    self._set_prior(t, unchanged)
        elif t >= self._next_search:
            self._next_search = t + SEARCH_INTERVAL * self._tau
            changed = self._detect_change(t, present, [fit.hypothesis for fit in fits], limit)
        if changed:
            fits = self._filter.evaluate(present)
        return self._build_estimate(t, fits, reason) if fits else None

    def _abandon(self, t: float) -> tuple[Event, ...]:
        """Release all contacts but the first, as nothing explains several; returns what is not reported
        yet."""
        for i in range(len(self._members) - 1, 0, -1):
            self._release(t, i)
        events, self._events = tuple(self._events), []
        return events

    def _reestimate_newest(
        self, t: float, present: Usable, fits: Sequence[HypothesisFit], limit: float
    ) -> bool:
        """Search again for the newest contact, whose force may have grown; returns whether it was found."""
        extended = self._filter.with_further_contact(present, self._before_onset)
        improved = bool(extended) and (
            not fits or extended[0].energy <= max(limit, fits[0].hypothesis.energy)
        )
        if improved:
            self._filter.set_prior(extended)
            normal_force = _normal_force(extended[0].contacts[-1])
            is_growing = normal_force > FORCE_GROWTH_RATIO * self._onset_force
            self._onset_force = normal_force
            age = (t - self._members[-1].since) / (SETTLING_TIME * self._tau)
            if age > (MAX_SETTLING_FACTOR if is_growing else 1.0):
                self._before_onset = []
        else:
            self._before_onset = []
        self._prior_time = self._explained_time = t
        return improved

    def _detect_change(
        self, t: float, present: Usable, unchanged: Sequence[Hypothesis], limit: float
    ) -> bool:
        """Search for a change since the prior; returns whether one was found."""
        hypothesis_filter, count = self._filter, len(self._members)
        changed_forces = [
            *unchanged,
            *hypothesis_filter.explain(
                present, hypothesis_filter.hypotheses, count, math.inf, odds=FORCE_CHANGE_LOG_ODDS
            ),
        ]
        extended = (
            hypothesis_filter.with_further_contact(present, hypothesis_filter.hypotheses)
            if count < self._max_contacts
            else []
        )
        if is_more_probable(extended, changed_forces) and extended[0].energy <= limit:
            self._add_contact(t, extended, hypothesis_filter.hypotheses)
            return True
        if t - self._explained_time > SETTLING_TIME * self._tau:
            changed_forces += hypothesis_filter.explain(
                present, hypothesis_filter.hypotheses, count, math.inf, SLIDE_DEVIATION
            )
            if self._test_release(t, present, range(count), changed_forces, math.inf, RELEASE_LOG_ODDS):
                return True
        if not changed_forces or not is_more_probable(changed_forces, unchanged):
            return False
        self._set_prior(t, changed_forces)
        return True

    def _test_release(
        self,
        t: float,
        present: Usable,
        indices: Sequence[int],
        unchanged: Sequence[Hypothesis],
        drift: float,
        odds: float,
    ) -> bool:
        """Release one of these contacts if that is more probable, given the log odds; returns whether."""
        for i in indices:
            remaining = without_contact(self._filter.hypotheses, i)
            reduced = self._filter.explain(present, remaining, len(self._members) - 1, drift, odds=odds)
            if is_more_probable(reduced, unchanged):
                self._release(t, i)
                self._set_prior(t, reduced)
                return True
        return False

    def _release_unloaded(self, t: float, best: Hypothesis) -> bool:
        """Release a contact that has not pushed for a while; returns whether there was one."""
        for i, contact in enumerate(best.contacts):
            if _normal_force(contact) > RELEASE_FORCE:
                self._members[i] = self._members[i]._replace(last_pushing=t)
            elif t - self._members[i].last_pushing > PRIOR_INTERVAL * self._tau:
                self._release(t, i)
                self._filter.hypotheses = without_contact(self._filter.hypotheses, i)
                return True
        return False

    def _add_contact(self, t: float, hypotheses: Sequence[Hypothesis], before: Sequence[Hypothesis]) -> None:
        """Add a further contact, found in `hypotheses`, given the hypotheses `before` its onset."""
        self._before_onset, self._onset_force = list(before), math.inf
        status = self._state.track.status[0]
        status.count += 1
        number = int(status.count)
        self._members.append(Member(number, t, t, "new"))
        self._events.append(Event("onset", number, t))
        self._set_prior(t, hypotheses)
        self._explained_time = t

    def _release(self, t: float, i: int) -> None:
        self._events.append(Event("release", self._members[i].number, t))
        del self._members[i]

    def _set_prior(self, t: float, hypotheses: Sequence[Hypothesis]) -> None:
        if hypotheses:
            self._filter.set_prior(hypotheses)
        self._prior_time = t

    def _return_to_single_contact(self) -> None:
        """Return to a single contact, whose averaging windows restart."""
        self._filter.hypotheses, self._members, self._before_onset = [], [], []
        self._single.restart(self._next_search)
        restart_windows(self._state.track)

    def _build_estimate(self, t: float, fits: Sequence[HypothesisFit], reason: str) -> Estimate:
        for i, member in enumerate(self._members):
            if member.phase == "new" and t - member.since > NEW_TIME_CONSTANTS * self._tau:
                self._members[i] = member._replace(phase="hold")
                self._events.append(Event("hold", member.number, t))
        best = fits[0]
        odds = [math.exp(fit.hypothesis.log_probability - best.hypothesis.log_probability) for fit in fits]
        for fit, share in zip(fits, odds, strict=True):
            fit.rows[:, PROBABILITY] = share / sum(odds)
        labels: list[tuple[int, Phase]] = [(member.number, member.phase) for member in self._members]
        rows, counts = np.concatenate([fit.rows for fit in fits]), np.array([len(fit.rows) for fit in fits])
        found = ContactSets(rows, counts, best.wrench, best.covariance, best.rank)
        estimate = self._builder.sets(t, found, len(labels), reason, labels, tuple(self._events))
        self._events = []
        return estimate


def _normal_force(contact: TrackedContact) -> float:
    """Normal force [N]."""
    return -float(contact.force @ contact.normal)
