"""Readings of a sensor at the times of the rows of a recording.

Between two readings that follow each other, values are interpolated. Where the sensor was silent there are
none: a value that nobody measured would look like "nothing touches". Of a sensor that is slower than the
rows, each reading is used once, since interpolated copies of its noise look like contacts.
"""

import numpy as np

from contactsense.service.recordings.signals.cleaning import GAP_STEPS

SLOWER = 1.2
"""A sensor whose readings are this many steps of the rows apart is slower than the rows; below that, clocks
only jitter."""

BURSTS = 0.5
"""Readings whose usual step is shorter than this share of that of the rows come in bursts."""
SHORT = 0.02
"""Of those, readings that are no further apart follow each other [s]."""


def readings_at(t: np.ndarray, stamps: np.ndarray, values: np.ndarray) -> np.ndarray:
    """Readings at the times of the rows; NaN where there is none.

    Args:
        t: Times of the rows [s], shape (N,), in any order.
        stamps: Times of the readings in ascending order [s], shape (M,).
        values: The readings, shape (M, k).

    Returns:
        Shape (N, k).
    """
    found = np.full((len(t), values.shape[1]), np.nan)
    if len(stamps) == 0:
        return found
    after = np.searchsorted(stamps, t)
    last = np.minimum(after, len(stamps) - 1)
    exact = stamps[last] == t
    step = _step(stamps)
    longest = max(GAP_STEPS * step, SHORT if step < BURSTS * _step(np.sort(t)) else 0.0)
    between = stamps[last] - stamps[np.maximum(after - 1, 0)] <= longest
    used = exact | (between & (after > 0) & (after < len(stamps)))
    if is_slower(stamps, t):
        used &= _nearest(t, stamps)
    for i in range(values.shape[1]):
        found[used, i] = np.interp(t[used], stamps, values[:, i])
    return found


def is_slower(stamps: np.ndarray, t: np.ndarray) -> bool:
    """Whether readings at `stamps`, shape (M,), come more rarely than rows at `t`, shape (N,) [s]."""
    return len(stamps) > 1 and _step(stamps) > SLOWER * _step(np.sort(t))


def _step(t: np.ndarray) -> float:
    """The usual step of ascending times [s]; 0 where time does not pass."""
    steps = np.diff(t)
    steps = steps[steps > 0.0]
    return float(np.median(steps)) if len(steps) else 0.0


def _nearest(t: np.ndarray, stamps: np.ndarray) -> np.ndarray:
    """Which rows, shape (N,), are the nearest to any of the readings."""
    order = np.argsort(t, kind="stable")
    rows = t[order]
    after = np.clip(np.searchsorted(rows, stamps), 1, max(len(rows) - 1, 1))
    last = np.minimum(after, len(rows) - 1)
    nearest = np.where(stamps - rows[after - 1] <= rows[last] - stamps, after - 1, last)
    found = np.zeros(len(t), dtype=bool)
    found[order[nearest]] = True
    return found
