"""Bookkeeping of the sensors in a live stream: since when each runs, how long it has been silent.

A feed is a row of numbers: when it started, its last value, both [s], and its usual step [s].
"""

import math

import numpy as np

from robots.compiled import kernel

HOLD = 0.05
"""A sensor that has been silent for longer than this counts as missing, and its observer starts anew [s]."""
MISSED = 6.0
"""The same in steps of the sensor, where these are so long that this is more."""
SINCE, LAST, USUAL = 0, 1, 2
"""Places in a feed."""
_LATELY = 0.1
"""Share of the newest step in the usual one."""


@kernel
def silence(feeds: np.ndarray) -> None:
    """Feeds that have said nothing yet, shape (N, 3)."""
    feeds[:] = 0.0
    feeds[:, LAST] = -math.inf


@kernel
def _hold(feed: np.ndarray) -> float:
    """Silence after which the sensor counts as missing [s]."""
    return float(max(HOLD, MISSED * feed[USUAL]))


@kernel
def proceed(feed: np.ndarray, t: float, present: bool) -> float:
    """Time since the sensor's last value [s]; 0: start anew; negative: no value in the sample at time t."""
    if not present:
        return -1.0
    step = t - feed[LAST]
    feed[LAST] = t
    if not 0.0 < step <= _hold(feed):
        feed[SINCE] = t
        return 0.0
    feed[USUAL] += (_LATELY if feed[USUAL] > 0.0 else 1.0) * (step - feed[USUAL])
    return float(step)


@kernel
def silent(feed: np.ndarray, t: float) -> bool:
    """Whether nothing usable has come from the sensor for longer than it may be silent."""
    return bool(t - feed[LAST] > _hold(feed))


@kernel
def settled(feed: np.ndarray, t: float, settle: float) -> bool:
    """Whether the residual at time t can be used: the sensor is neither silent nor just started; `settle`:
    time from a start until then [s]. What counts is up to when it has spoken: after one word its residual is
    zero, and says nothing, however long ago that was."""
    return not silent(feed, t) and feed[LAST] - feed[SINCE] >= settle
