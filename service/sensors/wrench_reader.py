"""One force/torque sensor of a live source: its reading at each of the robot's samples, in base axes.

Base sensor, wrist sensor and sensors between links are read alike, from a box of their own on the network or
from fields of the robot's packets.
"""

import math
from collections.abc import Callable, Mapping
from typing import NamedTuple

import numpy as np

from contactsense.service.sensors.network_wrench import NetworkWrench
from contactsense.service.sensors.plausibility import ReadingCheck
from contactsense.service.sensors.robot_stream import RobotRecord


class WrenchReading(NamedTuple):
    """What a sensor says of one instant."""

    wrench: np.ndarray | None
    """Wrench on the sensor of what it carries, base axes and origin, shape (6,) [N, Nm]; None: no reading."""
    raw: np.ndarray | None
    """The reading in the sensor's own frame and sign, shape (6,) [N, Nm]."""
    age: float
    """By how much the reading is older than the instant [s]; infinite if there is none."""


class WrenchReader:
    """Reads one force/torque sensor.

    Args:
        to_base: From joint positions, shape (n,) [rad], and a reading, shape (6,), to the wrench in base
            axes.
        check: Tells which readings are left out, and counts instants without one.
        source: The sensor's box, or the RTDE fields that contain its six values [N, Nm].
        max_age: A reading in RTDE fields may be repeated for this time [s].
    """

    def __init__(
        self,
        to_base: Callable[[np.ndarray, np.ndarray], np.ndarray],
        check: ReadingCheck,
        source: NetworkWrench | tuple[str, ...],
        max_age: float,
    ) -> None:
        self._to_base, self._check, self._max_age = to_base, check, max_age
        self._fields = source if isinstance(source, tuple) else ()
        self.network = None if isinstance(source, tuple) else source
        """The sensor's box; None: it has none."""

    def at(self, record: RobotRecord, slices: Mapping[str, slice], q: np.ndarray) -> WrenchReading:
        """The reading at the instant of a robot's packet.

        Args:
            record: The packet.
            slices: Position of each field's values in it.
            q: Its joint positions, shape (n,) [rad].
        """
        raw, age = self._raw(record, slices)
        wrench = None if raw is None else self._to_base(q, raw)
        if self.network is not None:
            self.network.note(wrench is not None)
        # While the box is away, its state says so, and says nothing as soon as it is back.
        if wrench is None and (self.network is None or self.network.is_streaming):
            self._check.note("lacking")
        return WrenchReading(wrench, raw, age)

    def _raw(self, record: RobotRecord, slices: Mapping[str, slice]) -> tuple[np.ndarray | None, float]:
        if self.network is not None:
            return (aligned := self.network.at(record)).wrench, aligned.age
        values = [value for name in self._fields for value in record.values[slices[name]]]
        if not self._check.believes(record.timestamp, values, self._max_age):
            return None, math.inf
        return np.array(values, dtype=float), 0.0
