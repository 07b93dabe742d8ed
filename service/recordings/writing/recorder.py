"""Records live samples in two tables, both the raw values and those that were used.

`samples`: one row per robot packet: time stamps, every RTDE field of the recipe, the joint torques as used
[Nm], and the readings of the force/torque sensors at that instant, each in the sensor's own frame. `wrench`:
every reading of a networked sensor under the base, at its own rate, with its own sequence number.
"""

import time
from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np

from contactsense.scene import Scene
from contactsense.scene_model.link_sensor_frame import LinkSensorFrame
from contactsense.sensors.link_values import by_field, column_of
from contactsense.service.recordings.metadata import RAW, metadata
from contactsense.service.recordings.writing.segment_writer import Rotation, SegmentWriter
from contactsense.service.sensors.clients.netft_client import WrenchRecord
from contactsense.service.sensors.clients.robot_stream import RobotRecord
from contactsense.types import Sample

_WRENCH_COLUMNS = ("tick", "arrival", *(f"base_wrench_{i}" for i in range(6)))


class Recorder:
    """A raw-data observer of `LiveSource` that writes everything it receives.

    Args:
        folder: Destination of the files.
        scene: Stored in the metadata.
        rotation: When segments are closed, and how much disk space they may use.
        rate: Sample rate of the robot [Hz].

    Raises:
        RecordingError: The folder cannot be written.
    """

    def __init__(
        self, folder: Path, scene: Scene, rotation: Rotation | None = None, *, rate: float = 500.0
    ) -> None:
        self._folder, self._scene, self._rotation, self._rate = folder, scene, rotation, rate
        self._joints = len(scene.robot.joints)
        self._samples: SegmentWriter | None = None
        self._wrench: SegmentWriter | None = None
        # Host time at zero of the monotonic clock: arrival times are written as UNIX time.
        self._epoch = time.time() - time.monotonic()
        self._blank = np.full(self._joints, np.nan)
        self._links = {field: LinkSensorFrame(scene, field) for field in scene.link_sensors}

    @property
    def rows(self) -> int:
        """Robot samples written so far."""
        return 0 if self._samples is None else self._samples.rows

    @property
    def readings(self) -> int:
        """Force/torque readings written so far."""
        return 0 if self._wrench is None else self._wrench.rows

    @property
    def repaired(self) -> list[Path]:
        """Unfinished files of an earlier run that were repaired."""
        writers = (self._samples, self._wrench)
        return [file for writer in writers if writer is not None for file in writer.repaired]

    @property
    def removed(self) -> int:
        """Number of files that were removed to keep the limit of the disk space."""
        return sum(writer.removed for writer in (self._samples, self._wrench) if writer is not None)

    def robot(
        self,
        record: RobotRecord,
        slices: Mapping[str, slice],
        reading: np.ndarray | None,
        age: float,
        sample: Sample | None,
    ) -> None:
        """Write one robot packet.

        Args:
            record, slices: Its raw values, and the position of each field in them.
            reading: The base sensor's reading at that instant, sensor axes [N, Nm], shape (6,), if there is
                one.
            age: By how much that reading is older than the packet [s].
            sample: The sample for the estimator; None if the packet cannot be used.
        """
        if self._samples is None:
            self._samples = self._open(slices)
        torque = None if sample is None else sample.joint_torque
        row = np.concatenate(
            (
                (record.timestamp, self._epoch + 1e-9 * record.arrival_ns, age),
                np.asarray(record.values, dtype=float),
                self._blank if torque is None else torque,
                np.full(6, np.nan) if reading is None else reading,
                *self._link_readings(sample),
            )
        )
        self._samples.add(row)

    def _link_readings(self, sample: Sample | None) -> list[np.ndarray]:
        """Reading of each link sensor in its own frame, shape (6,) [N, Nm]; NaN where there is none."""
        values = {} if sample is None else by_field(sample.wrist_wrench, sample.link_wrenches)
        return [
            frame.reading(sample.q, values[field])
            if sample is not None and field in values
            else np.full(6, np.nan)
            for field, frame in self._links.items()
        ]

    def wrench(self, readings: Sequence[WrenchRecord]) -> None:
        """Write readings of the networked force/torque sensor, in order."""
        if self._wrench is None and readings:
            self._wrench = SegmentWriter(
                self._folder, "wrench", _WRENCH_COLUMNS, metadata(self._scene, table="wrench"),
                self._rotation, rate=2.0 * self._rate,
            )  # fmt: skip
        for reading in readings:
            assert self._wrench is not None
            arrival = self._epoch + 1e-9 * reading.arrival_ns
            self._wrench.add((float(reading.tick), arrival, *reading.wrench))

    def flush(self) -> None:
        """Pass all buffered rows to the operating system."""
        for writer in (self._samples, self._wrench):
            if writer is not None:
                writer.flush()

    def close(self) -> list[Path]:
        """Complete all files and return their paths."""
        return [p for w in (self._samples, self._wrench) if w is not None for p in w.close()]

    def _open(self, slices: Mapping[str, slice]) -> SegmentWriter:
        ordered = sorted(slices.items(), key=lambda item: item[1].start)
        raw = []
        for name, where in ordered:
            width = where.stop - where.start
            raw += [name] if width == 1 else [f"{name}_{i}" for i in range(width)]
        links = [f"{column_of(field)}_{i}" for field in self._links for i in range(6)]
        taken = {f"joint_torque_{i}" for i in range(self._joints)} | {f"base_wrench_{i}" for i in range(6)}
        taken.update(links)
        raw = [f"raw_{name}" if name in taken or name == "timestamp" else name for name in raw]
        names = (
            "timestamp",
            "arrival",
            "base_wrench_age",
            *raw,
            *(f"joint_torque_{i}" for i in range(self._joints)),
            *(f"base_wrench_{i}" for i in range(6)),
            *links,
        )
        return SegmentWriter(
            self._folder, "samples", names, metadata(self._scene, table=RAW), self._rotation,
            rate=self._rate,
        )  # fmt: skip
