"""A whole dataset: find recordings, work through their segments, put the results together."""

import hashlib
from collections.abc import Callable
from pathlib import Path
from typing import Any

from contactsense.scene import Scene
from contactsense.service.analysis.fleet.segment_task import SegmentTask, run_segment
from contactsense.service.analysis.fleet.segments import SEGMENT_TIME, find_recordings, segments
from contactsense.service.analysis.fleet.summary import FleetSummary, settings_of, summarize, write_summary
from contactsense.service.analysis.fleet.worker_pool import run_tasks


def analyze_fleet(
    paths: tuple[Path, ...],
    scene: Path,
    out: Path,
    *,
    workers: int = 1,
    scheduler: str | None = None,
    progress: Callable[[int, int], None] | None = None,
    length: float = SEGMENT_TIME,
) -> FleetSummary:
    """Analyse all recordings of a dataset; what an earlier run has done is not done again.

    Args:
        paths: Recordings and folders of recordings, such as `robot=NAME/date=DATE/*.parquet`.
        scene: The scene file, of all robots.
        out: Folder of the results; `out/parts` holds those of the segments.
        workers: Processes on this machine.
        scheduler: Address of a Dask scheduler to use instead; its workers need to see the same files.
        progress: Called with the numbers of segments done and of all.
        length: Length of a segment [s].

    Raises:
        FileNotFoundError: there is no recording.
        SceneError: the scene file is wrong.
        WorkerPoolError: the workers cannot be had.
        RuntimeError: a segment failed for another reason than its recording.
    """
    settings = f"{settings_of(scene)} {length}"
    parts = out / "parts" / hashlib.sha256(settings.encode()).hexdigest()[:16]
    tasks = [
        SegmentTask(segment, str(scene.resolve()), str(parts.resolve()))
        for file in find_recordings(paths)
        for segment in segments(file, length)
    ]
    results: dict[SegmentTask, dict[str, Any]] = {}
    for task, result in run_tasks(run_segment, tasks, workers, scheduler):
        if isinstance(result, BaseException):
            raise RuntimeError(
                f"{task.segment.file.name}, segment {task.segment.index}: {result}"
            ) from result
        results[task] = result
        if progress is not None:
            progress(len(results), len(tasks))
    summary = summarize(Scene.load(scene), tasks, (results[task] for task in tasks))
    write_summary(summary, out)
    return summary
