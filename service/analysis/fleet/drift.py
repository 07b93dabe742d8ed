"""Changes of each joint's quantities from day to day."""

from collections import defaultdict
from collections.abc import Sequence
from dataclasses import dataclass
from datetime import date
from typing import Any

import numpy as np
from scipy.stats import theilslopes

from contactsense.service.analysis.fleet.segments import UNKNOWN


@dataclass(frozen=True, eq=False)
class Daily:
    """Values of a robot by day, D days, K quantities; NaN on days without a value."""

    dates: tuple[str, ...]
    """The days, in order; `UNKNOWN` is the last one."""
    values: np.ndarray
    """Shape (D, K)."""

    @property
    def drift(self) -> np.ndarray:
        """Change of each quantity from the first day to the last, along the line through the medians of all
        slopes (Theil and Sen); with fewer than three days, the difference. NaN if unknown, shape (K,).
        """
        dated = self.dated
        t = _days(dated.dates)
        return np.array([_drift(t, column) for column in dated.values.T])

    @property
    def dated(self) -> "Daily":
        """Without the recordings of which the date is not known: they are before or after any other."""
        known = [i for i, day in enumerate(self.dates) if day != UNKNOWN]
        return Daily(tuple(self.dates[i] for i in known), self.values[known])


def daily_mean(
    dates: Sequence[str],
    values: Sequence[Sequence[float | None]],
    std: Sequence[Sequence[float | None]],
    count: int = 0,
) -> Daily:
    """Mean of each day, weighted by the inverse variance; None is ignored.

    Args:
        dates: Date of each segment.
        values: K values of each segment.
        std: Their standard deviations.
        count: K, for a robot without any segment.
    """
    weight = 1.0 / np.maximum(_floats(std, count), 1e-9) ** 2
    return _by_day(dates, _floats(values, count), weight)


def daily_median(dates: Sequence[str], values: Sequence[Sequence[float | None]], count: int = 0) -> Daily:
    """Median of each day, with the arguments of `daily_mean`."""
    return _by_day(dates, _floats(values, count), None)


def _by_day(dates: Sequence[str], values: np.ndarray, weight: np.ndarray | None) -> Daily:
    rows: dict[str, list[int]] = defaultdict(list)
    for i, day in enumerate(dates):
        rows[day].append(i)
    days = sorted(rows, key=lambda day: (day == UNKNOWN, day))
    found = np.full((len(days), values.shape[1]), np.nan)
    for i, day in enumerate(days):
        for k in range(values.shape[1]):
            column = values[rows[day], k]
            known = np.isfinite(column)
            if not known.any():
                continue
            if weight is None:
                found[i, k] = np.median(column[known])
            else:
                found[i, k] = np.average(column[known], weights=weight[rows[day], k][known])
    return Daily(tuple(days), found)


def _floats(rows: Sequence[Sequence[Any]], count: int) -> np.ndarray:
    if not rows:
        return np.empty((0, count))
    return np.array([[np.nan if x is None else float(x) for x in row] for row in rows])


def _days(dates: Sequence[str]) -> np.ndarray:
    """Days since the first; positions in the order if dates are not of the form YYYY-MM-DD."""
    try:
        days = [date.fromisoformat(text).toordinal() for text in dates]
    except ValueError:
        days = list(range(len(dates)))
    return np.array(days, dtype=np.float64) - (days[0] if days else 0)


def _drift(t: np.ndarray, values: np.ndarray) -> float:
    known = np.isfinite(values)
    t, values = t[known], values[known]
    if len(t) < 2:
        return float("nan")
    if len(t) < 3:
        return float(values[-1] - values[0])
    return float(theilslopes(values, t).slope * (t[-1] - t[0]))
