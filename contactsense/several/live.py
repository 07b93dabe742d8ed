"""Several contacts in a live stream: a further one is told from the one that is tracked already.

While a single contact is on, its place as it was a moment ago is held against every sample. Where that
leaves more than noise does, there are three ways to go on: the contact has slid, it has gone and another has
come, or a further one has come beside it. They compete by evidence. What is known of the first contact is
kept as it was until that is settled: at its onset a further contact looks like a slide of the first.

Several contacts go on as a bank of sets that explain the first moments of the further one about equally well:
while its force still grows its place is sought anew again and again, beside what was known before it came.
Then each set's places are the prior of its next samples, its forces may drift; the evidence sums up, so that
the sets become more or less probable. As the observers' noise is correlated, a prior is renewed only after a
few of their time constants.
"""

import math
from collections.abc import Sequence
from typing import NamedTuple

from contactsense.report import PROBABILITY
from contactsense.scene import Scene
from contactsense.several.answer import SetComposer
from contactsense.several.bank import DRIFT, SIZE, Bank, Fit, Rival, without
from contactsense.several.kept import Kept, kept
from contactsense.several.locator import SetLocator
from contactsense.tracker import NEW, NUMBER, PHASE, SETTLED, restart
from contactsense.types import Estimate, Event, Phase
from contactsense.workspace import Workspace

RENEW = 3.0
"""A prior is renewed after so many time constants of the observers."""
PATIENCE = 8.0
"""For so many time constants a further contact is sought before a change counts as a slide."""
PAUSE = 0.5
"""Time constants between two looks at a single contact, or two searches."""
SLIDE = 0.04
"""How far a contact may have slid, standard deviation [m]."""
PUSHED = math.log(0.2)
"""Log odds of forces that have changed by more than `DRIFT`."""
GONE = math.log(0.02)
"""Log odds of a contact that has gone at once."""
FADED = math.log(0.5)
"""The same of one that pushes no more than `WEAK`."""
MARGIN = 2.0
"""Log odds by which a change must win."""
LIKELY = 0.1
"""Explanations of a single contact that are more probable than this are held against a further one."""
GROWN = 1.25
"""A force that is more than so many times what it was at the last search still grows."""
YOUTH = 5.0
"""A contact whose force grows is sought anew for at most so many times `PATIENCE`."""
WEAK = 5.0
"""A contact that pushes less than this may have gone [N]."""
FAINT = 1.0
"""A contact that pushes less than this for a while is over [N]."""


class Member(NamedTuple):
    """One of several contacts."""

    number: int
    since: float
    """When it began [s]."""
    strong: float
    """When it was last more than faint [s]."""
    phase: Phase


class SetTracker:
    """Several contacts of one stream."""

    def __init__(self, scene: Scene, work: Workspace, locator: SetLocator, answer: SetComposer) -> None:
        """For the scene and the workspace of a `Localizer`; `locator` and `answer` are for the same."""
        self._most, self._arm, self._memory = scene.contacts, work.arm, work.memory
        self._bank, self._answer = Bank(scene, work, locator), answer
        self._tau = 1.0 / (2.0 * math.pi * scene.bandwidth)
        self.forget()

    def forget(self) -> None:
        """No contacts."""
        self._members: list[Member] = []
        self._events: list[Event] = []
        self._bank.rivals = []
        self._known: list[Rival] = []
        self._before: list[Rival] = []
        self._pushed = 0.0
        self._fresh: list[Rival] = []
        self._renewed = self._calm = self._next = -math.inf

    def end(self, t: float, number: int) -> tuple[Event, ...]:
        """Nothing touches any more: the ends of all contacts but that of `number`."""
        over = tuple(Event("release", m.number, t) for m in self._members if m.number != number)
        self.forget()
        return over

    def step(
        self, t: float, present: tuple[bool, bool, bool], number: int, explained: bool, reason: str
    ) -> tuple[Estimate | None, int]:
        """Explain the sample that the workspace has taken last, while something touches.

        Args:
            t: Its time [s].
            present: Which of base wrench, joint torques and wrist wrench can be used.
            number: Number of the single contact.
            explained: Whether a single contact explains the sample.
            reason: Why the estimate is `degraded`, if it is.

        Returns:
            The estimate where there are several contacts, and the number of the first contact.
        """
        if not self._members and t >= self._next:
            self._next = t + PAUSE * self._tau
            self._watch(t, present, number, explained)
        if not self._members:
            return None, number
        estimate = self._together(t, present, reason)
        if self._members:
            number = self._members[0].number
        if len(self._members) == 1:
            self._leave()
        return estimate, number

    def _watch(self, t: float, present: tuple[bool, bool, bool], number: int, explained: bool) -> None:
        """Hold what was known of a single contact against the sample; start a bank where a further one has
        come."""
        if self._memory.track.life[PHASE] == NEW:
            self._known = []
            return
        now = self._single() if explained else []
        if not self._known:
            self._known = self._fresh = now
            self._renewed = self._calm = t
            return
        bank = self._bank
        stays = bank.explain(present, self._known, 1, math.inf)
        if stays and stays[0].energy <= bank.limit(present, 1, math.inf):
            self._calm = t
            if t - self._renewed > RENEW * self._tau:
                self._known, self._fresh, self._renewed = self._fresh, now, t
            return
        other = stays + bank.explain(present, self._known, 1, math.inf, SLIDE)
        other += bank.explain(present, [Rival((), 0.0)], 1, math.inf)
        more = bank.further(present, self._known)
        if _wins(more, other) and more[0].energy <= bank.limit(present, 2, DRIFT):
            self._members = [Member(number, -math.inf, t, "hold")]
            self._join(t, more, self._known)
        elif t - self._calm > PATIENCE * self._tau:
            self._known = self._fresh = now
            self._renewed = self._calm = t

    def _single(self) -> list[Rival]:
        """The explanations of the single contact that are probable enough."""
        found, motion = self._memory.found, self._memory.motion
        rivals = []
        for row in found.order[: SIZE - 1]:
            p = float(found.probability[row])
            if p < LIKELY:
                break
            place = (found.point[row], found.normal[row], found.covariance[row], found.force[row])
            rivals.append(Rival((kept(self._arm, motion, int(found.primitive[row]), *place),), math.log(p)))
        return rivals

    def _together(self, t: float, present: tuple[bool, bool, bool], reason: str) -> Estimate | None:
        """The estimate of the bank; None where it explains nothing."""
        fits = self._bank.look(present)
        limit = self._bank.limit(present, len(self._members), DRIFT)
        changed = False
        if self._before:
            if t - self._renewed > RENEW * self._tau:
                changed = self._seek_again(t, present, fits, limit)
        elif fits and fits[0].rival.energy <= limit:
            self._calm = t
            changed = self._drop_faint(t, fits[0].rival)
            if not changed and t - self._renewed > RENEW * self._tau:
                stays = [fit.rival for fit in fits]
                weak = [i for i, c in enumerate(stays[0].contacts) if _push(c) < WEAK]
                changed = self._drop(t, present, weak, stays, DRIFT, FADED)
                if not changed:
                    self._renew(t, stays)
        elif t >= self._next:
            self._next = t + PAUSE * self._tau
            changed = self._change(t, present, [fit.rival for fit in fits], limit)
        if changed:
            fits = self._bank.look(present)
        if not fits:
            self._leave()
            return None
        return self._compose(t, fits, reason)

    def _seek_again(
        self, t: float, present: tuple[bool, bool, bool], fits: Sequence[Fit], limit: float
    ) -> bool:
        """Seek the newest contact anew, whose force may have grown; returns whether it was found."""
        more = self._bank.further(present, self._before)
        found = bool(more) and (not fits or more[0].energy <= max(limit, fits[0].rival.energy))
        if found:
            self._bank.settle(more)
            push = _push(more[0].contacts[-1])
            grows = push > GROWN * self._pushed
            self._pushed = push
            age = (t - self._members[-1].since) / (PATIENCE * self._tau)
            if age > (YOUTH if grows else 1.0):
                self._before = []
        else:
            self._before = []
        self._renewed = self._calm = t
        return found

    def _change(
        self, t: float, present: tuple[bool, bool, bool], stays: Sequence[Rival], limit: float
    ) -> bool:
        """Look for what has changed since the prior; returns whether that was found."""
        bank, count = self._bank, len(self._members)
        same = [*stays, *bank.explain(present, bank.rivals, count, math.inf, odds=PUSHED)]
        more = bank.further(present, bank.rivals) if count < self._most else []
        if _wins(more, same) and more[0].energy <= limit:
            self._join(t, more, bank.rivals)
            return True
        if t - self._calm > PATIENCE * self._tau:
            same += bank.explain(present, bank.rivals, count, math.inf, SLIDE)
            if self._drop(t, present, range(count), same, math.inf, GONE):
                return True
        if not same or not _wins(same, stays):
            return False
        self._renew(t, same)
        return True

    def _drop(
        self,
        t: float,
        present: tuple[bool, bool, bool],
        which: Sequence[int],
        stays: Sequence[Rival],
        drift: float,
        odds: float,
    ) -> bool:
        """Whether one of these contacts has gone, which has these log odds: it is released."""
        for i in which:
            left = without(self._bank.rivals, i)
            fewer = self._bank.explain(present, left, len(self._members) - 1, drift, odds=odds)
            if _wins(fewer, stays):
                self._release(t, i)
                self._renew(t, fewer)
                return True
        return False

    def _drop_faint(self, t: float, best: Rival) -> bool:
        """A contact that has not pushed for a while is over; whether there was one."""
        for i, contact in enumerate(best.contacts):
            if _push(contact) > FAINT:
                self._members[i] = self._members[i]._replace(strong=t)
            elif t - self._members[i].strong > RENEW * self._tau:
                self._release(t, i)
                self._bank.rivals = without(self._bank.rivals, i)
                return True
        return False

    def _join(self, t: float, rivals: Sequence[Rival], before: Sequence[Rival]) -> None:
        """A further contact has come, as in these sets, after what was known `before`."""
        self._before, self._pushed = list(before), math.inf
        life = self._memory.track.life
        life[NUMBER] += 1.0
        self._members.append(Member(int(life[NUMBER]), t, t, "new"))
        self._events.append(Event("onset", int(life[NUMBER]), t))
        self._renew(t, rivals)
        self._calm = t

    def _release(self, t: float, i: int) -> None:
        self._events.append(Event("release", self._members[i].number, t))
        del self._members[i]

    def _renew(self, t: float, rivals: Sequence[Rival]) -> None:
        if rivals:
            self._bank.settle(rivals)
        self._renewed = t

    def _leave(self) -> None:
        """Go on with a single contact, whose averages start anew."""
        self._bank.rivals, self._members, self._known, self._before = [], [], [], []
        restart(self._memory.track)

    def _compose(self, t: float, fits: Sequence[Fit], reason: str) -> Estimate:
        for i, member in enumerate(self._members):
            if member.phase == "new" and t - member.since > SETTLED * self._tau:
                self._members[i] = member._replace(phase="hold")
                self._events.append(Event("hold", member.number, t))
        best = fits[0]
        odds = [math.exp(fit.rival.weight - best.rival.weight) for fit in fits]
        for fit, share in zip(fits, odds, strict=True):
            fit.rows[:, PROBABILITY] = share / sum(odds)
        labels: list[tuple[int, Phase]] = [(member.number, member.phase) for member in self._members]
        estimate = self._answer.sets(
            t, [fit.rows for fit in fits], best.wrench, best.covariance, best.rank, len(labels), reason,
            labels, tuple(self._events),
        )  # fmt: skip
        self._events = []
        return estimate


def _push(contact: Kept) -> float:
    """Normal force [N]."""
    return -float(contact.force @ contact.normal)


def _wins(one: Sequence[Rival], other: Sequence[Rival]) -> bool:
    """Whether the best of some sets is clearly more probable than the best of others."""
    best = max((rival.weight for rival in other), default=-math.inf)
    return any(rival.weight > best + MARGIN for rival in one)
