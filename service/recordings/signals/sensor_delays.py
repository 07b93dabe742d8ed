"""Delays of the force/torque sensors taken off a recording: a reading belongs to an instant before its
arrival."""

import itertools
from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from contactsense.sensors.link_values import as_fields
from contactsense.service.recordings.recording import Recording, concatenate
from contactsense.service.recordings.signals.reading_times import is_slower, readings_at
from contactsense.service.recordings.signals.signal_columns import LinkColumns

SLOWEST = 0.15
"""Longest time between two readings of a slow sensor whose delay is taken off without loss [s]."""


class DelayedReadings:
    """Shifts the readings of the force/torque sensors: a reading belongs to the instant one delay of the
    sensor before its arrival.

    Rows wait until the readings for their instant have arrived; as many before them are kept, because a delay
    may be negative. A clock that was set back begins a new stretch, whose readings are its own. They wait for
    `SLOWEST` longer, since a sensor that is slower than the rows has its next reading only then.
    """

    def __init__(self, base_delay: float, links: Mapping[str, LinkColumns]) -> None:
        """`base_delay`: delay of the base sensor [s]; `links`: the link sensors."""
        self._base_delay = base_delay
        self._links = {field: link for field, link in links.items() if link.delay != 0.0}
        longest = max([abs(base_delay), *(abs(link.delay) for link in self._links.values())])
        self._longest = longest + SLOWEST if longest > 0.0 else 0.0
        self._rest: Recording | None = None
        self._taken = 0  # rows of the rest that have been returned

    def add(self, block: Recording) -> Recording:
        """The rows that are now complete."""
        if self._longest == 0.0:
            # The last block waits: problems at the end of the file are known only after it.
            before, self._rest = self._rest, block
            return block[:0] if before is None else before
        whole = block if self._rest is None else concatenate([self._rest, block], block.name, {})
        if len(whole) == 0:
            self._rest = whole
            return whole
        taken, newest = self._taken, _stretches(whole.t)[-1]
        t = whole.t[newest]
        ready = int(np.searchsorted(t, t[-1] - self._longest))
        kept = newest.start + int(np.searchsorted(t, t[ready] - self._longest))
        ready += newest.start
        self._rest, self._taken = whole[kept:], ready - kept
        return self._shifted(whole)[taken:ready]

    def flush(self) -> Recording | None:
        """The remaining rows at the end."""
        return None if self._rest is None else self._shifted(self._rest)[self._taken :]

    def _shifted(self, part: Recording) -> Recording:
        if len(part) == 0:
            return part
        if self._base_delay != 0.0 and part.base_wrench is not None:
            part = replace(part, base_wrench=_earlier(part.t, part.base_wrench, self._base_delay))
        values = {}
        for field, link in self._links.items():
            reading = link.frame.readings(part.q, part.link_values[field])
            values[field] = link.frame.wrenches(part.q, _earlier(part.t, reading, link.delay))
        if not values:
            return part
        links = as_fields(part.link_values | values)
        return replace(part, wrist_wrench=links["wrist_wrench"], link_wrenches=links["link_wrenches"] or {})


def _earlier(t: np.ndarray, values: np.ndarray, late: float) -> np.ndarray:
    """The values, shape (N, 6), that arrive `late` [s] after each of the times t, shape (N,) [s]."""
    found = np.empty_like(values)
    for rows in _stretches(t):
        there = np.isfinite(values[rows]).all(axis=1)
        stamps = t[rows][there] - late
        if is_slower(stamps, t[rows]):
            found[rows] = readings_at(t[rows], stamps, values[rows][there])
            continue
        for i in range(values.shape[1]):
            found[rows, i] = np.interp(t[rows] + late, t[rows], values[rows, i])
    return found


def _stretches(t: np.ndarray) -> list[slice]:
    """The rows between which the clock is not set back; at least one stretch."""
    ends = [0, *(np.flatnonzero(np.diff(t) < 0.0) + 1).tolist(), len(t)]
    return [slice(first, last) for first, last in itertools.pairwise(ends)]
