"""From a file to a recording: its columns are checked and converted by the scene, block by block."""

from collections.abc import Callable, Iterator, Mapping
from dataclasses import replace
from pathlib import Path

import numpy as np

from contactsense.scene import Scene, check_scene
from contactsense.sensors.link_values import as_fields
from contactsense.service.recordings.file_names import check_name, check_there
from contactsense.service.recordings.problems import RecordingError
from contactsense.service.recordings.recording import BLOCK, Recording, concatenate
from contactsense.service.recordings.ros.bag_files import BagFile, is_bag
from contactsense.service.recordings.signals.cleaning import RowChecker
from contactsense.service.recordings.signals.column_mapping import ColumnMapping
from contactsense.service.recordings.signals.held_values import HeldValues
from contactsense.service.recordings.signals.sensor_delays import DelayedReadings
from contactsense.service.recordings.signals.signal_columns import SignalColumns
from contactsense.service.recordings.signals.velocity_agreement import VelocityAgreement
from contactsense.service.recordings.tables.table import Columns, TableFile, chosen_rows
from contactsense.service.recordings.tables.table_files import open_table
from contactsense.service.sensors.signal_mapping import TorqueMap


class RecordingFile:
    """One recording on disk, read block by block, so that memory use does not depend on its length.

    Args:
        path: CSV (ur_rtde's or UR's own client's), Parquet, Arrow IPC stream, a folder of Parquet files,
            MCAP, or a rosbag2 folder.
        scene: Defines the meaning of the signals: torque signal, frame and sign of the sensors.
        mapping: Names of columns and topics, and units.

    Raises:
        RecordingError: The file cannot be read, or lacks a column that the scene needs.
        TypeError: `path` or `scene` is of another type.
    """

    def __init__(self, path: str | Path, scene: Scene, mapping: ColumnMapping | None = None) -> None:
        if not isinstance(path, str | Path):
            raise TypeError(f"path: expected that of a file, got {type(path).__name__}")
        check_scene(scene)
        self.path = Path(path)
        check_name(self.path)
        check_there(self.path)
        self.name = str(path)
        self._scene, self._mapping = scene, mapping or ColumnMapping()
        self._table: TableFile = (
            BagFile(self.path, self._mapping, scene) if is_bag(self.path) else open_table(self.path)
        )
        self.meta: Mapping[str, str] = self._table.meta
        """Metadata of the file."""
        self._joints = len(scene.robot.joints)
        self._signals = SignalColumns(self.name, scene, self._mapping, self._table)

    @property
    def sensors(self) -> frozenset[str]:
        """Fields of the scene's sensors that the file has."""
        own = {"joint_torque": self._signals.torque, "base_wrench": self._signals.base}
        return frozenset(field for field, columns in own.items() if columns) | self._signals.links.keys()

    @property
    def rows(self) -> int | None:
        """Number of rows, if it is known before the whole file is read."""
        return self._table.rows

    def read(self, first: int = 0, last: int | None = None) -> Recording:
        """Read the recording, or its rows from `first` up to, but not including, `last`."""
        return concatenate(list(self.blocks(BLOCK, first, last)), self.name, self.meta)

    def blocks(
        self,
        size: int = BLOCK,
        first: int = 0,
        last: int | None = None,
        enough: Callable[[], bool] = lambda: False,
    ) -> Iterator[Recording]:
        """The samples in blocks of at most `size`; each carries the problems found since the previous block.

        Args:
            size: Maximum number of samples in a block.
            first, last: Range of rows to read: from `first` up to, but not including, `last`.
            enough: Asked after each block: if it returns True, what has been read by then is the rest.
        """
        checker, held, end = RowChecker(), HeldValues(), 0
        velocities = VelocityAgreement([joint.name for joint in self._scene.robot.joints])
        pending = DelayedReadings(self._signals.base_delay, self._signals.links)
        reported = kept = 0
        for row, columns in chosen_rows(self._table.batches(self._signals.wanted, first, last), first, last):
            # What is not finite is reported, and stays so in every product.
            with np.errstate(invalid="ignore"):
                block = self._converted(columns, row, checker, held)
                velocities.add(block.t, block.q, block.qd)
            end = row + len(columns[self._mapping.timestamp])
            kept += len(block)
            for part in pending.add(block).blocks(size):
                new, reported = tuple(checker.problems[reported:]), len(checker.problems)
                yield replace(part, problems=new, repeated=checker.repeated, meta=self.meta)
            if enough():
                break
        checker.finish()
        rest = pending.flush()
        new = (
            *checker.problems[reported:],
            *held.problems(end),
            *velocities.problems(end),
            *self._signals.absent,
            *self._table.problems,
        )
        if rest is None or not kept:
            why = next((f": {problem}" for problem in (*self._table.problems, *new)), "")
            raise RecordingError(f"{self.name}: expected at least two samples, got none{why}")
        parts = list(rest.blocks(size)) or [rest]
        for part in parts[:-1]:
            yield part
        yield replace(parts[-1], problems=new, repeated=checker.repeated, meta=self.meta)

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

        def measured(field: str, names: list[str]) -> np.ndarray:
            values = table(names)
            held.add(field, values, qd)
            return values

        def check(field: str, values: np.ndarray, verb: str = "is") -> None:
            bad = ~np.isfinite(values).all(axis=1)
            checker.report(bad, first, "not_finite", f"{field} {verb} missing or not finite", rows)

        signals = self._signals
        q, qd = table(signals.q), table(signals.qd)
        if self._mapping.radians != 1.0:
            q, qd = q * self._mapping.radians, qd * self._mapping.radians
        bad = np.asarray(~(np.isfinite(q).all(axis=1) & np.isfinite(qd).all(axis=1)))
        checker.report(bad, first, "not_finite", "joint positions or velocities are not finite", rows)
        torque = base = None
        if signals.torque:
            torque = measured("joint_torque", signals.torque)
            if signals.torque_map is not None:
                torque = self._signal(torque, signals.torque_map)
            check("joint torques", torque, "are")
        if signals.base:
            assert signals.base_map is not None
            base = signals.base_map.wrench(measured("base_wrench", signals.base))
            check("base_wrench", base)
        wrenches = {}
        for field, link in signals.links.items():
            wrenches[field] = link.frame.wrenches(q, measured(field, link.columns))
            check(field, wrenches[field])
        links = as_fields(wrenches)
        return Recording(
            self.name, t[rows], q, qd, torque, base, links["wrist_wrench"], first + rows.astype(np.int64),
            link_wrenches=links["link_wrenches"] or {},
        )  # fmt: skip

    def _signal(self, values: np.ndarray, source: TorqueMap) -> np.ndarray:
        width = self._joints if len(source.fields) == 1 else 1
        fields = {name: values[:, i * width : (i + 1) * width] for i, name in enumerate(source.names)}
        return source.torque(fields)


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
        TypeError: It is of another type.
    """
    if not isinstance(columns, ColumnMapping | str | None):
        raise TypeError(
            f"columns: expected a ColumnMapping, or text such as 'q=joint,time_unit=ms', got {columns!r:.60}"
        )
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

    return scene_of_meta(_meta(path), str(path))


def carried_scene_in(path: Path) -> Scene | None:
    """The same; None if it contains none.

    Raises:
        RecordingError: It cannot be read, or its scene cannot be used.
    """
    from contactsense.service.recordings.metadata import carried_scene, scene_of_meta

    meta = _meta(path)
    return None if carried_scene(meta) is None else scene_of_meta(meta, str(path))


def date_in(path: Path) -> str | None:
    """Day on which a recording began by its metadata, YYYY-MM-DD in UTC; None if it is not known.

    Raises:
        RecordingError: The recording cannot be read.
    """
    from contactsense.service.recordings.metadata import date_of_meta

    return date_of_meta(_meta(path))


def _meta(path: Path) -> dict[str, str]:
    check_name(path)
    check_there(path)
    return {} if is_bag(path) else open_table(path).meta
