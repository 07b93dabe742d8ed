"""Sources of samples without sensors. The pipeline's process imports them by name."""

import os
import time

import numpy as np

from contactsense import Sample, Scene
from contactsense.service.sensors.clients.robot_stream import State, StreamHealth
from contactsense.service.sensors.source_health import SourceHealth
from contactsense.service.wire.recipe import RtdeFieldError

_FREE = 650
"""Samples of the free arm; 1 s of it ends the doubt."""
_FREE_ROW, _PUSHED_ROW = 100, 400


class Steady:
    """A resting arm, pushed at its forearm with 30 N, at 500 Hz. Raw readings: its weight is in them.

    At first it is free, for a time that has already passed: a stream that is touched from its start is
    doubted.
    """

    state: State = "streaming"
    error = ""
    streams = 1

    def __init__(self, scene: Scene) -> None:
        from contactsense.service.mock.arm.script import Script
        from contactsense.service.mock.arm.simulated_arm import simulate

        script = {
            "robot": scene.robot.name,
            "trajectory": {"start": [0.0, -1.3, 1.6, -1.9, -1.57, 0.0], "dwell": 1.0},
            "contacts": [
                {
                    "link": "forearm",
                    "point": [-0.1747, 0.0373, 0.0095],
                    "normal": [-0.0008, 0.9931, 0.1174],
                    "push": 30.0,
                    "start": 0.5,
                    "duration": 0.5,
                    "ramp": 0.0,
                }
            ],
        }
        self._motion = simulate(Script.model_validate(script))
        self._next = time.monotonic()
        self._count = 0

    def poll(self, timeout: float) -> list[Sample]:
        self._next += 0.002
        time.sleep(max(0.0, self._next - time.monotonic()))
        if self._count == 0:
            self._count = _FREE
            return [self._sample(i + 1, _FREE_ROW) for i in range(_FREE)]
        self._count += 1
        return [self._sample(self._count, _PUSHED_ROW)]

    def _sample(self, count: int, row: int) -> Sample:
        motion = self._motion
        return Sample(
            count * 0.002, motion.q[row], motion.qd[row], motion.joint_torque[row], motion.base_wrench[row]
        )

    @property
    def health(self) -> SourceHealth:
        robot = StreamHealth(state=self.state, error=self.error, received=self._count)
        return SourceHealth(robot, wrench=None, unusable=0, without_wrench=0)

    def close(self) -> None:
        pass


def deaf(*_: object) -> None:
    """In place of the pipeline's main function: it reads nothing and says nothing."""
    time.sleep(600.0)


class Untouched(Steady):
    """A resting arm that nobody pushes."""

    def _sample(self, count: int, row: int) -> Sample:
        return super()._sample(count, _FREE_ROW)


class Mute(Steady):
    """Nobody at the other end."""

    state: State = "waiting"
    error = "robot at 192.0.2.1:30004 cannot be reached: no answer in time"

    def poll(self, timeout: float) -> list[Sample]:
        time.sleep(timeout)
        return []


class Crashing(Steady):
    """Dies after a while without a word, as a process does that a foreign library aborts."""

    def poll(self, timeout: float) -> list[Sample]:
        if self._count == _FREE + 100:
            os._exit(3)
        return super().poll(timeout)


class Hanging(Steady):
    """Gets stuck after a while."""

    def poll(self, timeout: float) -> list[Sample]:
        if self._count == _FREE + 100:
            time.sleep(3600.0)
        return super().poll(timeout)


class Broken(Steady):
    """Raises while it is read."""

    def poll(self, timeout: float) -> list[Sample]:
        raise ValueError("no such field")


class Overflowing(Steady):
    """Raises after more estimates than the connection holds at once."""

    why: Exception = ValueError("no such field")

    def poll(self, timeout: float) -> list[Sample]:
        if self._count:
            raise self.why
        return super().poll(timeout)


class OlderController(Overflowing):
    """Lacks a field."""

    why = RtdeFieldError(["actual_current_as_torque"])


class Hasty(Steady):
    """Samples as fast as they are taken."""

    def poll(self, timeout: float) -> list[Sample]:
        self._next = -np.inf
        return super().poll(timeout)
