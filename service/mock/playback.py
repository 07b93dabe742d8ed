"""Data of the mock servers: a recorded motion, and the common clock that determines which sample is due."""

import time
from typing import Protocol

import numpy as np

NS = 1_000_000_000


class Feed(Protocol):
    """Readings of a simulated arm over one run, N samples, 6 joints; implemented by
    `contactsense.service.mock.arm.simulated_arm.Motion`."""

    @property
    def rate(self) -> float:
        """Samples per second [Hz]."""

    @property
    def t(self) -> np.ndarray:
        """Time [s], shape (N,)."""

    @property
    def q(self) -> np.ndarray:
        """Joint positions [rad], shape (N, 6)."""

    @property
    def qd(self) -> np.ndarray:
        """Joint velocities [rad/s], shape (N, 6)."""

    @property
    def joint_torque(self) -> np.ndarray:
        """Torques that the actuators apply [Nm], shape (N, 6)."""

    @property
    def base_wrench(self) -> np.ndarray:
        """Wrench of the arm on the sensor below it, base origin and axes [N, Nm], shape (N, 6)."""


class SimClock:
    """Simulated time: runs with the host's monotonic clock from a start time, the same for all servers.

    Args:
        start_ns: Host time at which simulated time is 0; default: now.
    """

    def __init__(self, start_ns: int | None = None) -> None:
        self.start_ns = time.monotonic_ns() if start_ns is None else start_ns

    def start(self) -> None:
        """Simulated time is 0 now: for a clock whose start lies ahead."""
        self.start_ns = time.monotonic_ns()

    def now(self) -> float:
        """Simulated time [s]."""
        return (time.monotonic_ns() - self.start_ns) / NS

    def deadline_ns(self, t: float) -> int:
        """Host time at which simulated time is `t` [ns]."""
        return self.start_ns + round(t * NS)

    @staticmethod
    def sleep_until(deadline_ns: int) -> None:
        """Sleep until an absolute host time; returns at once if it has passed."""
        remaining = deadline_ns - time.monotonic_ns()
        if remaining > 0:
            time.sleep(remaining / NS)


class Playback:
    """Determines which sample of a feed is due at a simulated time. After the end, the last sample stays or
    the feed repeats.

    Args:
        feed: The motion.
        loop: Whether to repeat the feed after its end; time stamps continue to increase.
    """

    def __init__(self, feed: Feed, *, loop: bool = False) -> None:
        self._rate = feed.rate
        self._n = len(feed.t)
        self._loop = loop

    def position(self, t: float) -> float:
        """Fractional number of the sample due at simulated time `t`."""
        position = max(0.0, t * self._rate)
        return position % self._n if self._loop else min(position, self._n - 1.0)

    def index(self, t: float) -> int:
        """Number of the sample nearest to simulated time `t`."""
        return min(round(self.position(t)), self._n - 1)


class PlaybackWrench:
    """Readings of a sensor under the base over a recorded motion, interpolated between samples.

    Args:
        feed: The motion.
        playback: Determines which sample is due.
        to_sensor: Sensor's reading = `to_sensor` @ base wrench, shape (6, 6); default: identity.
    """

    def __init__(self, feed: Feed, playback: Playback, to_sensor: np.ndarray | None = None) -> None:
        matrix = np.eye(6) if to_sensor is None else np.asarray(to_sensor, dtype=float)
        self._readings = np.asarray(feed.base_wrench, dtype=float) @ matrix.T
        self._playback = playback

    def __call__(self, t: float) -> np.ndarray:
        """Reading at simulated time t [s], shape (6,) [N, Nm]."""
        position = self._playback.position(t)
        before = min(int(position), len(self._readings) - 1)
        after = min(before + 1, len(self._readings) - 1)
        first, second = self._readings[before], self._readings[after]
        return np.asarray(first + (position - before) * (second - first))
