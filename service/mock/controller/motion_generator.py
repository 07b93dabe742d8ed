"""Target motion of the simulated controller: along the script's trajectory, to a posture, or to a stop."""

from bisect import bisect_right
from typing import Protocol

import numpy as np

from contactsense.service.mock.arm.script import Trajectory

TIME_SCALING = 4.0
"""Rate at which the speed fraction follows the slider, a pause or a resumption [1/s]."""
APPROACH_SPEED = 0.8
"""Joint speed during the return to the trajectory [rad/s]."""
APPROACH_ACCELERATION = 2.0
"""Joint acceleration during the return to the trajectory [rad/s^2]."""


class _Motion(Protocol):
    done: bool

    def step(self, dt: float) -> np.ndarray:
        """Advance by `dt` [s]; returns target positions, velocities and accelerations, shape (3, n)."""


class Path:
    """A trajectory as a function of its own time."""

    def __init__(self, trajectory: Trajectory) -> None:
        postures = [np.array(trajectory.start, dtype=float)]
        spans, begins, time = [], [], trajectory.dwell
        for move in trajectory.moves:
            postures.append(np.array(move.to, dtype=float))
            spans.append(move.duration)
            begins.append(time)
            time += move.duration + move.dwell
        self._postures, self._spans, self._begins = postures, spans, begins
        self.duration = trajectory.duration
        """Duration [s]."""

    def at(self, s: float) -> np.ndarray:
        """Positions [rad], velocities and accelerations in trajectory time at time s [s], shape (3, n)."""
        index = bisect_right(self._begins, s) - 1
        if index < 0:
            return np.vstack([self._postures[0], np.zeros((2, len(self._postures[0])))])
        span = self._spans[index]
        way = self._postures[index + 1] - self._postures[index]
        return quintic(self._postures[index], way, span, s - self._begins[index])


def quintic(start: np.ndarray, way: np.ndarray, span: float, t: float) -> np.ndarray:
    """Positions, velocities and accelerations of a quintic move, at rest at both ends, shape (3, n).

    Args:
        start: Joint positions at the beginning, shape (n,) [rad].
        way: Displacements of the joints, shape (n,) [rad].
        span: Duration of the move [s].
        t: Time since the beginning of the move [s].
    """
    u = min(max(t / span, 0.0), 1.0)
    return np.array(
        [
            start + way * (u**3 * (10.0 - 15.0 * u + 6.0 * u**2)),
            way * (30.0 * u**2 * (1.0 - u) ** 2) / span,
            way * (60.0 * u * (1.0 - u) * (1.0 - 2.0 * u)) / span**2,
        ]
    )


class _Hold:
    done = True

    def __init__(self, q: np.ndarray) -> None:
        self._target = np.vstack([q, np.zeros((2, len(q)))])

    def step(self, dt: float) -> np.ndarray:
        return self._target


class _Stop:
    """Brings all joints to rest along a straight line in joint space, the fastest one with the given
    deceleration, like `stopj`."""

    def __init__(self, target: np.ndarray, deceleration: float) -> None:
        self._q, self._qd = target[0].copy(), target[1].copy()
        self._span = float(np.abs(self._qd).max()) / deceleration
        self._t = 0.0
        self.done = self._span == 0.0

    def step(self, dt: float) -> np.ndarray:
        self._t += dt
        self.done = self._t >= self._span
        if self.done:
            return np.vstack([self._q + 0.5 * self._span * self._qd, np.zeros((2, len(self._q)))])
        rest = 1.0 - self._t / self._span
        way = self._qd * self._t * 0.5 * (1.0 + rest)
        return np.array([self._q + way, self._qd * rest, -self._qd / self._span])


class _Move:
    """Moves to a posture, at rest at both ends."""

    def __init__(self, start: np.ndarray, end: np.ndarray, speed: float, acceleration: float) -> None:
        self._start, self._way = start.copy(), end - start
        far = float(np.abs(self._way).max())
        # Peaks of a quintic: 15/8 of the mean speed, 10/sqrt(3) of displacement over time squared.
        self._span = max(1.875 * far / speed, (10.0 / 3.0**0.5 * far / acceleration) ** 0.5, 1e-3)
        self._t = 0.0
        self.done = False

    def step(self, dt: float) -> np.ndarray:
        self._t += dt
        self.done = self._t >= self._span
        return quintic(self._start, self._way, self._span, self._t)


class MotionGenerator:
    """Generates the target of the joints step by step.

    Args:
        trajectory: Trajectory of the script.
        loop: Whether to repeat the trajectory after its end.
    """

    def __init__(self, trajectory: Trajectory, *, loop: bool = False) -> None:
        self._path = Path(trajectory)
        self._loop = loop
        self._time = 0.0
        self._following = False
        self._motion: _Motion = _Hold(self._path.at(0.0)[0])
        self.target = self._path.at(0.0)
        """Target positions [rad], velocities and accelerations now, shape (3, n)."""
        self.fraction = 0.0
        """Present fraction of the trajectory's own speed."""
        self.wanted = 1.0
        """Requested fraction: the speed slider, or 0 for a pause."""

    @property
    def at_rest(self) -> bool:
        """Whether nothing moves."""
        return not self.target[1].any() and (self._motion.done or (self._following and self.fraction == 0.0))

    @property
    def finished(self) -> bool:
        """Whether the trajectory's end is reached."""
        return self._following and not self._loop and self._time >= self._path.duration

    def start(self) -> None:
        """Follow the trajectory from its beginning."""
        self._time = 0.0
        self.follow()

    def follow(self) -> None:
        """Move back to the point where the trajectory was interrupted, then continue it from there."""
        there = self._path.at(self._time)[0]
        self._following = True
        if np.abs(there - self.target[0]).max() > 1e-9:
            self._motion = _Move(self.target[0], there, APPROACH_SPEED, APPROACH_ACCELERATION)
            self.fraction = 0.0
        else:
            self._motion = _Hold(there)
            # At rest where the trajectory is at rest too, there is nothing to accelerate.
            self.fraction = self.wanted if not self._path.at(self._time)[1:].any() else 0.0

    def stop(self, deceleration: float) -> None:
        """Stop, the fastest joint with this deceleration [rad/s^2]; then hold the position."""
        self._following = False
        self._motion = _Stop(self.target, deceleration)
        self.fraction = 0.0

    def move(self, q: np.ndarray, speed: float, acceleration: float) -> None:
        """Move to a posture [rad] from rest, up to the given speed [rad/s] and acceleration [rad/s^2]."""
        self._following = False
        self._motion = _Move(self.target[0], q, speed, acceleration)

    def step(self, dt: float) -> None:
        """Advance by `dt` [s]."""
        if not self._following or not self._motion.done:
            self.target = self._motion.step(dt)
            return
        change = min(max(self.wanted - self.fraction, -TIME_SCALING * dt), TIME_SCALING * dt)
        self._time += (self.fraction + 0.5 * change) * dt
        self.fraction += change
        if self._loop:
            self._time %= self._path.duration
        elif self._time >= self._path.duration:
            self._time = self._path.duration
        q, rate, curve = self._path.at(self._time)
        share = self.fraction
        self.target = np.array([q, share * rate, share**2 * curve + change / dt * rate])
