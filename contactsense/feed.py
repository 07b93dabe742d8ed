"""Bookkeeping of one sensor in a live stream: since when it runs, how long it has been silent."""

HOLD = 0.05
"""A sensor that has been silent for longer than this counts as missing, and its observer starts anew [s]."""


class Feed:
    """Says for each sample how far the sensor's observer must step, and whether its residual can be used."""

    def __init__(self, settle: float) -> None:
        """A sensor that has said nothing yet; `settle`: time from a start until its residual is used [s]."""
        self._settle = settle
        self._since = 0.0
        self._last: float | None = None

    def step(self, t: float, present: bool) -> float:
        """Time since the sensor's last value [s]; 0: start anew; negative: no value in the sample at time
        t."""
        if not present:
            return -1.0
        last, self._last = self._last, t
        if last is None or not 0.0 < t - last <= HOLD:
            self._since = t
            return 0.0
        return t - last

    def ready(self, t: float) -> bool:
        """Whether the residual at time t can be used: the sensor is neither silent nor just started."""
        return self._last is not None and t - self._last <= HOLD and t - self._since >= self._settle

    def silent(self, t: float) -> bool:
        """Whether nothing usable has come from the sensor for longer than `HOLD`."""
        return self._last is None or t - self._last > HOLD
