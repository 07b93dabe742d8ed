"""Samples and their estimates as rows of numbers: the content of clips and of the service's recordings."""

import time

import numpy as np

from contactsense.scene import Scene
from contactsense.scene_model.link_sensor_frame import LinkSensorFrame
from contactsense.scene_model.wrench_map import WrenchMap
from contactsense.sensors.link_values import by_field, column_of
from contactsense.types import Estimate, Sample

STATUS = ("none", "contact", "ambiguous", "multiple", "degraded")
"""Status of the estimate by its number in the column `status`."""


class SampleRows:
    """The columns of one scene's rows, and a method to fill a row with little allocation."""

    def __init__(self, scene: Scene) -> None:
        n = len(scene.robot.joints)
        self.joints = n
        self._links = {field: LinkSensorFrame(scene, field) for field in scene.link_sensors}
        self.names: tuple[str, ...] = (
            "timestamp",
            "host_time",
            *(f"actual_q_{i}" for i in range(n)),
            *(f"actual_qd_{i}" for i in range(n)),
            *(f"joint_torque_{i}" for i in range(n)),
            *(f"base_wrench_{i}" for i in range(6)),
            *(f"{column_of(field)}_{i}" for field in self._links for i in range(6)),
            "status",
            "link",
            "probability",
            *(f"force_base_{i}" for i in range(3)),
            *(f"point_base_{i}" for i in range(3)),
        )
        self._base = slice(2 + 3 * n, 8 + 3 * n)
        self._map = None if scene.base_wrench is None else WrenchMap.of(scene.base_wrench)

    def fill(self, row: np.ndarray, sample: Sample, estimate: Estimate) -> None:
        """Write one sample and its estimate into `row`, shape (len(names),)."""
        n = self.joints
        row[:] = np.nan
        row[0], row[1] = sample.t, time.time()
        row[2 : 2 + n] = sample.q
        row[2 + n : 2 + 2 * n] = sample.qd
        if sample.joint_torque is not None:
            row[2 + 2 * n : 2 + 3 * n] = sample.joint_torque
        if sample.base_wrench is not None:
            row[self._base] = sample.base_wrench
        at = 8 + 3 * n
        values = by_field(sample.wrist_wrench, sample.link_wrenches)
        for field in self._links:
            if field in values:
                row[at : at + 6] = values[field]
            at += 6
        row[at] = STATUS.index(estimate.status)
        if estimate.contacts:
            best = estimate.contacts[0]
            row[at + 1], row[at + 2] = best.link_index, best.probability
            row[at + 3 : at + 6] = best.force_base
            row[at + 6 : at + 9] = best.point_base

    def stored(self, rows: np.ndarray) -> np.ndarray:
        """Rows in the form that is stored: the wrenches on the base sensor and on the link sensors are
        converted back to each sensor's own frame and sign, so that the scene still applies when the file is
        read. Changes `rows`."""
        if self._map is not None:
            rows[:, self._base] = self._map.reading(rows[:, self._base])
        q = rows[:, 2 : 2 + self.joints]
        for i, frame in enumerate(self._links.values()):
            first = 8 + 3 * self.joints + 6 * i
            rows[:, first : first + 6] = frame.readings(q, rows[:, first : first + 6])
        return rows


class Ring:
    """Ring buffer of the last rows of a stream, allocated once."""

    def __init__(self, capacity: int, columns: int) -> None:
        self._rows = np.full((capacity, columns), np.nan)
        self._written = 0

    @property
    def next(self) -> np.ndarray:
        """The row to fill next; `push` commits it."""
        row: np.ndarray = self._rows[self._written % len(self._rows)]
        return row

    def push(self) -> None:
        """Commit the row returned by `next`."""
        self._written += 1

    @property
    def capacity(self) -> int:
        """Number of rows that it keeps."""
        return len(self._rows)

    def __len__(self) -> int:
        return min(self._written, len(self._rows))

    def between(self, column: int, begin: float, end: float) -> np.ndarray:
        """Copies of the rows whose value in `column` lies in [begin, end], oldest first."""
        n = len(self)
        order = (np.arange(self._written - n, self._written) % len(self._rows)) if n else np.zeros(0, int)
        values = self._rows[order, column]
        kept: np.ndarray = self._rows[order[(values >= begin) & (values <= end)]]
        return kept
