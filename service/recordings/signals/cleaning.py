"""Checks of the time order: repeated rows are dropped; gaps, clock resets and missing values are reported by
row."""

import math

import numpy as np

from contactsense.service.recordings.problems import Kind, Problem

GAP_STEPS = 5.0
"""A time step longer than this many typical steps is a gap."""
LATEST = 1e20
"""Time stamps beyond this [s] count as not finite: they are no times in any unit, and differences to others
overflow."""
FIRST_STEPS = 50
"""The typical step is the median of this many steps at the start."""


class RowChecker:
    """Checks the time stamps of a recording, block by block."""

    def __init__(self) -> None:
        """Start without any block."""
        self.problems: list[Problem] = []
        self.repeated = 0
        """Number of rows dropped because they repeat the time stamp of the previous row."""
        self._last = -math.inf
        self._usual: float | None = None
        self._first: list[tuple[np.ndarray, np.ndarray]] = []

    def keep(self, t: np.ndarray, first_row: int) -> np.ndarray:
        """Which rows are kept, shape (N,), bool.

        Args:
            t: Times of the block [s], shape (N,).
            first_row: Number of its first row in the file.
        """
        finite = np.abs(t) < LATEST
        self.report(~finite, first_row, "not_finite", "timestamp is not a finite number; row ignored")
        step = np.diff(t[finite], prepend=self._last)
        repeated = step == 0.0
        self.repeated += int(repeated.sum())
        rows = np.flatnonzero(finite)
        keep: np.ndarray = finite.copy()
        keep[rows[repeated]] = False
        if len(rows):
            self._last = float(t[rows[-1]])
        self.report(
            repeated, first_row, "repeated", "the time of the row before is repeated; row ignored", rows
        )
        for i in np.flatnonzero(step < 0.0):
            row = first_row + int(rows[i])
            message = f"the clock was set back by {-step[i]:.3f} s; a new stretch begins"
            self.problems.append(Problem(row, row + 1, "clock_set_back", message, -float(step[i])))
        if self._usual is None:
            forward = np.flatnonzero((step > 0.0) & np.isfinite(step))
            self._first.append((first_row + rows[forward], step[forward]))
            if sum(len(steps) for _, steps in self._first) >= FIRST_STEPS:
                self._learn()
        else:
            self._find_gaps(first_row + rows, step)
        return keep

    def finish(self) -> None:
        """Finish the check after the last block."""
        if self._usual is None and any(len(steps) for _, steps in self._first):
            self._learn()

    def _learn(self) -> None:
        """Determine the typical step and check the steps so far."""
        self._usual = float(np.median(np.concatenate([steps for _, steps in self._first])[:FIRST_STEPS]))
        for rows, steps in self._first:
            self._find_gaps(rows, steps)
        self._first = []

    def _find_gaps(self, rows: np.ndarray, step: np.ndarray) -> None:
        """Report steps that are too long; `rows`: the row in the file at the end of each step."""
        assert self._usual is not None
        for i in np.flatnonzero((step > GAP_STEPS * self._usual) & np.isfinite(step)):
            message = f"a gap of {step[i]:.3f} s before this row (usual step {self._usual:.4f} s)"
            self.problems.append(Problem(int(rows[i]), int(rows[i]) + 1, "gap", message, float(step[i])))

    def report(
        self, bad: np.ndarray, first_row: int, kind: Kind, message: str, rows: np.ndarray | None = None
    ) -> None:
        """Report runs of bad rows, one problem per run.

        Args:
            bad: Whether each row is bad, shape (N,), bool.
            first_row: Number of the block's first row in the file.
            kind, message: Kind of the problem, and its description.
            rows: Positions of the entries of `bad` in the block; by default, consecutive.
        """
        if not bad.any():
            return
        places = np.flatnonzero(bad) if rows is None else rows[bad]
        breaks = np.flatnonzero(np.diff(places) > 1) + 1
        for run in np.split(places, breaks):
            begin, end = first_row + int(run[0]), first_row + int(run[-1]) + 1
            self.problems.append(Problem(begin, end, kind, message))
