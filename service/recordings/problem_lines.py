"""Problems of a recording as text: one line for each kind, however often it occurs."""

from collections import Counter
from collections.abc import Iterable

from contactsense.service.recordings.problems import Problem

NAMED = 3
"""Number of places that a line names; the others are counted."""
_MEASURED = ("gap", "clock_set_back", "bad_row", "held", "velocities")
"""Kinds whose messages contain what was measured or the cell itself, so that each reads differently."""
_ABOUT = {"bad_row": ":", "held": " ", "velocities": ":"}
"""Of those that are about a column or a sensor: what stands behind its name, where the message begins."""


def problem_lines(problems: Iterable[Problem]) -> tuple[str, ...]:
    """One line for each kind of problem, in the order in which they first occur: first rows, number of
    places, message."""
    groups: dict[tuple[str, str], list[Problem]] = {}
    for problem in _named_once(tuple(problems)):
        mark = _ABOUT.get(problem.kind)
        about = problem.message.split(mark)[0] if mark else ""
        key = (problem.kind, about if problem.kind in _MEASURED else problem.message)
        groups.setdefault(key, []).append(problem)
    return tuple(map(_line, groups.values()))


def _named_once(problems: tuple[Problem, ...]) -> list[Problem]:
    """Without missing values that are only what a cell that is no number left behind."""
    bad = {(p.row_from, p.row_to) for p in problems if p.kind == "bad_row"}
    missing = Counter((p.row_from, p.row_to) for p in problems if p.kind == "not_finite")
    # Of two signals that are missing in the same rows, one is missing for another reason: both stay.
    left_behind = {rows for rows in bad if missing[rows] == 1}
    return [p for p in problems if p.kind != "not_finite" or (p.row_from, p.row_to) not in left_behind]


def _line(group: list[Problem]) -> str:
    if len(group) == 1:
        return str(group[0])
    places = ", ".join(problem.rows for problem in group[:NAMED])
    more = f" and {len(group) - NAMED} more" if len(group) > NAMED else ""
    listed = f"rows {places}{more} ({len(group)} places)"
    advice = "; are the rows in the order of time?" if group[0].kind == "clock_set_back" else ""
    if len({problem.message for problem in group}) == 1:
        return f"{listed}: {group[0].message}{advice}"
    worst = max(group, key=lambda problem: problem.size)
    rows = "row" if worst.row_to - 1 <= worst.row_from else "rows"
    which = f"the largest, {rows} {worst.rows}" if worst.size > 0.0 else "the first"
    return f"{listed}; {which}: {worst.message}{advice}"
