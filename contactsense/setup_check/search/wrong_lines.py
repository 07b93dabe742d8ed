"""The search for the wrong lines of a scene.

Every hypothesis changes one line and is fitted with all nuisances. The best of them is accepted if the
evidence for it is strong and its change matters; the search then continues from the corrected setup, as
several lines may be wrong. Two lines or more are exchanged for others, see
`contactsense.setup_check.search.explanation`; where one line or none leaves residuals far beyond the noise,
pairs are tried.
"""

from collections.abc import Callable
from dataclasses import dataclass
from itertools import takewhile

from contactsense.setup_check.fit.fitter import Fit, Fitter
from contactsense.setup_check.hypotheses.all_hypotheses import Hypotheses
from contactsense.setup_check.hypotheses.hypothesis import Hypothesis
from contactsense.setup_check.lines import TOOL, TOOL_COM, TOOL_MASS, Line
from contactsense.setup_check.search.candidate import Candidate
from contactsense.setup_check.search.change import Change
from contactsense.setup_check.search.changes import matters
from contactsense.setup_check.search.explanation import (
    EXCLUDED,
    Explanation,
    change_of,
    changes_of,
    exchanged,
    needed,
    pairs,
)
from contactsense.setup_check.search.stated_fields import by_stated_fields
from contactsense.setup_check.setup import Setup

_MOST = 3
"""Largest number of changes."""
_ROUNDS = 5
"""Rounds of the search; more than changes, since an exchange may leave one out."""
_FIRSTS, _MORE_FIRSTS = 3, 6
"""Lines from which pairs are tried, besides two that were found one by one; and where nothing else explains.
"""
_FAR = 30.0
"""Residuals are far beyond the noise if that of a channel exceeds the scene's noise by this factor: those of
the motor currents of a real arm and a right scene exceed it by up to 28. This is for the time: with 9,
`contactsense bench setup` reports no line of a right scene either."""


@dataclass(frozen=True)
class Found:
    """What the search has found."""

    explanation: Explanation | None
    """None: no line is wrong."""
    now: Fit
    """The setup with all changes."""
    candidates: list[Candidate]
    """All single changes of it."""


def searched(fitter: Fitter, hypotheses: Hypotheses, stated: Setup, progress: Callable[[str], None]) -> Found:
    """Find the wrong lines of the stated setup; `progress`: called with the name of each round."""
    setup, found, paired = stated, None, False
    firsts: list[Change] = []
    for number in range(_ROUNDS):
        progress(f"round {number + 1}")
        fitter.effective[:] = 1.0
        now = fitter.fit(setup)
        # As in `contactsense.setup_check.search.explanation`, where something else is wrong already.
        tried = [h for h in hypotheses.of(setup) if not (found is not None and h.absorbed)]
        candidates = [
            Candidate.of(fitter, h) for h in tried if h.second_line is None or _promises(fitter, h, now)
        ]
        if number == 0:
            # What a second wrong line leaves is correlated, so that few rows would count as independent, and
            # the first of two lines would hardly differ from those that explain nothing.
            others = [c for c in candidates if not (c.hypothesis.absorbed or c.hypothesis.second_line)]
            firsts = _by_line(sorted(others, key=lambda c: fitter.cost(c.fit)), setup)
        fitter.set_effective_rows(min([now, *(c.fit for c in candidates)], key=fitter.cost).residual)
        changes = found.changes if found is not None else ()
        left = _MOST - len(changes)
        ranked = sorted(candidates, key=lambda c: _cost(fitter, c))
        best = next((c for c in ranked if _fits_in(left, c, now)), None)
        if best is not None and best.hypothesis.absorbed:
            best = _load_or_tool(ranked, best, now)
        if left <= 0 or number == _ROUNDS - 1:
            break
        if best is not None and fitter.cost(now) - fitter.cost(best.fit) >= _needed(best.hypothesis):
            more = changes_of(best, setup)
            together = (*changes, *more)
            pair = None
            if found is None and best.hypothesis.absorbed:
                # Beside another arm and a forgotten tool, a load far beyond what a link carries explains most
                # alone, and leaves residuals that are not conspicuous.
                paired = True
                pair = _pair(fitter, hypotheses, stated, _seeds(firsts, (), _MORE_FIRSTS), best.fit)
            if pair is not None:
                found = pair
            elif len(together) == 1:
                line = best.hypothesis.line
                found = Explanation(
                    together, best.fit, {line: now}, {line: _rivals(fitter, ranked, best, now)}
                )
            else:
                known = tuple(change.line for change in together)
                seeds = () if paired else _seeds(firsts, known, _FIRSTS)
                found, paired = exchanged(fitter, hypotheses, stated, together, seeds), True
        elif not paired and _far(fitter, now):
            paired = True
            pair = _pair(fitter, hypotheses, stated, _seeds(firsts, (), _MORE_FIRSTS), now)
            if pair is None:
                break
            found = pair
        else:
            break
        found = by_stated_fields(fitter, stated, found)
        setup = found.fit.setup
    return Found(found, now, candidates)


def _pair(
    fitter: Fitter, hypotheses: Hypotheses, stated: Setup, firsts: tuple[Change, ...], now: Fit
) -> Explanation | None:
    """Two lines that explain what `now`, with one change or none, does not; None: there are none.

    There are none where they are better than `now` by less than they need together, or where residuals far
    beyond the noise remain.
    """
    effective = fitter.effective.copy()
    fitter.effective[:] = 1.0
    options = pairs(fitter, hypotheses, stated, firsts)
    if options:
        best = min(options, key=lambda option: fitter.cost(option.fit))
        fitter.set_effective_rows(best.fit.residual)
        gain = fitter.cost(now) - fitter.cost(best.fit)
        if not _far(fitter, best.fit) and gain >= sum(map(needed, best.lines)):
            return exchanged(fitter, hypotheses, stated, best.changes)
    fitter.effective[:] = effective
    return None


def _promises(fitter: Fitter, hypothesis: Hypothesis, now: Fit) -> bool:
    """Whether a hypothesis of two lines may lower the cost by what both need, as far as first Gauss-Newton
    steps tell: fits from all starts would take far longer."""
    limit = fitter.cost(now) - _needed(hypothesis)
    return any(fitter.predicted_cost(start, hypothesis.free) <= limit for _, start in hypothesis.starts)


def _needed(hypothesis: Hypothesis) -> float:
    """By how much the lines of a hypothesis must lower the cost, beyond the penalty."""
    second = hypothesis.second_line
    return needed(hypothesis.line) + (needed(second.line) if second is not None else 0.0)


def _cost(fitter: Fitter, candidate: Candidate) -> float:
    """By what a candidate is ranked: a second line must lower the cost by what is needed for one."""
    hypothesis = candidate.hypothesis
    return fitter.cost(candidate.fit) + _needed(hypothesis) - needed(hypothesis.line)


def _fits_in(left: int, candidate: Candidate, now: Fit) -> bool:
    """Whether a candidate changes no more lines than are left, by more than the tolerances, and explains."""
    lines = 1 if candidate.hypothesis.second_line is None else 2
    return lines <= left and matters(now.setup, candidate.fit) and candidate.explains(now)


def _load_or_tool(ranked: list[Candidate], load: Candidate, now: Fit) -> Candidate:
    """The load on a link, or the tool if that explains more: the prior takes up a part of either, so that no
    residual need fall where a push fills them."""
    tools = (
        c
        for c in takewhile(lambda c: c is not load, ranked)
        if c.hypothesis.line in (TOOL, TOOL_MASS, TOOL_COM) and matters(now.setup, c.fit)
    )
    return next(tools, load)


def _far(fitter: Fitter, fit: Fit) -> bool:
    """Whether residuals are far beyond the noise."""
    return bool((fit.rms > _FAR * fitter.noise).any())


def _seeds(firsts: list[Change], known: tuple[Line, ...], count: int) -> tuple[Change, ...]:
    return tuple([first for first in firsts if first.line not in known][:count])


def _by_line(ranked: list[Candidate], setup: Setup) -> list[Change]:
    """What the best candidate of each line that matters changes of the setup; `ranked`: the best first."""
    best: dict[Line, Candidate] = {}
    for candidate in ranked:
        if matters(setup, candidate.fit):
            best.setdefault(candidate.hypothesis.line, candidate)
    return [change_of(candidate, setup) for candidate in best.values()]


def _rivals(fitter: Fitter, ranked: list[Candidate], best: Candidate, now: Fit) -> tuple[Line, ...]:
    """Other lines whose change would explain about as much as the best."""
    return tuple(
        dict.fromkeys(
            c.hypothesis.line
            for c in ranked
            if c.hypothesis.second_line is None
            and c.hypothesis.line != best.hypothesis.line
            and fitter.cost(c.fit) - fitter.cost(best.fit) < EXCLUDED
            and matters(now.setup, c.fit)
        )
    )
