"""Tables from MCAP files and rosbag2 folders: JointState and WrenchStamped messages become columns.

Rows are those of the JointState messages that have the arm's joints; for wrenches see `reading_times`. These
files are read as a whole. From a truncated file, or a folder without `metadata.yaml`, all readable messages
are used.
"""

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

from contactsense.robots.extras import install_command
from contactsense.scene import Scene
from contactsense.sensors.link_values import column_of
from contactsense.service.recordings.file_format import format_of
from contactsense.service.recordings.problems import Problem, RecordingError
from contactsense.service.recordings.ros.cut_bags import (
    STORAGE,
    raw_messages,
    readable_by_rosbags,
    storage_files,
)
from contactsense.service.recordings.ros.joint_order import joint_order
from contactsense.service.recordings.signals.column_mapping import ColumnMapping
from contactsense.service.recordings.signals.reading_times import readings_at
from contactsense.service.recordings.tables.table import Columns

_JOINT_STATE = "JointState"


def is_bag(path: Path) -> bool:
    """Whether a path is an MCAP file, a rosbag2 database, or a rosbag2 folder. A folder of Parquet files is
    none, though one of them may have been converted to MCAP."""
    if path.is_dir():
        if (path / "metadata.yaml").exists():
            return True
        return bool(storage_files(path)) and all(format_of(file) != ".parquet" for file in path.iterdir())
    return format_of(path) in STORAGE


class BagFile:
    """One bag as a table with the columns of `ColumnMapping`'s defaults."""

    def __init__(self, path: Path, mapping: ColumnMapping, scene: Scene) -> None:
        """Read all messages of the mapped topics, and of those of the scene's sensors within the arm.

        Raises:
            RecordingError: The file cannot be read, or a topic or an extra package is missing.
        """
        self._path = path
        self.problems: list[Problem] = []
        self.meta: dict[str, str] = {}
        topics = {"base_wrench": mapping.base_wrench_topic, "wrist_wrench": mapping.wrist_wrench_topic}
        columns = (column_of(field) for field in scene.link_sensors)
        topics |= {column: f"/{column}" for column in columns if column not in topics}
        messages, found = self._messages((mapping.joint_states, *topics.values()))
        listed = "; ".join(f"{topic} ({kind})" for topic, kind in sorted(found.items())) or "no topics"
        joint = messages.get(mapping.joint_states, [])
        if not joint and found.get(mapping.joint_states, "").endswith(_JOINT_STATE):
            why = "".join(f": {problem.message}" for problem in self.problems)
            raise RecordingError(
                f"{path}: expected {_JOINT_STATE} messages on {mapping.joint_states}, found none that can be "
                f"read{why}"
            )
        if not joint or not hasattr(joint[0], "position"):
            raise RecordingError(
                f"{path}: expected {_JOINT_STATE} messages on {mapping.joint_states}, found {listed}; "
                "--columns joint_states=TOPIC names another topic"
            )
        self._columns = self._joint_columns(joint, mapping, [j.name for j in scene.robot.joints])
        t = self._columns["timestamp"]
        sensors = {column_of(field) for field in scene.link_sensors}
        sensors |= {"base_wrench"} if scene.base_wrench is not None else set()
        for prefix, topic in topics.items():
            came = messages.get(topic, [])
            if came and hasattr(came[0], "header") and hasattr(came[0], "wrench"):
                stamps, values = _wrenches(came)
                at_rows = readings_at(t, stamps, values)
                if prefix in sensors and np.isnan(at_rows).all():
                    self._report_sensor(
                        f"{topic}: expected stamps within those of {mapping.joint_states}, {_span(t)}, got "
                        f"{_span(stamps)}: are the clocks set differently, or header.stamp not at all?"
                    )
                self._columns |= {f"{prefix}_{i}": at_rows[:, i] for i in range(6)}
            elif came or f"{prefix}_topic" in mapping.model_fields_set:
                raise RecordingError(f"{path}: expected WrenchStamped messages on {topic}, found {listed}")
            elif prefix in sensors:
                named = f"{prefix}_topic" in ColumnMapping.model_fields
                advice = f"; --columns {prefix}_topic=TOPIC names another topic" if named else ""
                self._report_sensor(f"no WrenchStamped messages on {topic}, found {listed}{advice}")
        self.names, self.others = list(self._columns), list[str]()
        self.rows: int | None = len(t)

    def batches(
        self, names: list[str], first: int = 0, last: int | None = None
    ) -> Iterator[tuple[int, Columns]]:
        """The whole table at once."""
        yield 0, {name: self._columns[name] for name in names}

    def _report_sensor(self, message: str) -> None:
        self.problems.append(Problem(0, 0, "missing_sensor", message))

    def _messages(self, wanted: tuple[str, ...]) -> tuple[dict[str, list[Any]], dict[str, str]]:
        try:
            from rosbags.highlevel import AnyReader
            from rosbags.typesys import Stores, get_typestore
        except ImportError as error:
            raise RecordingError(
                f"{self._path}: reading MCAP and rosbag2 needs extra packages: "
                f"{install_command('mcap')} ({error.name})"
            ) from None
        messages: dict[str, list[Any]] = {}
        store = get_typestore(Stores.ROS2_HUMBLE)
        if self._path.is_dir() and not (self._path / "metadata.yaml").exists():
            return self._rest(wanted, store, "metadata.yaml is missing")
        if not readable_by_rosbags(self._path):
            return self._rest(wanted, store)
        try:
            with AnyReader([self._path], default_typestore=store) as reader:
                found = {c.topic: c.msgtype for c in reader.connections}
                chosen = [c for c in reader.connections if c.topic in wanted]
                for connection, _, raw in reader.messages(chosen):
                    messages.setdefault(connection.topic, []).append(
                        reader.deserialize(raw, connection.msgtype)
                    )
        except Exception as error:  # of any package that has a part in reading it: the bag is damaged
            return self._rest(wanted, store, str(error) or type(error).__name__)
        return messages, found

    def _rest(
        self, wanted: tuple[str, ...], store: Any, *problems: str
    ) -> tuple[dict[str, list[Any]], dict[str, str]]:
        """The readable part of a bag that may be truncated; `problems` say why it is.

        Raises:
            RecordingError: No message can be read.
        """
        told = list(problems)
        messages: dict[str, list[Any]] = {}
        found: dict[str, str] = {}
        for file in storage_files(self._path):
            damaged = 0
            try:
                for topic, kind, data in raw_messages(file):
                    found[topic] = kind
                    if topic in wanted:
                        message = _deserialized(store, data, kind)
                        of_topic = messages.setdefault(topic, [])
                        if message is None:
                            damaged += 1
                        else:
                            of_topic.append(message)
            except (OSError, ValueError, KeyError) as error:
                told.append(f"{file.name}: {error}")
            if damaged:
                told.append(f"{file.name}: {damaged} of its messages cannot be read")
        problem = "; ".join(told)
        if problem and not found:
            raise RecordingError(f"{self._path}: cannot read the recording: {problem}")
        if problem:
            row = len(messages.get(wanted[0], []))
            self.problems.append(Problem(row, row, "cut_short", f"the bag is incomplete: {problem}"))
        return messages, found

    def _joint_columns(self, messages: list[Any], mapping: ColumnMapping, arm: list[str]) -> Columns:
        """Columns of the messages that have the arm's joints: a gripper may publish its own on the same
        topic.

        Raises:
            RecordingError: None has them.
        """
        orders: dict[tuple[str, ...], list[int] | None] = {}
        chosen: list[tuple[Any, list[int]]] = []
        for message in messages:
            names = _joint_names(message)
            if names not in orders:
                orders[names] = joint_order(names, arm, mapping.joint_names)
            order = orders[names]
            if order is not None:
                chosen.append((message, order))
        if not chosen:
            got = "; ".join(", ".join(names) for names in orders)
            raise RecordingError(
                f"{self._path}: {mapping.joint_states}: expected the joints "
                f"{', '.join(mapping.joint_names or arm)}, got {got}; joint_names: [A, B] in a YAML file for "
                "--columns names them in the order of the arm"
            )
        t = np.array([_stamp(m) for m, _ in chosen])
        if len(t) > 1 and (t == t[0]).all():
            raise RecordingError(
                f"{self._path}: {mapping.joint_states}: expected messages whose header.stamp rises, got "
                f"{t[0]:.3f} s in all {len(t)}; set it to the time of the measurement"
            )
        columns: Columns = {"timestamp": t}
        parts = (("actual_q", "position"), ("actual_qd", "velocity"), ("joint_torque", "effort"))
        for prefix, field in parts:
            rows = [_values(message, field, order) for message, order in chosen]
            if any(len(getattr(message, field)) for message, _ in chosen):
                table = np.array(rows)
                columns |= {f"{prefix}_{i}": table[:, i] for i in range(table.shape[1])}
        return columns


def _deserialized(store: Any, data: bytes, kind: str) -> Any:
    """A message; None if it is damaged or of a kind that is not known."""
    try:
        return store.deserialize_cdr(data, kind)
    except Exception:  # damaged lengths raise errors of many kinds
        return None


def _joint_names(message: Any) -> tuple[str, ...]:
    return tuple(message.name) or tuple(f"unnamed {i}" for i in range(len(message.position)))


def _values(message: Any, field: str, order: list[int]) -> np.ndarray:
    """Values of the arm's joints; NaN where the message does not have them."""
    row = np.asarray(getattr(message, field), dtype=float)
    return row[order] if len(row) == len(_joint_names(message)) else np.full(len(order), np.nan)


def _stamp(message: Any) -> float:
    return float(message.header.stamp.sec) + 1e-9 * float(message.header.stamp.nanosec)


def _span(stamps: np.ndarray) -> str:
    return f"{stamps.min():.3f} to {stamps.max():.3f} s"


def _wrenches(messages: list[Any]) -> tuple[np.ndarray, np.ndarray]:
    """Time stamps in ascending order, shape (N,), and force then moment, shape (N, 6)."""
    stamps = np.array([_stamp(m) for m in messages])
    forces = [(m.wrench.force.x, m.wrench.force.y, m.wrench.force.z) for m in messages]
    moments = [(m.wrench.torque.x, m.wrench.torque.y, m.wrench.torque.z) for m in messages]
    values = np.hstack((np.array(forces), np.array(moments)))
    order = np.argsort(stamps, kind="stable")
    return stamps[order], values[order]
