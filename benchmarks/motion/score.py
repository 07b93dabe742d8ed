"""Compare the estimates of one stream with the truth."""

from collections.abc import Iterable
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np

from contactsense import Estimate
from contactsense.benchmarks.motion.streams import Stream

FORCE = 5.0
"""Contacts count while their force is at least this [N], the smallest in the static suite."""
AFTERGLOW = 0.2
"""Time after the end of a contact during which the observer may still report it [s]."""
PAUSE = 0.1
"""Alarms separated by less than this are one alarm [s]."""

APART = 0.02
"""Candidates nearer to the best one than this are the same place for most purposes [m]."""
CLEAR = 0.95
"""The default of `Scene.clear`."""
AGES = (0.02, 0.1, 0.3, 1.0)
"""Times after the onset of a contact at which its answer is taken [s]."""


class Answer(NamedTuple):
    """The answer for a contact at a certain time after its onset."""

    age: float
    """One of `AGES`."""
    ambiguous: bool
    """Whether several candidates remain."""
    link_right: bool
    """Whether the link of the best one is correct; False without an answer."""
    error: float
    """Its distance from the truth, infinite without an answer [m]."""
    apart: bool = False
    """Whether less than `CLEAR` of the probability is within `APART` of the best one, on its link."""
    stated: float = 0.0
    """Stated probability of the most probable link."""


@dataclass
class Score:
    """Sums over any number of streams; `add` adds one."""

    error: list[float] = field(default_factory=list)
    """Distance from the truth of each sample with an answer, of those touched by at least `FORCE` [m]."""
    link_right: list[bool] = field(default_factory=list)
    """Whether its link is correct."""
    clear: list[bool] = field(default_factory=list)
    """Whether its status was `contact`."""
    touched: int = 0
    """Number of samples touched at one place by at least `FORCE`."""
    rows: list[tuple[Stream, int]] = field(default_factory=list)
    """Indices of the samples with an answer, for the comparison with an arm at rest."""
    answers: list[Answer] = field(default_factory=list)
    """Of the runs without overlapping contacts, for each contact that lasts so long with `FORCE`."""
    at_age: dict[float, list[tuple[Stream, int]]] = field(default_factory=dict)
    """The samples of `answers`, by age."""
    delay: list[float] = field(default_factory=list)
    """Delay from the first sample of a contact to the first answer, for contacts that were found [s]."""
    events: dict[str, int] = field(default_factory=dict)
    """Number of contacts of each type, without those that began beside another."""
    beside: int = 0
    """Contacts that began while another one acted, whose answers hide when they were detected."""
    missed: dict[str, int] = field(default_factory=dict)
    """Number of contacts without any answer, of each type."""
    masked: int = 0
    """Contacts that began during a false alarm: whether they were detected is undefined."""
    false_alarms: int = 0
    """Number of contacts reported although there is none."""
    free: float = 0.0
    """Time without contact [s]."""

    def add(self, stream: Stream, estimates: Iterable[Estimate]) -> None:
        """Add the estimates of all samples of a stream."""
        answered = np.zeros(len(stream.t), dtype=bool)
        strong = is_touched_by_force(stream)
        self.touched += int(strong.sum())
        ages = samples_at_ages(stream)
        for i, age in ages.items():
            self.at_age.setdefault(age, []).append((stream, i))
        for i, estimate in enumerate(estimates):
            if i in ages:
                self.answers.append(_answer(ages[i], estimate, int(stream.link[i]), stream.point_base[i]))
            if not estimate.contacts:
                continue
            answered[i] = True
            if strong[i]:
                best = estimate.contacts[0]
                self.error.append(float(np.linalg.norm(best.point_base - stream.point_base[i])))
                self.link_right.append(best.link_index == stream.link[i])
                self.clear.append(estimate.status == "contact")
                self.rows.append((stream, i))
        self._add_events(stream, answered)
        self._add_alarms(stream, answered)

    def _add_events(self, stream: Stream, answered: np.ndarray) -> None:
        late = round(0.5 * AFTERGLOW / float(np.median(np.diff(stream.t))))
        for event in stream.events:
            if event.start > 0 and stream.touched[event.start - 1]:
                self.beside += 1
                continue
            self.events[event.type] = self.events.get(event.type, 0) + 1
            found = np.flatnonzero(answered[event.start : event.stop + late])
            if answered[max(event.start - 1, 0)]:
                self.masked += 1
            elif len(found):
                self.delay.append(float(stream.t[event.start + found[0]] - stream.t[event.start]))
            else:
                self.missed[event.type] = self.missed.get(event.type, 0) + 1

    def _add_alarms(self, stream: Stream, answered: np.ndarray) -> None:
        dt = float(np.median(np.diff(stream.t)))
        free = ~stream.touched
        for event in stream.events:
            free[event.start : event.stop + round(AFTERGLOW / dt)] = False
        self.free += dt * float(free.sum())
        alarms = stream.t[free & answered]
        self.false_alarms += int(len(alarms) > 0) + int((np.diff(alarms) > PAUSE).sum())


def is_touched_by_force(stream: Stream) -> np.ndarray:
    """Which samples are touched at one place by at least `FORCE`, shape (N,)."""
    return np.asarray((stream.link >= 0) & (np.linalg.norm(stream.wrench[:, :3], axis=1) >= FORCE))


def samples_at_ages(stream: Stream) -> dict[int, float]:
    """Samples at which a contact, touched so, has one of the `AGES`."""
    strong = is_touched_by_force(stream)
    dt = float(np.median(np.diff(stream.t)))
    samples = {
        event.start + round(age / dt): (age, event)
        for event in stream.events
        for age in AGES
        if not stream.multi
    }
    return {i: age for i, (age, event) in samples.items() if i < event.stop and strong[i]}


def _answer(age: float, estimate: Estimate, link: int, point: np.ndarray) -> Answer:
    if not estimate.contacts:
        return Answer(age, False, False, float("inf"))
    best = estimate.contacts[0]
    error = float(np.linalg.norm(best.point_base - point))
    near = sum(
        candidate.probability
        for candidate in estimate.contacts
        if candidate.link_index == best.link_index
        and np.linalg.norm(candidate.point_base - best.point_base) < APART
    )
    return Answer(
        age,
        estimate.status == "ambiguous",
        best.link_index == link,
        error,
        near < CLEAR,
        float(estimate.link_probability[best.link_index]),
    )
