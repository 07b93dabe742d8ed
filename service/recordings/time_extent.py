"""How much time the samples of a recording span, block by block."""

import math
from dataclasses import dataclass

import numpy as np

UNORDERED = 0.1
"""If more than this share of the samples is earlier than the one before, they are not in the order of time:
no clock is set back so often."""


UNORDERED_ADVICE = "Sort them, or name another column with --columns timestamp=NAME"
"""What to do with such a recording."""


@dataclass
class TimeExtent:
    """The times that have been added so far, none of which is NaN."""

    samples: int = 0
    """Number of samples."""
    backwards: int = 0
    """Number of samples that are earlier than the one before."""
    _first: float = 0.0
    _forwards: float = 0.0
    _last: float = math.nan
    _earliest: float = math.inf
    _latest: float = -math.inf

    def add(self, t: np.ndarray) -> None:
        """Add samples; t: their times [s], shape (N,)."""
        if len(t) == 0:
            return
        if self.samples == 0:
            self._first = self._last = float(t[0])
        step = np.diff(t, prepend=self._last)
        self._forwards += float(step[step > 0.0].sum())
        self.backwards += int((step < 0.0).sum())
        self._earliest, self._latest = min(self._earliest, float(t.min())), max(self._latest, float(t.max()))
        self.samples, self._last = self.samples + len(t), float(t[-1])

    @property
    def is_ordered(self) -> bool:
        """Whether the samples are in the order of time, apart from a clock that was set back."""
        return self.backwards <= UNORDERED * self.samples

    @property
    def start(self) -> float:
        """Time of the first sample, of samples in no order that of the earliest [s]."""
        return self._first if self.is_ordered else self._earliest

    @property
    def seconds(self) -> float:
        """Time from the first to the last sample, including sections before a clock was set back [s]. Of
        samples that are not in the order of time, from the earliest to the latest."""
        if self.is_ordered:
            return self._forwards
        return self._latest - self._earliest
