"""Recordings and contacts as files: Parquet, CSV, and MCAP for Foxglove and ROS tools."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.csv as pa_csv

from contactsense.robots.extras import install_command
from contactsense.robots.files.whole_file import whole_file
from contactsense.scene import Scene
from contactsense.scene_model.link_sensor_frame import LinkSensorFrame
from contactsense.scene_model.wrench_map import WrenchMap
from contactsense.sensors.link_values import as_fields, column_of
from contactsense.service.recordings.file_format import format_of
from contactsense.service.recordings.file_names import check_name
from contactsense.service.recordings.metadata import metadata
from contactsense.service.recordings.problems import RecordingError
from contactsense.service.recordings.recording import Recording
from contactsense.service.recordings.ros.ros_messages import (
    definitions,
    joint_state,
    scene_update,
    wrench_stamped,
)
from contactsense.service.recordings.tables.parquet_files import write_parquet
from contactsense.service.recordings.tables.table import reason
from contactsense.types import Contact

TABLES = (".parquet", ".csv")
"""Endings of files for tables."""
RECORDINGS = (*TABLES, ".mcap")
"""Endings of files for recordings."""


def write_columns(path: str | Path, columns: Mapping[str, np.ndarray]) -> None:
    """Write columns of a recording; the format follows from the file's name: .parquet or .csv.

    Args:
        path: File to write.
        columns: Name -> values, shape (N,); for the names see `Recording.columns`, but wrenches are written
            as the sensor reads them.

    Raises:
        RecordingError: The format is unknown, or the file cannot be written.
    """
    _write_table(pa.table(dict(columns)), Path(path))


def check_format(path: Path, endings: Sequence[str] = TABLES) -> None:
    """Check the name of a file to be written.

    Raises:
        RecordingError: It tells none of these formats.
    """
    if format_of(path) not in endings:
        *others, last = endings
        raise RecordingError(f"{path}: expected a name that ends in {', '.join(others)} or {last}")


def _write_table(table: pa.Table, path: Path) -> None:
    check_name(path)
    check_format(path)
    if not path.parent.is_dir():  # otherwise the error names a temporary file
        raise RecordingError(f"{path}: there is no folder {path.parent}")
    try:
        if format_of(path) == ".parquet":
            write_parquet(table, path)
        else:
            with whole_file(path) as unfinished:
                pa_csv.write_csv(table, unfinished, pa_csv.WriteOptions(quoting_style="none"))
    except (OSError, pa.ArrowException) as error:
        raise RecordingError(f"{path}: cannot write: {reason(error)}") from None


def export(
    recording: Recording,
    path: Path,
    contacts: Iterable[tuple[float, list[Contact]]] = (),
    scene: Scene | None = None,
) -> None:
    """Write a recording; the format follows from the file's name: .parquet, .csv or .mcap.

    Args:
        recording: Recording to write.
        path: File to write.
        contacts: For MCAP: times [s] and the contacts at each, drawn as arrows in Foxglove's 3D panel.
        scene: Wrenches are written as the sensors of this scene read them, and Parquet carries it: with it
            the file is read back the same, if the recording was read without the sensors' delays. None: in
            base axes about the base origin, for other programs.

    Raises:
        RecordingError: The format is unknown, an extra package is missing, or the file cannot be written.
    """
    check_name(path)
    check_format(path, RECORDINGS)
    if scene is not None:
        recording = _as_read(recording, scene)
    if format_of(path) != ".mcap":
        described = {} if scene is None else metadata(scene)
        _write_table(recording.to_arrow().replace_schema_metadata(described), path)
        return
    try:
        _mcap(recording, path, contacts, in_base_axes=scene is None)
    except OSError as error:
        raise RecordingError(f"{path}: cannot write: {reason(error)}") from None


def _as_read(recording: Recording, scene: Scene) -> Recording:
    """The same with the readings of the sensors, in their own frames, in place of the wrenches."""
    base = recording.base_wrench
    if base is not None and scene.base_wrench is not None:
        base = WrenchMap.of(scene.base_wrench).reading(base)
    links = as_fields(
        {
            field: LinkSensorFrame(scene, field).readings(recording.q, values)
            for field, values in recording.link_values.items()
        }
    )
    return replace(
        recording,
        base_wrench=base,
        wrist_wrench=links["wrist_wrench"],
        link_wrenches=links["link_wrenches"] or {},
    )


def _mcap(
    recording: Recording, path: Path, contacts: Iterable[tuple[float, list[Contact]]], *, in_base_axes: bool
) -> None:
    try:
        from mcap_ros2.writer import Writer

        defined = definitions()
    except ImportError as error:
        raise RecordingError(
            f"{path}: writing MCAP needs extra packages: {install_command('mcap')} ({error.name})"
        ) from None
    with whole_file(path) as unfinished, unfinished.open("wb") as file:
        writer: Any = Writer(file)
        joints, wrenches, scenes = (writer.register_msgdef(kind, text) for kind, text in defined.items())
        names = [f"joint_{i}" for i in range(recording.q.shape[1])]

        def write(topic: str, schema: Any, message: dict[str, Any], t: float) -> None:
            stamp = round(1e9 * t)
            writer.write_message(topic, schema, message, log_time=stamp, publish_time=stamp)

        links = ((column_of(field), values) for field, values in recording.link_values.items())
        sensors = (("base_wrench", recording.base_wrench), *links)
        for i, t in enumerate(recording.t.tolist()):
            torque = None if recording.joint_torque is None else recording.joint_torque[i]
            message = joint_state(t, names, recording.q[i], recording.qd[i], torque)
            write("/joint_states", joints, message, t)
            for sensor, values in sensors:
                if values is not None and np.isfinite(values[i]).all():
                    frame = "base" if in_base_axes else sensor
                    write(f"/{sensor}", wrenches, wrench_stamped(t, values[i], frame), t)
        for t, found in contacts:
            write("/contacts", scenes, scene_update(t, found), t)
        writer.finish()
