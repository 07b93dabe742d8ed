"""A force/torque sensor whose reading is in fields of the robot's packets."""

import math
from collections import deque
from collections.abc import Mapping

import numpy as np

from contactsense.service.sensors.checks.plausibility import ReadingCheck
from contactsense.service.sensors.clients.robot_stream import RobotRecord
from contactsense.service.sensors.time_alignment import Aligned

_WIDEST = 0.02
"""Readings that are further apart are not interpolated [s]."""
SAME_INSTANT = 1e-6
"""Two instants that differ by less are the same [s]."""


class FieldWrench:
    """Readings at the instants to which they belong, one delay before the packet that has them.

    Args:
        fields: RTDE fields that contain the six values [N, Nm].
        delay: Of the readings [s].
        max_age: A reading may be repeated for this time [s].
        check: Tells which readings are left out.
    """

    def __init__(self, fields: tuple[str, ...], delay: float, max_age: float, check: ReadingCheck) -> None:
        self._fields, self._delay, self._max_age, self._check = fields, delay, max_age, check
        self._readings: deque[tuple[float, np.ndarray]] = deque()
        self._t = -math.inf

    @property
    def lag(self) -> float:
        """Time after a packet within which the reading of its instant comes [s]."""
        return max(self._delay, 0.0)

    def take(self, record: RobotRecord, slices: Mapping[str, slice]) -> None:
        """Take the reading of a packet."""
        if record.timestamp < self._t:
            self._readings.clear()
        self._t = record.timestamp
        values = [value for name in self._fields for value in record.values[slices[name]]]
        if self._check.believes(record.timestamp, values, self._max_age):
            self._readings.append((record.timestamp, np.array(values, dtype=float)))
        # One before the oldest instant that may still be asked for stays.
        oldest = self._t - abs(self._delay) - _WIDEST
        while len(self._readings) > 1 and self._readings[1][0] < oldest:
            self._readings.popleft()

    def at(self, record: RobotRecord) -> Aligned:
        """The reading at the instant of a packet."""
        instant = record.timestamp + self._delay
        later: tuple[float, np.ndarray] | None = None
        for t, reading in reversed(self._readings):
            if abs(t - instant) <= SAME_INSTANT:
                return Aligned(reading, 0.0)
            if t < instant:
                if later is None or later[0] - t > _WIDEST:
                    break
                share = (instant - t) / (later[0] - t)
                return Aligned(reading + share * (later[1] - reading), 0.0)
            later = t, reading
        return Aligned(None, math.inf)
