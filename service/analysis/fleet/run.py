"""Analysis of a whole dataset: find recordings, process their segments, combine the results."""

import hashlib
from collections import Counter
from collections.abc import Callable, Iterable, Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

from contactsense.scene import Scene
from contactsense.service.analysis.fleet.scenes import RobotScenes, robot_scenes
from contactsense.service.analysis.fleet.segment_task import SegmentTask, run_segment
from contactsense.service.analysis.fleet.segments import SEGMENT_TIME, DatasetFile, find_recordings, segments
from contactsense.service.analysis.fleet.summary import FleetSummary, settings_of, summarize, write_summary
from contactsense.service.analysis.fleet.worker_pool import run_tasks

VERSION = 11
"""Version of the results of a segment; results of another version are not used."""


def analyze_fleet(
    paths: tuple[Path, ...],
    scene: Path | None,
    out: Path,
    *,
    workers: int = 1,
    scheduler: str | None = None,
    progress: Callable[[int, int], None] | None = None,
    length: float = SEGMENT_TIME,
) -> FleetSummary:
    """Analyse all recordings of a dataset; results of an earlier run are reused. Recordings that cannot be
    read, and those of a robot without a scene, are skipped.

    Args:
        paths: Recordings and folders of recordings, such as `robot=NAME/date=DATE/*.parquet`.
        scene: The scene file of all robots, a folder with one for each, or None, see
            `contactsense.service.analysis.fleet.scenes.robot_scenes`.
        out: Folder of the results; `out/parts` holds those of the segments.
        workers: Processes on this machine.
        scheduler: Address of a Dask scheduler to use instead; its workers need access to the same files.
        progress: Called with the number of finished segments and the total.
        length: Length of a segment [s].

    Raises:
        FileNotFoundError: there is no recording.
        SceneError: the scene file of all robots is wrong or missing, or that of each robot is.
        WorkerPoolError: the workers are not available.
        RuntimeError: a segment failed for a reason other than its recording.
    """
    files = find_recordings(paths, out)
    scenes = robot_scenes(scene, files, out / "scenes")
    parts = {robot: _parts(out, one, length) for robot, one in scenes.loaded.items()}
    tasks = [
        SegmentTask(segment, str(scenes.paths[file.robot]), parts[file.robot])
        for file in files
        if file.robot in scenes.paths
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
    summary = summarize(scenes.loaded, tasks, (results[task] for task in tasks))
    summary = replace(
        summary,
        problems=(
            *_left_out(scenes, files),
            *_other_scenes(scenes, list(results.values())),
            *summary.problems,
        ),
        without_scene=tuple(scenes.missing),
        skipped=summary.skipped + sum(file.robot in scenes.missing for file in files),
    )
    write_summary(summary, out)
    return summary


def _left_out(scenes: RobotScenes, files: Iterable[DatasetFile]) -> Iterator[str]:
    """The robots without a scene, one sentence each."""
    counts = Counter(file.robot for file in files)
    for robot, reason in scenes.missing.items():
        count = counts[robot]
        yield f"{reason}; {count} recording{'s were' if count > 1 else ' was'} skipped"


def _other_scenes(scenes: RobotScenes, results: Iterable[dict[str, Any]]) -> Iterator[str]:
    """The robots whose scene is that of one recording while others carry another one, a sentence each."""
    hashes: dict[str, dict[str, str]] = {robot: {} for robot in scenes.carried}
    for result in results:
        if result["robot"] in hashes and result.get("carried_scene") is not None:
            hashes[result["robot"]][result["name"]] = result["carried_scene"]
    for robot, own in hashes.items():
        carrier = scenes.carried[robot]
        others = sorted(name for name, found in own.items() if found != own.get(carrier))
        if others:
            more = f" and {len(others) - 3} more" if len(others) > 3 else ""
            yield (
                f"robot {robot}: {', '.join(others[:3])}{more}: analysed with the scene that {carrier} "
                "carries, not with their own: name one with --scene, or give each arm a folder robot=NAME"
            )


def _parts(out: Path, scene: Scene, length: float) -> str:
    """Folder of the results of the segments of one scene."""
    settings = f"{VERSION} {settings_of(scene)} {length}"
    return str((out / "parts" / hashlib.sha256(settings.encode()).hexdigest()[:16]).resolve())
