"""One force/torque sensor of a live source: its reading at each of the robot's samples, in base axes.

Base sensor, wrist sensor and sensors between links are read alike, from a box of their own on the network or
from fields of the robot's packets.
"""

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from contactsense.service.sensors.checks.plausibility import ReadingCheck
from contactsense.service.sensors.clients.robot_stream import RobotRecord
from contactsense.service.sensors.field_wrench import FieldWrench
from contactsense.service.sensors.network_wrench import NetworkWrench


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
        source: The sensor's box, or the fields of the robot's packets.
    """

    def __init__(
        self,
        to_base: Callable[[np.ndarray, np.ndarray], np.ndarray],
        check: ReadingCheck,
        source: NetworkWrench | FieldWrench,
    ) -> None:
        self._to_base, self._check, self._source = to_base, check, source
        self.network = source if isinstance(source, NetworkWrench) else None
        """The sensor's box; None: it has none."""

    def at(self, record: RobotRecord, q: np.ndarray) -> WrenchReading:
        """The reading at the instant of a robot's packet.

        Args:
            record: The packet.
            q: Its joint positions, shape (n,) [rad].
        """
        found = self._source.at(record)
        raw = found.wrench
        wrench = None if raw is None else self._to_base(q, raw)
        if self.network is not None:
            self.network.note(wrench is not None)
        # While the box is away, its state says so, and says nothing as soon as it is back.
        if wrench is None and (self.network is None or self.network.is_streaming):
            self._check.note("lacking")
        return WrenchReading(wrench, raw, found.age)
