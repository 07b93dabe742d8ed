"""From a file to a recording: its columns are found, checked and converted by the scene, block by block."""

import itertools
from collections.abc import Iterator, Mapping
from dataclasses import replace
from pathlib import Path
from typing import NamedTuple

import numpy as np

from contactsense.scene import Scene
from contactsense.scene_model.link_sensor_frame import LinkSensorFrame
from contactsense.scene_model.wrench_map import WrenchMap
from contactsense.sensors.link_values import as_fields
from contactsense.service.recordings.bag_files import BagFile, is_bag
from contactsense.service.recordings.cleaning import RowChecker
from contactsense.service.recordings.column_mapping import ColumnMapping, expand
from contactsense.service.recordings.held_values import HeldValues
from contactsense.service.recordings.problems import Problem, RecordingError
from contactsense.service.recordings.reading_times import is_slower, readings_at
from contactsense.service.recordings.recording import BLOCK, Recording, concatenate
from contactsense.service.recordings.table_files import Columns, TableFile, chosen_rows, open_table
from contactsense.service.sensors.robot_stream import SensorError
from contactsense.service.sensors.signal_mapping import TorqueMap

SLOWEST = 0.15
"""Longest time between two readings of a slow sensor whose delay is taken off without loss [s]."""


class RecordingFile:
    """One recording on disk, read block by block, so that memory use does not depend on its length.

    Args:
        path: CSV (ur_rtde's or UR's own client's), Parquet, Arrow IPC stream, a folder of Parquet files,
            MCAP, or a rosbag2 folder.
        scene: Defines the meaning of the signals: torque signal, frame and sign of the sensors.
        mapping: Names of columns and topics, and units.

    Raises:
        RecordingError: The file cannot be read, or lacks a column that the scene needs.
    """

    def __init__(self, path: str | Path, scene: Scene, mapping: ColumnMapping | None = None) -> None:
        self.path = Path(path)
        self.name = str(path)
        self._scene, self._mapping = scene, mapping or ColumnMapping()
        self._table: TableFile = (
            BagFile(self.path, self._mapping, scene) if is_bag(self.path) else open_table(self.path)
        )
        self.meta: Mapping[str, str] = self._table.meta
        """Metadata of the file."""
        self._joints = len(scene.robot.joints)
        self._plan()

    @property
    def sensors(self) -> frozenset[str]:
        """Fields of the scene's sensors that the file has."""
        own = {"joint_torque": self._torque_names, "base_wrench": self._base}
        return frozenset(field for field, columns in own.items() if columns) | self._links.keys()

    @property
    def rows(self) -> int | None:
        """Number of rows, if it is known before the whole file is read."""
        return self._table.rows

    def read(self, first: int = 0, last: int | None = None) -> Recording:
        """Read the recording, or its rows from `first` up to, but not including, `last`."""
        return concatenate(list(self.blocks(BLOCK, first, last)), self.name, self.meta)

    def blocks(self, size: int = BLOCK, first: int = 0, last: int | None = None) -> Iterator[Recording]:
        """The samples in blocks of at most `size`; each carries the problems found since the previous block.

        Args:
            size: Maximum number of samples in a block.
            first, last: Range of rows to read: from `first` up to, but not including, `last`.
        """
        checker, held, end = RowChecker(), HeldValues(), 0
        pending = _Pending(self._late, self._links)
        reported = kept = 0
        for row, columns in chosen_rows(self._table.batches(self._wanted, first, last), first, last):
            # What is not finite is reported, and stays so in every product.
            with np.errstate(invalid="ignore"):
                block = self._converted(columns, row, checker, held)
            end = row + len(columns[self._mapping.timestamp])
            kept += len(block)
            for part in pending.add(block).blocks(size):
                new, reported = tuple(checker.problems[reported:]), len(checker.problems)
                yield replace(part, problems=new, repeated=checker.repeated, meta=self.meta)
        checker.finish()
        rest = pending.flush()
        new = (*checker.problems[reported:], *held.problems(end), *self._absent, *self._table.problems)
        if rest is None or not kept:
            why = next((f": {problem}" for problem in (*self._table.problems, *new)), "")
            raise RecordingError(f"{self.name}: expected at least two samples, got none{why}")
        parts = list(rest.blocks(size)) or [rest]
        for part in parts[:-1]:
            yield part
        yield replace(parts[-1], problems=new, repeated=checker.repeated, meta=self.meta)

    def _plan(self) -> None:
        mapping, names, n = self._mapping, self._table.names, self._joints
        self._absent: list[Problem] = []
        if mapping.timestamp not in names:
            self._missing("timestamp", mapping.timestamp)
        self._q = self._group("q", mapping.q, n)
        if f"{mapping.q[0]}_{n}" in names and self._q != list(mapping.q):
            raise RecordingError(
                f"{self.name}: q: expected {n} columns, one for each joint of {self._scene.robot.name}, "
                f"found {mapping.q[0]}_{n} as well; is it another arm? A YAML file for --columns names "
                "those that are meant: q: [A, B]"
            )
        self._qd = self._group("qd", mapping.qd, n)
        self._torque_names, self._torque_map = self._torque_plan()
        base = self._scene.base_wrench
        self._base = self._optional("base_wrench", mapping.base_wrench, base is not None)
        self._links: dict[str, _LinkColumns] = {}
        for field, sensor in self._scene.link_sensors.items():
            columns = self._optional(field, mapping.of_link_sensor(field), True)
            if columns:
                frame = LinkSensorFrame(self._scene, field)
                self._links[field] = _LinkColumns(columns, frame, sensor.delay)
        self._base_map = None if base is None else WrenchMap.of(base)
        self._late = 0.0 if base is None or not self._base else base.delay
        if not (self._torque_names or self._base):
            raise RecordingError(
                f"{self.name}: expected columns of joint torques or of the base sensor, got neither; "
                f"found {self._found()}{self._other_signal()}"
            )
        wanted = [mapping.timestamp, *self._q, *self._qd, *self._torque_names, *self._base]
        wanted += [column for link in self._links.values() for column in link.columns]
        self._wanted = list(dict.fromkeys(wanted))

    def _torque_plan(self) -> tuple[list[str], TorqueMap | None]:
        """Columns that contain the torque signals, and their conversion; None if they are joint torques
        [Nm]."""
        sensor, names, n = self._scene.joint_torque, self._table.names, self._joints
        if sensor is None:
            return [], None
        if self._mapping.joint_torque is not None:
            return self._group("joint_torque", self._mapping.joint_torque, n), None
        own = expand(("joint_torque",), n, names)
        if sensor.fields is None and all(name in names for name in own):
            return own, None
        try:
            source = TorqueMap.of(self._scene)
        except SensorError as error:
            raise RecordingError(f"{self.name}: {error}") from None
        assert source is not None
        columns = [column for name in source.names for column in self._columns_of(name, source)]
        if any(column not in names for column in columns):
            if all(name in names for name in own):  # converted before
                return own, None
            message = f"no {own[0]} ... nor {columns[0]} ... ({sensor.signal}): joint torques are not used"
            message += self._other_signal()
            self._absent.append(Problem(0, 0, "missing_sensor", message))
            return [], None
        return columns, source

    def _other_signal(self) -> str:
        """Advice where the file has another torque signal than the scene states."""
        sensor = self._scene.joint_torque
        for signal in ("actual_current_as_torque", "actual_current"):
            if sensor is not None and signal != sensor.signal and f"{signal}_0" in self._table.names:
                return f"; for {signal}, the scene needs `joint_torque: {{signal: {signal}}}`"
        return ""

    def _columns_of(self, field_name: str, source: TorqueMap) -> list[str]:
        width = self._joints if len(source.fields) == 1 else 1
        return [field_name] if width == 1 else [f"{field_name}_{i}" for i in range(width)]

    def _group(self, name: str, columns: tuple[str, ...], count: int) -> list[str]:
        wanted = expand(columns, count, self._table.names)
        for column in wanted:
            if column not in self._table.names:
                self._missing(name, column)
        return wanted

    def _optional(self, name: str, columns: tuple[str, ...], in_scene: bool) -> list[str]:
        if not in_scene:
            return []
        wanted = expand(columns, 6, self._table.names)
        if all(column in self._table.names for column in wanted):
            return wanted
        if self._mapping.states(name) or any(column in self._table.names for column in wanted):
            self._missing(name, next(c for c in wanted if c not in self._table.names))
        message = f"no column {wanted[0]}: {name} is not used, though the scene has this sensor"
        self._absent.append(Problem(0, 0, "missing_sensor", message))
        return []

    def _missing(self, name: str, column: str) -> None:
        each = "" if name == "timestamp" else f", a YAML file one column for each value: {name}: [A, B]"
        raise RecordingError(
            f"{self.name}: {name}: expected a column {column}, found {self._found()}; "
            f"--columns {name}=NAME names another{each}"
        )

    def _found(self) -> str:
        names, others = self._table.names, self._table.others
        found = _listed(names) if names else "none with numbers"
        return f"{found}; without numbers: {_listed(others)}" if others else found

    def _converted(self, columns: Columns, first: int, checker: RowChecker, held: HeldValues) -> Recording:
        t = columns[self._mapping.timestamp] * self._mapping.seconds
        keep = checker.keep(t, first)
        rows = np.flatnonzero(keep)

        whole = len(rows) == len(t)

        def table(names: list[str]) -> np.ndarray:
            stacked = np.empty((len(rows), len(names)))
            for i, name in enumerate(names):
                stacked[:, i] = columns[name] if whole else columns[name][rows]
            return stacked

        q, qd = table(self._q), table(self._qd)
        if self._mapping.radians != 1.0:
            q, qd = q * self._mapping.radians, qd * self._mapping.radians
        bad = np.asarray(~(np.isfinite(q).all(axis=1) & np.isfinite(qd).all(axis=1)))
        checker.report(bad, first, "not_finite", "joint positions or velocities are not finite", rows)
        torque = base = None
        if self._torque_names:
            values = table(self._torque_names)
            held.add("joint_torque", values, qd)
            torque = values if self._torque_map is None else self._signal(values, self._torque_map)
            checker.report(
                ~np.isfinite(torque).all(axis=1),
                first,
                "not_finite",
                "joint torques are missing or not finite",
                rows,
            )
        if self._base:
            assert self._base_map is not None
            values = table(self._base)
            held.add("base_wrench", values, qd)
            base = self._base_map.wrench(values)
            checker.report(
                ~np.isfinite(base).all(axis=1),
                first,
                "not_finite",
                "base_wrench is missing or not finite",
                rows,
            )
        wrenches = {}
        for field, link in self._links.items():
            values = table(link.columns)
            held.add(field, values, qd)
            wrenches[field] = link.frame.wrenches(q, values)
            finite = np.isfinite(wrenches[field]).all(axis=1)
            checker.report(~finite, first, "not_finite", f"{field} is missing or not finite", rows)
        links = as_fields(wrenches)
        return Recording(
            self.name, t[rows], q, qd, torque, base, links["wrist_wrench"], first + rows.astype(np.int64),
            link_wrenches=links["link_wrenches"] or {},
        )  # fmt: skip

    def _signal(self, values: np.ndarray, source: TorqueMap) -> np.ndarray:
        width = self._joints if len(source.fields) == 1 else 1
        fields = {name: values[:, i * width : (i + 1) * width] for i, name in enumerate(source.names)}
        return source.torque(fields)


def _listed(names: list[str]) -> str:
    more = f" and {len(names) - 24} more" if len(names) > 24 else ""
    return ", ".join(names[:24]) + more


class _LinkColumns(NamedTuple):
    """The columns of one link sensor."""

    columns: list[str]
    frame: LinkSensorFrame
    late: float
    """Its delay [s]."""


class _Pending:
    """Shifts the readings of the force/torque sensors by their delays: a reading belongs to the instant
    `late` before its arrival.

    Rows wait until the readings for their instant have arrived; as many before them are kept, because a delay
    may be negative. A clock that was set back begins a new stretch, whose readings are its own. They wait for
    `SLOWEST` longer, since a sensor that is slower than the rows has its next reading only then.
    """

    def __init__(self, late: float, links: Mapping[str, _LinkColumns]) -> None:
        """`late`: delay of the base sensor [s]; `links`: the link sensors."""
        self._late = late
        self._links = {field: link for field, link in links.items() if link.late != 0.0}
        longest = max([abs(late), *(abs(link.late) for link in self._links.values())])
        self._longest = longest + SLOWEST if longest > 0.0 else 0.0
        self._rest: Recording | None = None
        self._taken = 0  # rows of the rest that have been returned

    def add(self, block: Recording) -> Recording:
        """The rows that are now complete."""
        if self._longest == 0.0:
            # The last block waits: problems at the end of the file are known only after it.
            before, self._rest = self._rest, block
            return block[:0] if before is None else before
        whole = block if self._rest is None else concatenate([self._rest, block], block.name, {})
        if len(whole) == 0:
            self._rest = whole
            return whole
        taken, newest = self._taken, _stretches(whole.t)[-1]
        t = whole.t[newest]
        ready = int(np.searchsorted(t, t[-1] - self._longest))
        kept = newest.start + int(np.searchsorted(t, t[ready] - self._longest))
        ready += newest.start
        self._rest, self._taken = whole[kept:], ready - kept
        return self._shifted(whole)[taken:ready]

    def flush(self) -> Recording | None:
        """The remaining rows at the end."""
        return None if self._rest is None else self._shifted(self._rest)[self._taken :]

    def _shifted(self, part: Recording) -> Recording:
        if len(part) == 0:
            return part
        if self._late != 0.0 and part.base_wrench is not None:
            part = replace(part, base_wrench=_earlier(part.t, part.base_wrench, self._late))
        values = {}
        for field, link in self._links.items():
            reading = link.frame.readings(part.q, part.link_values[field])
            values[field] = link.frame.wrenches(part.q, _earlier(part.t, reading, link.late))
        if not values:
            return part
        links = as_fields(part.link_values | values)
        return replace(part, wrist_wrench=links["wrist_wrench"], link_wrenches=links["link_wrenches"] or {})


def _earlier(t: np.ndarray, values: np.ndarray, late: float) -> np.ndarray:
    """The values, shape (N, 6), that arrive `late` [s] after each of the times t, shape (N,) [s]."""
    found = np.empty_like(values)
    for rows in _stretches(t):
        there = np.isfinite(values[rows]).all(axis=1)
        stamps = t[rows][there] - late
        if is_slower(stamps, t[rows]):
            found[rows] = readings_at(t[rows], stamps, values[rows][there])
            continue
        for i in range(values.shape[1]):
            found[rows, i] = np.interp(t[rows] + late, t[rows], values[rows, i])
    return found


def _stretches(t: np.ndarray) -> list[slice]:
    """The rows between which the clock is not set back; at least one stretch."""
    ends = [0, *(np.flatnonzero(np.diff(t) < 0.0) + 1).tolist(), len(t)]
    return [slice(first, last) for first, last in itertools.pairwise(ends)]


def read(
    path: str | Path,
    scene: Scene | None = None,
    columns: ColumnMapping | str | None = None,
    *,
    first: int = 0,
    last: int | None = None,
) -> Recording:
    """Read a recording.

    Args:
        path: See `RecordingFile`.
        scene: Defines the meaning of the signals; None: the scene stored in the file.
        columns: Names and units that differ from the defaults, see `ColumnMapping.parse`.
        first, last: Range of rows to read, see `RecordingFile.read`.

    Raises:
        RecordingError: The file cannot be read, lacks a column, or contains no scene and none was given.
        MappingError: `columns` cannot be used.
    """
    mapping = columns if isinstance(columns, ColumnMapping) else ColumnMapping.parse(columns)
    if scene is None:
        scene = scene_in(Path(path))
    return RecordingFile(path, scene, mapping).read(first, last)


def scene_in(path: Path) -> Scene:
    """The scene stored in a recording's metadata.

    Raises:
        RecordingError: It contains none.
    """
    from contactsense.service.recordings.metadata import scene_of_meta

    meta = {} if is_bag(path) else open_table(path).meta
    return scene_of_meta(meta, str(path))
