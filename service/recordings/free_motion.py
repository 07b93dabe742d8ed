"""Recordings of contact-free motion, in the form that calibration needs."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from contactsense.calibration import FreeMotion
from contactsense.scene import Scene
from contactsense.scene_model.link_sensor_frame import LinkSensorFrame
from contactsense.scene_model.sensor_delays import without_delays
from contactsense.scene_model.wrench_map import WrenchMap
from contactsense.sensors.timing import LONGEST_GAP
from contactsense.service.recordings.problems import Problem, RecordingError
from contactsense.service.recordings.recording_file import RecordingFile
from contactsense.service.recordings.signals.column_mapping import ColumnMapping, unit_hint
from contactsense.service.recordings.time_extent import UNORDERED, UNORDERED_ADVICE

_SHORTEST = 3
"""Minimum number of samples between two clock resets; shorter sections are not used."""
_MOTION = {"q", "qd"}
"""What every sample has."""
_LASTING = 3.0
"""Where a sensor is missing for so long [s], the samples of the others are used; more than calibration and
check need."""


def read_free_motion(
    path: str | Path, scene: Scene, columns: ColumnMapping | str | None = None
) -> tuple[list[FreeMotion], tuple[Problem, ...]]:
    """Read a recording for `contactsense.calibration.calibrate`: one section, or several if the clock was
    reset in between.

    Sensors that are missing from the file or silent throughout are omitted, and so are samples with
    non-finite values of the others. Where one is silent for 3 s or more while others are not, that part of a
    section is one of its own, without this sensor.

    Args:
        path: See `RecordingFile`.
        scene: Defines the meaning of the signals; torques are converted with its torque constants.
        columns: Names and units that differ from the defaults, see `ColumnMapping.parse`.

    Returns:
        The sections, and the problems found in the file.

    Raises:
        RecordingError: The file cannot be read, has no section of three samples, or they are too far apart.
        MappingError: `columns` cannot be used.
    """
    mapping = columns if isinstance(columns, ColumnMapping) else ColumnMapping.parse(columns)
    # Calibration estimates the delays, so readings stay in the row in which they were received.
    scene = without_delays(scene)
    found = RecordingFile(path, scene, mapping).read()
    reading = None
    if found.base_wrench is not None and scene.base_wrench is not None:
        reading = WrenchMap.of(scene.base_wrench).reading(found.base_wrench)
    links = {
        field: LinkSensorFrame(scene, field).readings(found.q, wrenches)
        for field, wrenches in found.link_values.items()
    }
    own = {"joint_torque": found.joint_torque, "base_wrench": reading, **links}
    # Where no sensor has a value there is no reading at all, which is refused below.
    silent = found.sensors - found.heard if found.heard else frozenset()
    sensors = {field: x for field, x in own.items() if x is not None and field not in silent}
    signals = {"q": found.q, "qd": found.qd, **sensors}
    known = {field: np.asarray(np.isfinite(values).all(axis=1)) for field, values in signals.items()}
    finite = np.all(list(known.values()), axis=0)
    resets = np.flatnonzero(np.diff(found.t, prepend=found.t[:1]) < 0.0)
    if len(resets) > UNORDERED * len(found):
        raise RecordingError(
            f"{path}: timestamp: expected rows in the order of time, got {len(resets)} of {len(found)} that "
            f"are earlier than the row before. {UNORDERED_ADVICE}"
        )
    stretches = []
    for rows in np.split(np.arange(len(found)), resets):
        for kept, there in ((rows[finite[rows]], set(sensors)), *_without_some(rows, found.t, known)):
            if len(kept) >= _SHORTEST:
                stretches.append(
                    FreeMotion(
                        found.t[kept],
                        found.q[kept],
                        found.qd[kept],
                        name=str(path),
                        rows=found.rows[kept],
                        **_readings(
                            {field: values[kept] for field, values in sensors.items() if field in there}
                        ),
                    )
                )
    stretches.sort(key=lambda part: part.row_of(0))
    if not stretches:
        # One value that is never there, such as that of a joint whose column is text, costs every row.
        absent = [field for field, rows in known.items() if len(rows) and not rows.any()]
        never = f"; never {', '.join(absent)}" if absent else ""
        times = "once" if len(resets) == 1 else f"{len(resets)} times"
        back = f"; the clock was set back {times}" if len(resets) else ""
        raise RecordingError(
            f"{path}: expected at least {_SHORTEST} samples with finite numbers in all columns and rising "
            f"times, got {int(finite.sum())} of {len(found)} with finite numbers{never}{back}"
        )
    step = float(np.median(np.concatenate([np.diff(part.t) for part in stretches])))
    if step > LONGEST_GAP:
        raise RecordingError(
            f"{path}: timestamp: expected samples at most {LONGEST_GAP:g} s apart, got {step:.3g} s"
            f"{unit_hint(step, LONGEST_GAP)}"
        )
    left_out = (
        Problem(0, 0, "missing_sensor", f"{field}: no row has all its values: it is not used")
        for field in sorted(silent)
    )
    return stretches, (*found.problems, *left_out)


def _without_some(
    rows: np.ndarray, t: np.ndarray, known: Mapping[str, np.ndarray]
) -> list[tuple[np.ndarray, set[str]]]:
    """Rows in succession in which the same sensors, but not all of them, have their values for `_LASTING`,
    with these sensors; `rows`: those of one section, `known`: where each signal has its values, bool."""
    state = np.array([values[rows] for values in known.values()])
    changes = np.flatnonzero((np.diff(state, axis=1) != 0).any(axis=0)) + 1
    found = []
    for run in np.split(rows, changes):
        there = {field for field, values in known.items() if len(run) and values[run[0]]}
        own = there - _MOTION
        if there >= _MOTION and own and len(there) < len(known) and t[run[-1]] - t[run[0]] >= _LASTING:
            found.append((run, own))
    return found


def _readings(sensors: dict[str, np.ndarray]) -> dict[str, Any]:
    """Values by field of the scene as arguments of `FreeMotion`."""
    links = {field: x for field, x in sensors.items() if field not in ("joint_torque", "base_wrench")}
    return {
        "torque": sensors.get("joint_torque"),
        "reading": sensors.get("base_wrench"),
        "link_readings": links,
    }
