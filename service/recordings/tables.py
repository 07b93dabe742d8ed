"""Recordings: tables of samples on disk, as Parquet or as CSV.

Columns by name: `timestamp`, `actual_q_0..5`, `actual_qd_0..5`, joint torques as `joint_torque_0..5` [Nm]
or as the RTDE columns that the scene's signal asks for, `base_wrench_0..5` as the sensor reads it. Others are
kept and passed through. CSV is read as ur_rtde writes it (commas) and as UR's own client does (blanks),
packed with gzip or not. ur_rtde writes on a clock of its own, so that rows repeat: of rows with one timestamp
the first counts.
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.csv as pa_csv
import pyarrow.parquet as pa_parquet

from contactsense.calibration import FreeMotion
from contactsense.scene import Scene
from contactsense.service.recordings.problems import RecordingError
from contactsense.service.sensors.robot_stream import SensorError
from contactsense.service.sensors.signal_mapping import TorqueMap, WrenchMap
from contactsense.types import Sample


@dataclass(frozen=True)
class ColumnTable:
    """A table of samples, in the order of time."""

    name: str
    """For messages: the file it came from."""
    columns: Mapping[str, np.ndarray]
    """Every numeric column, shape (N,), float64."""
    repeated: int = 0
    """Rows that were left out because they repeat the timestamp before."""

    @property
    def t(self) -> np.ndarray:
        """Time on the robot's clock [s], shape (N,)."""
        return self.columns["timestamp"]

    def group(self, name: str, count: int) -> np.ndarray:
        """Columns NAME_0 .. NAME_(count - 1), or NAME itself for count 1, as an array (N, count).

        Raises:
            RecordingError: one is missing, or holds something that is not a finite number.
        """
        wanted = [name] if count == 1 and name in self.columns else [f"{name}_{i}" for i in range(count)]
        missing = [column for column in wanted if column not in self.columns]
        if missing:
            raise RecordingError(
                f"{self.name}: expected the columns {', '.join(wanted)}; {missing[0]} is missing"
            )
        array = np.column_stack([self.columns[column] for column in wanted])
        bad = np.argwhere(~np.isfinite(array))
        if len(bad):
            row, column = bad[0]
            raise RecordingError(
                f"{self.name}: {wanted[column]}: expected finite numbers, got {array[row, column]} in row "
                f"{row + 1} of {len(array)}"
            )
        return array

    def has(self, name: str) -> bool:
        """Whether there are columns of that name."""
        return name in self.columns or f"{name}_0" in self.columns


def read(path: str | Path) -> ColumnTable:
    """Read a recording; `.parquet` as Parquet, anything else as CSV.

    Raises:
        RecordingError: the file cannot be read, has no timestamps, or time does not rise in it.
    """
    path = Path(path)
    try:
        table = pa_parquet.read_table(path) if path.suffix == ".parquet" else _csv(path)
    except (OSError, pa.ArrowException) as error:
        reason = error.strerror if isinstance(error, OSError) and error.strerror else str(error)
        raise RecordingError(f"{path}: cannot read the recording: {' '.join(reason.split())}") from None
    columns = {}
    for name, column in zip(table.column_names, table.columns, strict=True):
        if name in columns:
            raise RecordingError(f"{path}: {name}: the column is there twice")
        if pa.types.is_integer(column.type) or pa.types.is_floating(column.type):
            columns[name] = column.to_numpy().astype(np.float64)
        elif name == "timestamp" or name.startswith(("actual_q", "joint_torque", "base_wrench")):
            raise RecordingError(f"{path}: {name}: expected a column of numbers, got {column.type}")
    return _in_order(str(path), columns)


def _csv(path: Path) -> pa.Table:
    with pa.input_stream(path, compression="detect") as stream:
        head = stream.read(65536).split(b"\n", 1)[0].decode("utf-8", "replace").strip()
    if "timestamp" not in head:
        raise RecordingError(
            f"{path}: expected a header line that names the columns, timestamp first, got {head[:60]!r}"
        )
    delimiter = "," if "," in head else "\t" if "\t" in head else " "
    with pa.input_stream(path, compression="detect") as stream:
        return pa_csv.read_csv(stream, parse_options=pa_csv.ParseOptions(delimiter=delimiter))


def _in_order(name: str, columns: dict[str, np.ndarray]) -> ColumnTable:
    if "timestamp" not in columns:
        raise RecordingError(f"{name}: expected a column timestamp, got {', '.join(list(columns)[:8])}")
    t = columns["timestamp"]
    if len(t) < 2 or not np.all(np.isfinite(t)):
        raise RecordingError(f"{name}: timestamp: expected at least two finite times, got {len(t)} rows")
    step = np.diff(t)
    if np.any(step < 0.0):
        row = int(np.flatnonzero(step < 0.0)[0]) + 1
        raise RecordingError(
            f"{name}: timestamp: expected rising times, got {t[row]} after {t[row - 1]} in row {row + 1}; "
            "cut the recording where the clock was set back"
        )
    fresh = np.concatenate(([True], step > 0.0))
    return ColumnTable(name, {key: values[fresh] for key, values in columns.items()}, int(np.sum(~fresh)))


def torque_of(recording: ColumnTable, scene: Scene) -> np.ndarray | None:
    """Joint torques [Nm], actuator's sign, shape (N, n); None where the scene uses none.

    The columns that the scene names come first, then joint_torque_*, then those of its signal.

    Raises:
        RecordingError: the recording has none of them.
    """
    sensor = scene.joint_torque
    if sensor is None:
        return None
    joints = len(scene.robot.joints)
    if sensor.fields is None and recording.has("joint_torque"):
        return recording.group("joint_torque", joints)
    try:
        source = TorqueMap.of(scene)
    except SensorError as error:
        raise RecordingError(f"{recording.name}: {error}") from None
    assert source is not None
    for name in source.names:
        if not recording.has(name):
            raise RecordingError(
                f"{recording.name}: expected joint_torque_0.. or {name}_0.. for joint_torque.signal "
                f"{sensor.signal}, got neither; joint_torque: null in the scene does without"
            )
    count = joints if len(source.fields) == 1 else 1
    return source.torque({name: recording.group(name, count) for name in source.names})


def stretch_of(recording: ColumnTable, scene: Scene) -> FreeMotion:
    """The recording as calibration takes it: sensors that it lacks are left out.

    Raises:
        RecordingError: a column is missing or wrong.
    """
    joints = len(scene.robot.joints)
    torque, reading = None, None
    if scene.joint_torque is not None:
        torque = torque_of(recording, scene)
    if scene.base_wrench is not None and recording.has("base_wrench"):
        reading = recording.group("base_wrench", 6)
    q, qd = recording.group("actual_q", joints), recording.group("actual_qd", joints)
    return FreeMotion(recording.t, q, qd, torque, reading, recording.name)


def samples_of(recording: ColumnTable, scene: Scene) -> Iterator[Sample]:
    """The recording as a stream for `Localizer.run`.

    Raises:
        RecordingError: a column that the scene's sensors need is missing or wrong.
    """
    stretch = stretch_of(recording, scene)
    wrench = None
    if scene.base_wrench is not None:
        if stretch.reading is None:
            raise RecordingError(
                f"{recording.name}: expected base_wrench_0..5 for the sensor under the base, got none; "
                "base_wrench: null in the scene does without"
            )
        reading, late = stretch.reading, scene.base_wrench.delay
        if late != 0.0:
            reading = np.column_stack([np.interp(stretch.t + late, stretch.t, c) for c in reading.T])
        wrench = WrenchMap.of(scene.base_wrench).wrench(reading)
    for i, t in enumerate(stretch.t):
        yield Sample(
            float(t),
            stretch.q[i],
            stretch.qd[i],
            None if stretch.torque is None else stretch.torque[i],
            None if wrench is None else wrench[i],
        )


def table_of(samples: Sequence[Sample], scene: Scene) -> dict[str, np.ndarray]:
    """Columns of a recording from samples; a value that a sample lacks is NaN.

    The base wrench goes back into the sensor's own frame, so that the scene means the same when it is read.
    """
    joints = len(scene.robot.joints)
    columns = {"timestamp": np.array([sample.t for sample in samples])}
    parts: list[tuple[str, int, list[np.ndarray | None]]] = [
        ("actual_q", joints, [sample.q for sample in samples]),
        ("actual_qd", joints, [sample.qd for sample in samples]),
    ]
    if scene.joint_torque is not None:
        parts.append(("joint_torque", joints, [sample.joint_torque for sample in samples]))
    if scene.base_wrench is not None:
        back = WrenchMap.of(scene.base_wrench).reading
        readings = [None if s.base_wrench is None else back(s.base_wrench) for s in samples]
        parts.append(("base_wrench", 6, readings))
    for name, count, values in parts:
        array = np.array([np.full(count, np.nan) if value is None else value for value in values])
        columns |= {f"{name}_{i}": array.reshape(-1, count)[:, i] for i in range(count)}
    return columns


def write(path: str | Path, columns: Mapping[str, np.ndarray]) -> None:
    """Write columns; `.parquet` as Parquet, anything else as CSV with a header.

    Raises:
        RecordingError: the file cannot be written.
    """
    path = Path(path)
    table = pa.table(dict(columns))
    try:
        if path.suffix == ".parquet":
            pa_parquet.write_table(table, path)
        else:
            pa_csv.write_csv(table, path, pa_csv.WriteOptions(quoting_style="none"))
    except OSError as error:
        raise RecordingError(f"{path}: cannot write: {error.strerror or error}") from None
