"""The clock of a playback: runs, pauses, jumps, at any speed."""

import threading

SPEEDS = (0.1, 0.25, 0.5, 1.0, 2.0, 5.0, 10.0)
"""Speeds that can be chosen."""


class PlaybackClock:
    """Time in a recording as a function of the time that has passed; wraps nowhere, stops at the end."""

    def __init__(self, duration: float) -> None:
        """`duration` of the recording [s]; the clock is at its beginning and stands."""
        self._duration = duration
        self._at = 0.0
        self._since: float | None = None
        self._speed = 1.0
        self._lock = threading.Lock()

    def time(self, now: float) -> float:
        """Time in the recording [s] at `now` [s] on any clock that does not go back."""
        with self._lock:
            return self._time(now)

    def running(self, now: float) -> bool:
        """Whether it runs: it was started and has not reached the end."""
        with self._lock:
            return self._since is not None and self._time(now) < self._duration

    def start(self, now: float) -> None:
        """Run; from the beginning if it stands at the end."""
        with self._lock:
            at = self._time(now)
            self._at, self._since = (0.0 if at >= self._duration else at), now

    def stop(self, now: float) -> None:
        """Stand."""
        with self._lock:
            self._at, self._since = self._time(now), None

    def jump(self, time: float, now: float) -> None:
        """Go to a time [s] in the recording; it runs on if it ran."""
        with self._lock:
            ran = self._since is not None and self._time(now) < self._duration
            self._at = min(max(time, 0.0), self._duration)
            self._since = now if ran else None

    def set_speed(self, speed: float, now: float) -> None:
        """Run this many times as fast as the arm did."""
        with self._lock:
            self._at, self._speed = self._time(now), speed
            self._since = None if self._since is None else now

    def _time(self, now: float) -> float:
        passed = 0.0 if self._since is None else (now - self._since) * self._speed
        return min(self._at + passed, self._duration)
