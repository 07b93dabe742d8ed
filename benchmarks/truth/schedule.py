"""When the arm is touched in a run: single contacts one after the other, or pairs that overlap in time."""

from typing import NamedTuple

import numpy as np

from .arrays import RATE

TYPES = ("hold", "slide", "impact")
HOLD, SLIDE, IMPACT = range(3)
_FIRST = 1.0
"""No contact before this time of a run [s]."""
_LAST = 0.2
"""Nor in the last of it [s]."""
_PAUSE = 0.3
"""Between contacts that do not overlap, at least [s]."""
_DURATIONS = (0.3, 3.0)
"""Of holds and slides, log-uniform [s]."""
_PAIRED = (0.6, 2.0)
"""The same in pairs, uniform [s]."""
_OVERLAP = 0.3
"""Time that both contacts of a pair last together, at least [s], impacts excepted."""
_STRIKE = 0.05
"""Duration of an impact [s]."""


class Planned(NamedTuple):
    """One contact of a run."""

    start: int
    """Its first sample."""
    stop: int
    """The one after its last."""
    type: int
    """Index in `TYPES`."""
    slot: int
    """0, or 1 for the second contact of a pair."""


def singles(samples: int, rng: np.random.Generator) -> list[Planned]:
    """Four to six contacts, at least one slide and one impact.

    Args:
        samples: Of the run.
        rng: Random numbers.
    """
    count = int(rng.integers(4, 7))
    types = rng.permutation([SLIDE, IMPACT, *rng.integers(0, 3, count - 2)])
    while True:
        lengths = [_ticks(_STRIKE if type_ == IMPACT else _log_uniform(rng)) for type_ in types]
        starts = _spread(lengths, samples, rng)
        if starts is not None:
            return [
                Planned(start, start + length, int(type_), 0)
                for start, length, type_ in zip(starts, lengths, types, strict=True)
            ]


def pairs(samples: int, rng: np.random.Generator) -> list[Planned]:
    """Two or three pairs; the second contact begins while the first one lasts.

    Args:
        samples: Of the run.
        rng: Random numbers.
    """
    count = int(rng.integers(2, 4))
    while True:
        drawn = [_pair(rng) for _ in range(count)]
        starts = _spread([max(one.stop for one in pair) for pair in drawn], samples, rng)
        if starts is not None:
            return [
                one._replace(start=one.start + start, stop=one.stop + start)
                for start, pair in zip(starts, drawn, strict=True)
                for one in pair
            ]


def _pair(rng: np.random.Generator) -> tuple[Planned, Planned]:
    first = _ticks(rng.uniform(*_PAIRED))
    type_ = int(rng.integers(0, 3))
    length = _ticks(_STRIKE if type_ == IMPACT else rng.uniform(*_PAIRED))
    start = int(rng.integers(1, first - min(length, _ticks(_OVERLAP)) + 1))
    return Planned(0, first, int(rng.choice((HOLD, SLIDE))), 0), Planned(start, start + length, type_, 1)


def _spread(lengths: list[int], samples: int, rng: np.random.Generator) -> list[int] | None:
    """Random first samples of intervals in the given order; None if they do not fit into the run."""
    pause = _ticks(_PAUSE)
    first, last = _ticks(_FIRST), samples - _ticks(_LAST)
    spare = last - first - sum(lengths) - pause * (len(lengths) - 1)
    if spare < 0:
        return None
    before = np.concatenate(([0], np.cumsum([length + pause for length in lengths])))[:-1]
    return [int(s) for s in first + before + np.sort(rng.integers(0, spare + 1, len(lengths)))]


def _log_uniform(rng: np.random.Generator) -> float:
    return float(np.exp(rng.uniform(*np.log(_DURATIONS))))


def _ticks(seconds: float) -> int:
    return round(seconds * RATE)
