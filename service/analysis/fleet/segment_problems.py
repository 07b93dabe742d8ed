"""Problems of a recording that is analysed in segments: those of all segments together, each once."""

from collections.abc import Iterable
from dataclasses import asdict, replace
from typing import Any

from contactsense.service.recordings.problem_lines import problem_lines
from contactsense.service.recordings.problems import Problem

_OF_ONE_ROW = ("gap", "clock_set_back", "bad_row")
"""Kinds of which two that follow each other are two."""


def own_problems(problems: Iterable[Problem], first: int, last: int | None) -> list[dict[str, Any]]:
    """What a segment's result keeps of the problems: those in its own rows, as the rows before and after them
    are read with a neighbouring segment, too.

    Args:
        problems: Problems found in all rows that were read.
        first, last: The segment's own rows: from `first` up to, but not including, `last`; None: to the end.
    """
    found = []
    for problem in problems:
        begin = max(problem.row_from, first)
        end = problem.row_to if last is None else min(problem.row_to, last)
        if problem.row_to <= problem.row_from:  # of the file as a whole, or of its end
            found.append(problem)
        elif begin < end:
            found.append(replace(problem, row_from=begin, row_to=end))
    return [asdict(problem) for problem in found]


class RecordingProblems:
    """Problems and complaints of the segments of one recording, in the order of its rows."""

    def __init__(self) -> None:
        """Start without any segment."""
        self._problems: list[Problem] = []
        self._latest: dict[tuple[str, str], int] = {}  # place of the latest of each kind and message
        self._complaints: dict[str, str] = {}  # by field: the values differ from segment to segment

    def add(self, result: dict[str, Any]) -> None:
        """Take in the result of the next segment, see
        `contactsense.service.analysis.fleet.segment_task.run_segment`."""
        for fields in result["problems"]:
            problem = Problem(**fields)
            key = (problem.kind, problem.message)
            at = self._latest.get(key)
            if at is not None and _goes_on(self._problems[at], problem):
                self._problems[at] = replace(self._problems[at], row_to=problem.row_to)
            else:
                self._latest[key] = len(self._problems)
                self._problems.append(problem)
        for text in result["complaints"]:
            self._complaints.setdefault(text.partition(":")[0], text)

    def lines(self) -> tuple[str, ...]:
        """One sentence for each kind of problem, and the first complaint about each field."""
        return (*problem_lines(self._problems), *self._complaints.values())


def _goes_on(before: Problem, problem: Problem) -> bool:
    """Whether a problem of the same kind and message goes on where the one before ends, or is of the file as
    a whole, as that one."""
    if problem.row_to <= problem.row_from:
        return before.rows == problem.rows
    return before.row_to == problem.row_from and problem.kind not in _OF_ONE_ROW
