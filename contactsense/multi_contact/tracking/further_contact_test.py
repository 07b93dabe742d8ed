"""Tests whether a further contact has started beside a single one.

The onset of a further contact looks like a slide of the first: one contact explains both, at another place.
So the estimate of the first from before is kept, and tested against every sample. While it explains them, a
newer one takes its place every `PRIOR_INTERVAL`, so that it is always older than the time in which an onset
shows. Where it does not, a slide, a new contact after a release, and a further contact compete by log
evidence. If none of these is a further contact within `SETTLING_TIME`, the change was one of the others.
"""

import math

from contactsense.multi_contact.tracking.candidate_hypotheses import candidate_hypotheses
from contactsense.multi_contact.tracking.hypothesis_test import (
    PRIOR_INTERVAL,
    SEARCH_INTERVAL,
    SETTLING_TIME,
    SHORT_SLIDE_DEVIATION,
    SLIDE_DEVIATION,
    is_more_probable,
)
from contactsense.multi_contact.tracking.multi_hypothesis_filter import (
    FORCE_DRIFT,
    Hypothesis,
    MultiHypothesisFilter,
)
from contactsense.runtime.buffers import KernelBuffers
from contactsense.sensors.usable_sensors import Usable
from contactsense.tracking.contact_track import NEW


class FurtherContactTest:
    """The test in one stream."""

    def __init__(
        self, kernel_buffers: KernelBuffers, hypothesis_filter: MultiHypothesisFilter, tau: float
    ) -> None:
        """Prepare for a stream; `tau`: time constant of its observers [s]."""
        self._constants, self._state = kernel_buffers.constants, kernel_buffers.state
        self._filter, self._tau = hypothesis_filter, tau
        self.restart()

    def restart(self, next_test: float = -math.inf) -> None:
        """Begin anew with the contact that there is at time `next_test` [s]."""
        self.before: list[Hypothesis] = []
        """Hypotheses about the single contact from before, which are tested."""
        self._newer: list[Hypothesis] = []
        self._before_time = self._explained_time = -math.inf
        self._next_test = next_test

    def find(self, t: float, present: Usable, explained: bool) -> list[Hypothesis]:
        """Test the sample last taken by the kernels.

        Args:
            t: Time of the sample [s].
            present: Which sensors can be used.
            explained: Whether a single contact explains the sample.

        Returns:
            Hypotheses about two contacts if a further one has started; else none.
        """
        if t < self._next_test:
            return []
        self._next_test = t + SEARCH_INTERVAL * self._tau
        if self._state.track.status[0].phase == NEW:
            self.before = []
            return []
        now = candidate_hypotheses(self._constants, self._state) if explained else []
        if not self.before:
            self._begin(t, now)
            return []
        unchanged = self._filter.explain(present, self.before, 1, math.inf)
        if unchanged and unchanged[0].energy <= self._filter.energy_limit(present, 1, math.inf):
            self._explained_time = t
            if t - self._before_time > PRIOR_INTERVAL * self._tau:
                self.before, self._newer, self._before_time = self._newer, now, t
            return []
        extended = self._filter.with_further_contact(present, self.before)
        if is_more_probable(extended, [*unchanged, *self._changes(present)]) and extended[
            0
        ].energy <= self._filter.energy_limit(present, 2, FORCE_DRIFT):
            return extended
        if t - self._explained_time > SETTLING_TIME * self._tau:
            self._begin(t, now)
        return []

    def _begin(self, t: float, now: list[Hypothesis]) -> None:
        self.before = self._newer = now
        self._before_time = self._explained_time = t

    def _changes(self, present: Usable) -> list[Hypothesis]:
        """What else may have happened: a slide, or a new contact in place of the first."""
        changes = []
        for deviation in (SLIDE_DEVIATION, SHORT_SLIDE_DEVIATION):
            changes += self._filter.explain(present, self.before, 1, math.inf, deviation)
        return changes + self._filter.explain(present, [Hypothesis((), 0.0)], 1, math.inf)
