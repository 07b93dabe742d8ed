"""Which set of changed lines explains the readings.

The line that explains most alone need not be among those that explain everything together: a smaller scale of
the torques explains a part of what a smaller arm and a forgotten tool explain. A sequential floating search
(P. Pudil, J. Novovicova, J. Kittler, "Floating search methods in feature selection", Pattern Recognition
Letters 1994) therefore looks back: with two lines or more, each is withdrawn in turn, and everything that
could be wrong is tried in its place, its parameters estimated together with those of the lines that stay.

Sets are compared by the cost of `contactsense.setup_check.fit.fitter`. Each line must lower it by what is
`needed`, so that one line that explains everything is preferred to two.
"""

from dataclasses import dataclass, field, replace

from contactsense.setup_check.fit.fitter import Fit, Fitter
from contactsense.setup_check.hypotheses.all_hypotheses import Hypotheses
from contactsense.setup_check.hypotheses.hypothesis import Hypothesis
from contactsense.setup_check.lines import Line, states_inertia
from contactsense.setup_check.search.candidate import Candidate
from contactsense.setup_check.search.change import Change, groups, with_changes, with_estimates
from contactsense.setup_check.search.changes import matters
from contactsense.setup_check.setup import Free, Setup

EVIDENCE = 30.0
"""A line is reported as wrong if twice the log likelihood rises by more than this beyond the penalty: for
one free parameter a chance of 1e-7."""
_LOAD_EVIDENCE = 15.0
"""The same for a load on a link, whose penalty states what is known of it beforehand: odds of 1800 to 1. On
real recordings of right scenes it rises by up to 4."""
EXCLUDED = 20.0
"""Another value is excluded if twice the log likelihood falls by more than this."""
_SWEEPS = 4
"""Exchanges of one line; each lowers the cost, so that there are few."""
_TRIED = 6
"""Hypotheses that are fitted in the place of a line: the best by their first Gauss-Newton step."""


@dataclass(frozen=True)
class Explanation:
    """A set of changes of the stated setup."""

    changes: tuple[Change, ...]
    fit: Fit
    """With all parameters of the changes estimated together."""
    without: dict[Line, Fit] = field(default_factory=dict)
    """For each changed line: the best fit in which it keeps the scene's value."""
    rivals: dict[Line, tuple[Line, ...]] = field(default_factory=dict)
    """For each changed line: others that explain about as much in its place."""

    @property
    def lines(self) -> tuple[Line, ...]:
        """The changed lines, in the order in which they were found."""
        return tuple(dict.fromkeys(change.line for change in self.changes))

    def evidence(self, fitter: Fitter, line: Line) -> float:
        """By how much the cost rises without the changes of a line."""
        return fitter.cost(self.without[line]) - fitter.cost(self.fit)


def needed(line: Line) -> float:
    """By how much twice the log likelihood must rise beyond the penalty for a line to be wrong."""
    return _LOAD_EVIDENCE if states_inertia(line) else EVIDENCE


def exchanged(
    fitter: Fitter,
    hypotheses: Hypotheses,
    stated: Setup,
    changes: tuple[Change, ...],
    firsts: tuple[Change, ...] = (),
) -> Explanation:
    """The best explanation that exchanges of one line at a time lead to; lines that it does not need are left
    out. The fitter then counts independent rows as its residuals have them.

    Args:
        fitter: Of the recordings.
        hypotheses: All that could be wrong.
        stated: The setup of the scene.
        changes: What explains the readings so far; at least one.
        firsts: Other lines from which a pair may start.
    """
    fitter.effective[:] = 1.0
    best = Explanation(changes, fitter.fit(with_changes(changes, stated), _free(changes)))
    options = [best, *pairs(fitter, hypotheses, stated, firsts)]
    fitter.set_effective_rows(min((option.fit for option in options), key=fitter.cost).residual)
    best = _better(fitter, best, options)
    for _ in range(_SWEEPS):
        best, others = _swept(fitter, hypotheses, stated, best)
        better = _better(fitter, best, others)
        if better is best:
            break
        best = better
    else:
        best, _ = _swept(fitter, hypotheses, stated, best)
    needless = [line for line in best.without if best.evidence(fitter, line) < needed(line)]
    if needless and len(best.lines) > 1:
        line = min(needless, key=lambda line: best.evidence(fitter, line))
        return exchanged(
            fitter, hypotheses, stated, tuple(change for change in best.changes if change.line != line)
        )
    return best


def pairs(
    fitter: Fitter, hypotheses: Hypotheses, stated: Setup, firsts: tuple[Change, ...]
) -> list[Explanation]:
    """Explanations of two lines, the first of them one of `firsts`."""
    return [
        found
        for first in firsts
        for found in _extended(
            fitter, hypotheses, stated, (first,), fitter.fit(with_changes((first,), stated), first.free)
        )
    ]


def _better(fitter: Fitter, now: Explanation, others: list[Explanation]) -> Explanation:
    """The best of all, if it is clearly better than `now`."""
    best = min(others, key=lambda other: fitter.cost(other.fit), default=now)
    return best if fitter.cost(now.fit) - fitter.cost(best.fit) > EXCLUDED else now


def changes_of(candidate: Candidate, setup: Setup) -> tuple[Change, ...]:
    """What a candidate changes of the setup for which its hypothesis was made, line by line."""
    second = candidate.hypothesis.second_line
    if second is None:
        return (change_of(candidate, setup),)
    first = Change(second.line, (), setup, second.setup, second.setup, second.text)
    return first, change_of(candidate, second.setup)


def change_of(candidate: Candidate, before: Setup) -> Change:
    """What a candidate changes in its own line; `before`: the setup that has all else that it changes."""
    hypothesis = candidate.hypothesis
    text = next(text for text, start in hypothesis.starts if start is candidate.start)
    after = with_estimates(candidate.start, hypothesis.free, candidate.fit.setup)
    text = "" if hypothesis.free else text
    return Change(hypothesis.line, hypothesis.free, before, after, candidate.start, text)


def _swept(
    fitter: Fitter, hypotheses: Hypotheses, stated: Setup, now: Explanation
) -> tuple[Explanation, list[Explanation]]:
    """The explanation with what each of its lines contributes, and those in which one line is another."""
    fitter.effective[:] = 1.0
    without: dict[Line, Fit] = {}
    instead: dict[Line, list[Explanation]] = {}
    for line in now.lines:
        rest = tuple(change for change in now.changes if change.line != line)
        without[line] = fitter.fit(with_changes(rest, stated), _free(rest))
        instead[line] = _extended(fitter, hypotheses, stated, rest, without[line])
    found = [other for others in instead.values() for other in others]
    fits = [now.fit, *without.values(), *(other.fit for other in found)]
    fitter.set_effective_rows(min(fits, key=fitter.cost).residual)
    limit = fitter.cost(now.fit) + EXCLUDED
    rivals = {
        line: tuple(
            dict.fromkeys(
                other.changes[-1].line
                for other in others
                if other.changes[-1].line != line and fitter.cost(other.fit) < limit
            )
        )
        for line, others in instead.items()
    }
    return replace(now, without=without, rivals=rivals), found


def _extended(
    fitter: Fitter, hypotheses: Hypotheses, stated: Setup, rest: tuple[Change, ...], now: Fit
) -> list[Explanation]:
    """Explanations with one line more; `now`: the fit of those changes alone.

    What the nuisances can take up is tried alone only: beside another line, a load on the last links explains
    as much as a tool. Hypotheses of two lines would be two more.
    """
    free, found = _free(rest), []
    unfitted = with_changes((change.unfitted() for change in rest), stated)
    tried = [
        (fitter.predicted_cost(start, groups(free, hypothesis.free)), hypothesis, start)
        for hypothesis in hypotheses.of(now.setup)
        if hypothesis.second_line is None and not (rest and hypothesis.absorbed)
        for _, start in hypothesis.starts
    ]
    best: dict[int, tuple[float, Hypothesis, Setup]] = {}
    for option in sorted(tried, key=lambda option: option[0]):
        best.setdefault(id(option[1]), option)
    for _, hypothesis, start in list(best.values())[:_TRIED]:
        # The parameters of the other lines were estimated without this one, and may be far from the truth.
        change = Change(hypothesis.line, hypothesis.free, now.setup, start, start)
        fits = [fitter.fit(place, groups(free, hypothesis.free)) for place in (start, change.on(unfitted))]
        candidate = Candidate(hypothesis, min(fits, key=fitter.cost), start)
        own = replace(candidate.fit, free=hypothesis.free)
        if matters(now.setup, own) and candidate.explains(now):
            found.append(Explanation((*rest, change_of(candidate, now.setup)), candidate.fit))
    return found


def _free(changes: tuple[Change, ...]) -> tuple[Free, ...]:
    return groups(*(change.free for change in changes))
