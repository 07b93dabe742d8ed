"""Bookkeeping of one sensor in a live stream: since when it runs, how long it has been silent."""

HOLD = 0.05
"""A sensor that has been silent for longer than this counts as missing, and its observer starts anew [s]."""
MISSED = 6.0
"""The same in steps of the sensor, where these are so long that this is more."""
_LATELY = 0.1
"""Share of the newest step in the usual one."""


class Feed:
    """Says for each sample how far the sensor's observer must step, and whether its residual can be used."""

    def __init__(self, settle: float) -> None:
        """A sensor that has said nothing yet; `settle`: time from a start until its residual is used [s]."""
        self._settle = settle
        self._since = 0.0
        self._last: float | None = None
        self._usual = 0.0

    @property
    def hold(self) -> float:
        """Silence after which the sensor counts as missing [s]."""
        return max(HOLD, MISSED * self._usual)

    def step(self, t: float, present: bool) -> float:
        """Time since the sensor's last value [s]; 0: start anew; negative: no value in the sample at time
        t."""
        if not present:
            return -1.0
        last, self._last = self._last, t
        if last is None or not 0.0 < t - last <= self.hold:
            self._since = t
            return 0.0
        step = t - last
        self._usual += (_LATELY if self._usual > 0.0 else 1.0) * (step - self._usual)
        return step

    def ready(self, t: float) -> bool:
        """Whether the residual at time t can be used: the sensor is neither silent nor just started."""
        return self._last is not None and t - self._last <= self.hold and t - self._since >= self._settle

    def silent(self, t: float) -> bool:
        """Whether nothing usable has come from the sensor for longer than `hold`."""
        return self._last is None or t - self._last > self.hold
