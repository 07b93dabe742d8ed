"""The work on one segment: a function of its arguments that writes its results once."""

import json
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pa_parquet

from contactsense import Localizer
from contactsense.robots.files.whole_file import whole_file
from contactsense.scene import Scene
from contactsense.sensors.timing import LONGEST_FIRST_STEP
from contactsense.service.analysis.analysis import AnalysisRun
from contactsense.service.analysis.contact_table import contact_table
from contactsense.service.analysis.fleet.named_within import named_within
from contactsense.service.analysis.fleet.segment_problems import own_problems
from contactsense.service.analysis.fleet.segments import Segment
from contactsense.service.analysis.followed_rows import FollowedRows
from contactsense.service.analysis.health import unusable_steps
from contactsense.service.analysis.present_sensors import absent_sensors, silent_sensors, without_sensors
from contactsense.service.analysis.residuals.friction_residuals import FrictionResiduals
from contactsense.service.analysis.residuals.residual_statistics import ResidualStatistics
from contactsense.service.recordings import RecordingError, RecordingFile
from contactsense.service.recordings.metadata import carried_scene
from contactsense.service.recordings.signals.cleaning import GAP_STEPS
from contactsense.service.recordings.tables.parquet_files import write_parquet

HELD = 12
"""Whether a contact is active where reading starts shows in one part of so many of the time before the
segment: in 5 s of `contactsense.service.analysis.fleet.segments.WARM_UP`."""
FRICTION = ("coulomb", "viscous", "coulomb_std", "viscous_std")
"""Fields of `contactsense.service.analysis.residuals.friction_residuals.FrictionChange`."""


@dataclass(frozen=True)
class SegmentTask:
    """The input of a worker."""

    segment: Segment
    """The segment."""
    scene: str
    """Path of the scene file."""
    parts: str
    """Folder of the results of all segments."""


def part_path(task: SegmentTask) -> Path:
    """The file that marks a segment as done."""
    segment = task.segment
    return Path(task.parts) / f"{segment.key}-{segment.index:05d}.json"


def run_segment(task: SegmentTask) -> dict[str, Any]:
    """Analyse a segment unless it is already done; returns the content of its JSON file.

    A recording that cannot be read also gives a result: `problem` says why.
    """
    path, segment = part_path(task), task.segment
    own = segment.file
    # Not those of earlier results: the folders above may have named another robot or date then.
    names = {"name": own.name, "robot": own.robot, "date": own.date}
    done = _done(path)
    if done is not None:
        return {**done, **names}
    run = _run(task.scene, task.parts)
    try:
        file = RecordingFile(own.path, run.scene)
        absent = absent_sensors(file, run.scene) | _silent(own.path, segment.key, task.scene, task.parts)
        if absent:
            run = _run(task.scene, task.parts, absent)
        result, table = _analyze(file, segment, run, absent)
    except RecordingError as error:
        reason = named_within(str(error), own.path, own.name)
        result, table = {"problem": reason}, contact_table([])
    result |= {**names, "index": segment.index, "segments": segment.count}
    path.parent.mkdir(parents=True, exist_ok=True)
    # The JSON file is written last: if it exists, the table is complete.
    write_parquet(table, path.with_suffix(".parquet"))
    with whole_file(path) as unfinished:
        unfinished.write_text(json.dumps(result), encoding="utf-8")
    return result


def _done(path: Path) -> dict[str, Any] | None:
    """The result in a JSON file; None without one, or if it or its table are damaged, as by a power cut."""
    try:
        pa_parquet.read_metadata(path.with_suffix(".parquet"))
        return dict(json.loads(path.read_text(encoding="utf-8")))
    except (OSError, ValueError, pa.ArrowException):
        return None


@lru_cache(maxsize=4)
def _run(scene: str, parts: str, absent: frozenset[str] = frozenset()) -> AnalysisRun:
    """One localizer for all segments of a scene without the same sensors; `parts` depends on the content of
    the scene file when work began."""
    loaded = without_sensors(Scene.load(scene), absent)
    return AnalysisRun(loaded, Localizer(loaded))


@lru_cache(maxsize=4)
def _silent(path: Path, key: str, scene: str, parts: str) -> frozenset[str]:
    """Fields of the sensors without a single reading in a recording, for all of its segments; `key` depends
    on its content, `parts` on that of the scene file."""
    known = _run(scene, parts).scene
    return silent_sensors(RecordingFile(path, known), known)


def _begin(file: RecordingFile, segment: Segment, run: AnalysisRun) -> tuple[int, bool]:
    """Row at which reading starts: where nothing touches the arm, as what is learned of biases during a
    contact would be another contact after it. And whether there is such a row, or the recording begins there;
    if not, it is the usual one."""
    warm_up, begin = segment.first - segment.begin, segment.begin
    while begin > 0 and run.begins_touched(file, begin, begin + warm_up // HELD):
        if begin == segment.earliest:
            return segment.begin, False
        begin = max(segment.first - 2 * (segment.first - begin), segment.earliest)
    return begin, True


def _analyze(
    file: RecordingFile, segment: Segment, run: AnalysisRun, absent: frozenset[str]
) -> tuple[dict[str, Any], pa.Table]:
    """Statistics and contacts of the rows that are the segment's own; `absent`: fields of the sensors that
    the recording lacks."""
    begin, is_known = _begin(file, segment, run)
    part = FollowedRows(file, begin, segment.first, segment.last)
    statistics = ResidualStatistics(len(run.scene.robot.joints))
    friction = FrictionResiduals(run.scene)
    contacts = list(run.contacts(part, statistics=statistics, friction=friction))
    t = part.times
    if len(t) == 0:
        raise RecordingError(f"{file.name}: expected samples from row {segment.first} on, got none")
    found = statistics.summary()
    base, torque = run.biases
    has_base, has_torque = (x is not None for x in (run.scene.base_wrench, run.scene.joint_torque))
    change = friction.fit()
    # A contact of which the beginning was not found is no reason to doubt the scene.
    complaints = list(run.complaints if is_known else run.localizer.refusals)
    if not (contacts or found.usable) and (unusable := unusable_steps(_usual_step(t))):
        complaints.append(unusable)
    result = {
        "seconds": _without_gaps(np.maximum(np.diff(t), 0.0)) if contacts or found.usable else 0.0,
        "samples": len(t),
        "absent": sorted(absent),
        "carried_scene": carried_scene(file.meta),
        "problems": own_problems(run.extent.problems, segment.first, segment.last),
        "complaints": complaints,
        "free": found.free,
        "usable": found.usable,
        "touched": found.touched,
        "degraded": found.degraded,
        "base_ratio": _known(found.base_ratio, has_base),
        "joint_ratio": _known(found.joint_ratio, has_torque),
        "base_bias": _known(base, has_base),
        "joint_bias": _known(torque, has_torque),
        "joint_constant": without_nan(change.bias),
        **{name: without_nan(getattr(change, name)) for name in FRICTION},
    }
    table = contact_table(contacts)
    names = pa.array([segment.file.name] * table.num_rows, pa.string())
    return result, table.set_column(0, table.schema.field(0), names)


def _known(values: np.ndarray, is_measured: bool) -> list[float | None]:
    """Values for JSON and tables: None in place of those of a sensor that is not there."""
    return values.tolist() if is_measured else [None] * len(values)


def _usual_step(t: np.ndarray) -> float:
    """Usual time between two samples [s], 0 of a single one; t: their times, shape (N,) [s]."""
    return float(np.median(np.diff(t))) if len(t) > 1 else 0.0


def _without_gaps(step: np.ndarray) -> float:
    """Time in which the arm was watched [s]; step: times between samples, shape (N,) [s]."""
    usual = float(np.median(step)) if len(step) else 0.0
    return float(step[step <= max(LONGEST_FIRST_STEP, GAP_STEPS * usual)].sum())


def without_nan(values: np.ndarray) -> list[float | None]:
    """Values for JSON and tables: None in place of NaN."""
    return [float(x) if np.isfinite(x) else None for x in values]
