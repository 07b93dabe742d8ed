"""When the test of a single contact says that a further one has started, with hypotheses made up for it."""

import math
from collections.abc import Sequence
from types import SimpleNamespace
from typing import Any

import pytest

from contactsense.multi_contact.tracking import further_contact_test
from contactsense.multi_contact.tracking.further_contact_test import FurtherContactTest
from contactsense.multi_contact.tracking.hypothesis_test import PRIOR_INTERVAL, SEARCH_INTERVAL, SETTLING_TIME
from contactsense.multi_contact.tracking.multi_hypothesis_filter import Hypothesis
from contactsense.tracking.contact_track import HOLD, NEW

TAU = 0.01
USABLE = (True, True, 0)
LIKELY, UNLIKELY = Hypothesis((), 50.0, energy=1.0), Hypothesis((), 0.0, energy=100.0)
LIMIT = 10.0


class MadeUpFilter:
    """Answers with what a test has set."""

    def __init__(self) -> None:
        self.unchanged = self.slid = self.replaced = self.further = UNLIKELY

    def explain(
        self, _: Any, before: Sequence[Hypothesis], count: int, drift: float, deviation: float = 0.0
    ) -> list[Hypothesis]:
        assert (count, drift) == (1, math.inf)
        if before == [Hypothesis((), 0.0)]:
            return [self.replaced]
        return [self.slid if deviation else self.unchanged]

    def with_further_contact(self, _: Any, before: Sequence[Hypothesis]) -> list[Hypothesis]:
        return [self.further]

    def energy_limit(self, *_: Any) -> float:
        return LIMIT


class Stream:
    """A test, and the time."""

    def __init__(self, monkeypatch: pytest.MonkeyPatch) -> None:
        self.status = SimpleNamespace(phase=HOLD)
        self.filter, self.t, self.now = MadeUpFilter(), 0.0, 0
        monkeypatch.setattr(
            further_contact_test, "candidate_hypotheses", lambda *_: [self.candidate(self.now)]
        )
        buffers: Any = SimpleNamespace(
            constants=None, state=SimpleNamespace(track=SimpleNamespace(status=[self.status]))
        )
        self.test = FurtherContactTest(buffers, self.filter, TAU)  # type: ignore[arg-type]

    def candidate(self, number: int) -> Hypothesis:
        return Hypothesis((), 0.0, energy=float(number))

    def pass_by(self, time_constants: float) -> list[Hypothesis]:
        """Time passes, in steps of a search; each has another candidate. Returns what was found first."""
        for _ in range(round(time_constants / SEARCH_INTERVAL)):
            self.t += SEARCH_INTERVAL * TAU * 1.001
            self.now += 1
            found = self.test.find(self.t, USABLE, explained=True)
            if found:
                return found
        return []


@pytest.fixture
def stream(monkeypatch: pytest.MonkeyPatch) -> Stream:
    """A stream with an estimate from before."""
    found = Stream(monkeypatch)
    found.filter.unchanged = LIKELY
    assert found.pass_by(2.0 * PRIOR_INTERVAL) == []
    assert found.test.before
    return found


def test_a_further_contact_that_explains_best_has_started(stream: Stream) -> None:
    stream.filter.unchanged, stream.filter.further = UNLIKELY, LIKELY
    assert stream.pass_by(1.0) == [LIKELY]


@pytest.mark.parametrize("other", ["slid", "replaced"])
def test_a_slide_or_another_contact_explains_as_well(stream: Stream, other: str) -> None:
    stream.filter.unchanged, stream.filter.further = UNLIKELY, LIKELY
    setattr(stream.filter, other, LIKELY)
    assert stream.pass_by(SETTLING_TIME) == []


def test_a_further_contact_must_explain_the_sample(stream: Stream) -> None:
    stream.filter.unchanged = UNLIKELY
    stream.filter.further = Hypothesis((), 50.0, energy=2.0 * LIMIT)
    assert stream.pass_by(1.0) == []


def test_the_estimate_from_before_is_always_older_than_the_interval(stream: Stream) -> None:
    before = stream.test.before
    stream.pass_by(2.0 * PRIOR_INTERVAL + 2.0)
    (kept,) = stream.test.before
    assert kept != before[0]
    assert stream.now - kept.energy >= PRIOR_INTERVAL / SEARCH_INTERVAL


def test_what_is_no_further_contact_after_some_time_was_another_change(stream: Stream) -> None:
    """Then the contact is tested where it is now."""
    before = stream.test.before
    stream.filter.unchanged = stream.filter.further = UNLIKELY
    stream.pass_by(SETTLING_TIME - 1.0)
    assert stream.test.before == before
    stream.pass_by(3.0)
    assert stream.test.before != before


def test_a_contact_that_is_new_is_not_tested(stream: Stream) -> None:
    stream.filter.unchanged, stream.filter.further = UNLIKELY, LIKELY
    stream.status.phase = NEW
    assert stream.pass_by(5.0) == []
    assert stream.test.before == []


def test_after_several_contacts_the_next_test_keeps_its_time(stream: Stream) -> None:
    stream.test.restart(stream.t + 1.0)
    assert stream.pass_by(50.0) == []
    assert stream.test.before == []
    stream.pass_by(100.0)
    assert stream.test.before
