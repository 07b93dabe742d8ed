"""Which columns of a file carry which signal of the scene."""

from typing import NamedTuple

from contactsense.scene import Scene
from contactsense.scene_model.link_sensor_frame import LinkSensorFrame
from contactsense.scene_model.wrench_map import WrenchMap
from contactsense.sensors.settings import CURRENTS
from contactsense.service.recordings.metadata import (
    is_raw,
    other_arm,
    recorded_scene,
    removed_delays_of_meta,
)
from contactsense.service.recordings.problems import Problem, RecordingError
from contactsense.service.recordings.signals.column_mapping import ColumnMapping, expand
from contactsense.service.recordings.tables.table import TableFile
from contactsense.service.sensors.clients.robot_stream import SensorError
from contactsense.service.sensors.signal_mapping import TorqueMap


class LinkColumns(NamedTuple):
    """The columns of one link sensor."""

    columns: list[str]
    frame: LinkSensorFrame
    delay: float
    """Of its readings, as far as it has not been taken off already [s]."""


class SignalColumns:
    """The columns of each signal, and how they are converted.

    Args:
        name: Name of the recording, for messages.
        scene: Defines the meaning of the signals.
        mapping: Names of columns and topics, and units.
        table: The table of the recording.

    Raises:
        RecordingError: A column that the scene needs is missing.
    """

    def __init__(self, name: str, scene: Scene, mapping: ColumnMapping, table: TableFile) -> None:
        self._name, self._scene, self._mapping, self._table = name, scene, mapping, table
        self._joints = len(scene.robot.joints)
        names, n = table.names, self._joints
        self.absent: list[Problem] = []
        """Sensors of the scene that the file does not have, or not as the scene says."""
        if mapping.timestamp not in names:
            if {"tick", "arrival", "base_wrench_0"} <= set(names):
                raise RecordingError(
                    f"{self._name}: expected a table of samples, got one of force/torque readings; "
                    "`contactsense record` writes both, samples-*.parquet and wrench-*.parquet"
                )
            self._missing("timestamp", mapping.timestamp)
        if changed := other_arm(table.meta, scene):
            self.absent.append(Problem(0, 0, "other_arm", changed))
        self.q: list[str] = self._group("q", mapping.q, n)
        if f"{mapping.q[0]}_{n}" in names and self.q != list(mapping.q):
            raise RecordingError(
                f"{self._name}: q: expected {n} columns, one for each joint of {self._scene.robot.name}, "
                f"found {mapping.q[0]}_{n} as well; is it another arm? A YAML file for --columns names "
                "those that are meant: q: [A, B]"
            )
        self.qd = self._group("qd", mapping.qd, n)
        self.torque, self.torque_map = self._torque_columns()
        removed = removed_delays_of_meta(table.meta, name)
        base = self._scene.base_wrench
        self.base = self._optional("base_wrench", mapping.base_wrench, base is not None)
        self.links: dict[str, LinkColumns] = {}
        """Field of a link sensor -> its columns."""
        for field, sensor in self._scene.link_sensors.items():
            columns = self._optional(field, mapping.of_link_sensor(field), True)
            if columns:
                frame = LinkSensorFrame(self._scene, field)
                self.links[field] = LinkColumns(columns, frame, sensor.delay - removed.get(field, 0.0))
        self._note_other_sensors()
        self.base_map = None if base is None else WrenchMap.of(base)
        """Conversion of the base sensor's readings; None without one in the scene."""
        self.base_delay = 0.0
        """Delay of the base sensor, as far as it has not been taken off already [s]."""
        if base is not None and self.base:
            self.base_delay = base.delay - removed.get("base_wrench", 0.0)
        if not (self.torque or self.base):
            raise RecordingError(
                f"{self._name}: expected columns of joint torques or of the base sensor, got neither; "
                f"found {self._found()}{self._other_signal()}"
            )
        wanted = [mapping.timestamp, *self.q, *self.qd, *self.torque, *self.base]
        wanted += [column for link in self.links.values() for column in link.columns]
        self.wanted = list(dict.fromkeys(wanted))
        """All columns that are read."""

    def _torque_columns(self) -> tuple[list[str], TorqueMap | None]:
        """Columns that contain the torque signals, and their conversion; None if they are joint torques of
        the scene [Nm]."""
        sensor, names, n = self._scene.joint_torque, self._table.names, self._joints
        if sensor is None:
            return [], None
        if self._mapping.joint_torque is not None:
            if sensor.signal in CURRENTS:
                message = (
                    f"--columns names joint_torque, which is taken as Nm; columns of {sensor.signal} [A] "
                    "with other names go into joint_torque.fields of the scene"
                )
                self.absent.append(Problem(0, 0, "other_torques", message))
            return self._group("joint_torque", self._mapping.joint_torque, n), None
        own = expand(("joint_torque",), n, names)
        has_own = all(name in names for name in own)
        raw_first = sensor.fields is not None or is_raw(self._table.meta)
        if has_own and not raw_first:
            return own, self._of_this_scene(own)
        try:
            source = TorqueMap.of(self._scene)
        except SensorError as error:
            if has_own:
                return own, None
            raise RecordingError(f"{self._name}: {error}") from None
        assert source is not None
        columns = [column for name in source.names for column in self._columns_of(name, source)]
        if any(column not in names for column in columns):
            if has_own:  # converted before
                return own, self._of_this_scene(own)
            for part in (own, columns):
                if any(column in names for column in part):
                    self._missing("joint_torque", next(c for c in part if c not in names))
            message = f"no {own[0]} ... nor {columns[0]} ... ({sensor.signal}): joint torques are not used"
            message += self._other_signal()
            self.absent.append(Problem(0, 0, "missing_sensor", message))
            return [], None
        return columns, source

    def _note_other_sensors(self) -> None:
        """Note columns that were named for sensors which the scene does not have."""
        mapping, scene = self._mapping, self._scene
        named = {
            "joint_torque": mapping.joint_torque is not None,
            **{field: mapping.states(field) for field in ("base_wrench", "wrist_wrench")},
            **{f"link_wrenches.{name}": True for name in mapping.link_wrenches},
        }
        there = {"joint_torque": scene.joint_torque, "base_wrench": scene.base_wrench, **scene.link_sensors}
        for field, is_named in named.items():
            if is_named and there.get(field) is None:
                message = f"--columns names {field}, but the scene has no such sensor: it is not used"
                self.absent.append(Problem(0, 0, "not_in_scene", message))

    def _of_this_scene(self, own: list[str]) -> TorqueMap | None:
        """Conversion of joint torques that a scene with another sign or other constants has made; None if
        there is nothing to convert. Those of another signal are noted: they have other contents."""
        recorded = recorded_scene(self._table.meta)
        if recorded is None:
            return None
        try:
            before, now = TorqueMap.of(recorded), TorqueMap.of(self._scene)
        except SensorError:
            return None
        if before is None or now is None or before.is_as(now):
            return None
        if before.names == now.names:
            return TorqueMap(tuple(own), (), now.scale / before.scale)
        message = (
            "joint torques are those of the scene in the file: its joint_torque.signal is not that of this "
            "scene, which has no effect"
        )
        self.absent.append(Problem(0, 0, "other_torques", message))
        return None

    def _other_signal(self) -> str:
        """Advice where the file has another torque signal than the scene states."""
        sensor = self._scene.joint_torque
        for signal in ("actual_current_as_torque", "actual_current"):
            if sensor is not None and signal != sensor.signal and f"{signal}_0" in self._table.names:
                return f"; for {signal}, the scene needs `joint_torque: {{signal: {signal}}}`"
        if sensor is not None and sensor.fields is None and sensor.signal in CURRENTS:
            return f"; columns of {sensor.signal} with other names go into joint_torque.fields of the scene"
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
        self.absent.append(Problem(0, 0, "missing_sensor", message))
        return []

    def _missing(self, name: str, column: str) -> None:
        each = "" if name == "timestamp" else f", a YAML file one column for each value: {name}: [A, B]"
        raise RecordingError(
            f"{self._name}: {name}: expected a column {column}, found {self._found()}; "
            f"--columns {name}=NAME names another{each}"
        )

    def _found(self) -> str:
        names, others = self._table.names, self._table.others
        found = _listed(names) if names else "none with numbers"
        return f"{found}; no columns of numbers: {_listed(others)}" if others else found


def _listed(names: list[str]) -> str:
    more = f" and {len(names) - 24} more" if len(names) > 24 else ""
    return ", ".join(names[:24]) + more
