"""A part of a recording, and what comes after it for as long as a contact of the part lasts."""

from collections.abc import Iterator
from dataclasses import replace
from itertools import pairwise

import numpy as np

from contactsense.runtime.block_runner import MAX_BLOCK
from contactsense.service.recordings import Recording, RecordingFile

HANDOVER = 1.0
"""A contact that begins within this time after the own rows is kept, too: the neighbouring part, whose
estimates differ slightly, may see it begin before, and does not keep it then [s]."""


class FollowedRows:
    """The samples of a recording from a row on, as long as they are needed: to the end of the part's own
    rows, and then until the contacts that began in them have ended.

    Blocks are read one after the other, so that memory does not depend on how long a contact lasts.

    Args:
        file: The recording.
        begin: Row at which reading starts: before the own rows, so that observers and biases settle.
        first, last: The own rows: from `first` up to, but not including, `last`; None: to the end.
    """

    def __init__(self, file: RecordingFile, begin: int, first: int, last: int | None) -> None:
        self.name = file.name
        self._file, self._begin, self._first, self._last = file, begin, first, last
        self._newest = 0.0  # time of the newest of the own rows, or of those after them [s]
        self._after = 0.0  # time since the last of the own rows [s]
        self._until: int | None = None  # row with which the handover has ended
        self._is_done = False
        self._times: list[np.ndarray] = []

    def blocks(self) -> Iterator[Recording]:
        """The samples; no block has own rows and others. Those without samples carry the problems, some of
        which are known only when reading ends."""
        for part in self._file.blocks(first=self._begin, enough=lambda: self._is_done):
            yield part[:0]
            borders = [self._first] if self._last is None else [self._first, self._last]
            cuts = np.searchsorted(part.rows, borders).tolist()
            for first, last in pairwise(sorted({*range(0, len(part), MAX_BLOCK), *cuts, len(part)})):
                if not self._is_done:
                    yield replace(part[first:last], problems=())

    def has(self, row: int) -> bool:
        """Whether a row is one of the own rows."""
        return self._first <= row and (self._last is None or row < self._last)

    def keeps(self, row: int) -> bool:
        """Whether a contact that begins in this row is one of the part's."""
        return self._first <= row and (self._until is None or row < self._until)

    def pass_block(self, rows: np.ndarray, t: np.ndarray) -> None:
        """Take note of samples before their contacts are asked for.

        Args:
            rows: Their rows, shape (N,), N at least 1.
            t: Their times [s], shape (N,).
        """
        if self.has(int(rows[0])):
            self._times.append(t)
        elif self._last is not None and rows[-1] >= self._last and self._until is None:
            # A clock that was set back must not decide which contacts are the part's own.
            step = np.maximum(np.diff(t, prepend=self._newest), 0.0)
            passed = self._after + np.cumsum(step)
            self._after = float(passed[-1])
            if self._after >= HANDOVER:
                self._until = int(rows[np.searchsorted(passed, HANDOVER)])
        self._newest = float(t[-1])

    @property
    def times(self) -> np.ndarray:
        """Times of the own samples that have been passed, shape (N,) [s]."""
        return np.concatenate([np.empty(0), *self._times])

    def end_unless(self, contact: int | None) -> None:
        """End reading, if the own rows and the handover are over, unless a contact of the part is active.

        Args:
            contact: Row in which the active contact began; None without one.
        """
        if self._until is not None and (contact is None or not self.keeps(contact)):
            self._is_done = True
