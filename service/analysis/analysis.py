"""`analyze`: finds the contacts in a recording."""

from collections import deque
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa

from contactsense import BlockEstimates, Localizer, SampleBlock
from contactsense.runtime.block_runner import MAX_BLOCK
from contactsense.scene import Scene, check_scene
from contactsense.service.analysis.contact_table import contact_table
from contactsense.service.analysis.followed_rows import FollowedRows
from contactsense.service.analysis.present_sensors import (
    absent_sensors,
    in_scene,
    silent_sensors,
    without_sensors,
)
from contactsense.service.analysis.residuals.friction_residuals import FrictionResiduals
from contactsense.service.analysis.residuals.residual_statistics import ResidualStatistics, ResidualSummary
from contactsense.service.analysis.sample_table import sample_table
from contactsense.service.analysis.samples.contact_history import SENSED, ContactCollector, ContactHistory
from contactsense.service.analysis.smoothing.contact_smoothing import ContactSmoother
from contactsense.service.analysis.summary.contact_summary import ContactSummary
from contactsense.service.analysis.summary.force_limits import ForceLimits
from contactsense.service.analysis.summary.summarize import Summarizer
from contactsense.service.recordings import Recording, RecordingError
from contactsense.service.recordings.problem_lines import problem_lines
from contactsense.service.recordings.problems import Problem
from contactsense.service.recordings.recording_file import RecordingFile
from contactsense.service.recordings.time_extent import TimeExtent


@dataclass(frozen=True, eq=False)
class Analysis:
    """The contacts in one recording, and how well the model fits it."""

    scene: Scene
    """The scene it was analysed with."""
    recording: str
    """The file."""
    samples: int
    """Number of samples."""
    start: float
    """Time of the first sample on the robot's clock [s]."""
    duration: float
    """From the first sample to the last [s]."""
    gaps: int
    """Gaps in time."""
    problems: tuple[str, ...]
    """Problems found in the file, one sentence each."""
    contacts: tuple[ContactSummary, ...]
    """The contacts, in the order in which they began."""
    residuals: ResidualSummary
    """Residuals and their noise."""
    is_ordered: bool = True
    """Whether the rows are in the order of time, see
    `contactsense.service.recordings.time_extent.TimeExtent`."""
    doubt: str = ""
    """Why the scene is in doubt, see `contactsense.Localizer.doubt`; one of `problems`, empty if there is no
    doubt."""
    gap_seconds: float = 0.0
    """How long the gaps last together [s]."""
    limits: ForceLimits | None = None
    """The limits that forces are compared with."""
    estimates: pa.Table | None = None
    """Estimates and residuals of every sample, if they were requested, see
    `contactsense.service.analysis.sample_table.sample_table`."""

    def __repr__(self) -> str:
        return (
            f"<analysis of {self.recording}: {self.samples} samples, {self.duration:.1f} s, "
            f"{len(self.contacts)} contacts>"
        )

    @property
    def judged(self) -> bool:
        """Whether any sample could be used. If none could, or the rows are in no order of time, no contacts
        does not mean that nothing touched the arm."""
        return self.is_ordered and (bool(self.contacts) or self.residuals.usable > 0)

    @property
    def step(self) -> float:
        """Mean time between two samples, without the gaps [s]."""
        return max(self.duration - self.gap_seconds, 0.0) / max(self.samples - 1 - self.gaps, 1)

    def to_arrow(self) -> pa.Table:
        """The contacts as an Arrow table, see `contactsense.service.analysis.contact_table.SCHEMA`."""
        return contact_table(self.contacts)

    def to_pandas(self) -> Any:
        """The contacts as a pandas table; needs pandas."""
        return self.to_arrow().to_pandas()

    def plot(self) -> Any:
        """The timeline of forces as a Matplotlib figure."""
        from contactsense.service.analysis.timeline_figure import timeline_figure

        return timeline_figure(self.contacts, self.residuals)


def analyze(
    recording: Recording | RecordingFile | str | Path,
    scene: Scene,
    *,
    estimates: bool = False,
    limits: ForceLimits | None = None,
    smooth: bool = True,
    progress: Callable[[int], None] | None = None,
    localizer: Localizer | None = None,
) -> Analysis:
    """Find the contacts of a recording.

    Args:
        recording: The recording, or its file, which is read block by block: memory use does not depend on its
            length.
        scene: The arm, its mounting and its sensors. Sensors that the recording lacks are left out.
        estimates: Keep the estimates and residuals of every sample, about 400 bytes each.
        limits: Limits to compare forces with.
        smooth: Determine link and place of each contact from all of its samples together.
        progress: Called with the number of samples done since it was last called.
        localizer: A localizer of the same scene to reuse; not used if the recording lacks a sensor.

    Raises:
        RecordingError: the file cannot be read or lacks a column.
        TypeError: `recording`, `scene` or `limits` is of another type.
        ValueError: `localizer` is one of another scene.
    """
    check_scene(scene)
    if not isinstance(limits, ForceLimits | None):
        raise TypeError(f"limits: expected ForceLimits, as ForceLimits.load returns, got {limits!r:.60}")
    if localizer is not None and localizer.scene != scene:
        raise ValueError("localizer: expected one of the same scene, got one of another")
    if not isinstance(recording, Recording | RecordingFile):
        if not isinstance(recording, str | Path):
            raise TypeError(
                "recording: expected a Recording, as contactsense.service.recordings.read returns it, or the "
                f"path of a file, got {type(recording).__name__}"
            )
        recording = RecordingFile(recording, scene)
    tables: list[pa.Table] = []

    def keep(table: pa.Table) -> None:
        tables.append(table)

    absent = absent_sensors(recording, scene) | silent_sensors(recording, scene)
    scene = without_sensors(scene, absent)
    run = AnalysisRun(scene, None if absent else localizer, smooth)
    contacts = tuple(run.contacts(recording, keep if estimates else None, progress))
    gaps = [problem.size for problem in run.extent.problems if problem.kind == "gap"]
    return Analysis(
        scene=scene,
        recording=recording.name,
        samples=run.extent.samples,
        start=run.extent.start,
        duration=run.extent.seconds,
        is_ordered=run.extent.is_ordered,
        gaps=len(gaps),
        gap_seconds=sum(gaps),
        problems=(*problem_lines(run.extent.problems), *run.complaints),
        contacts=contacts if run.extent.is_ordered else (),  # each step back begins another stream
        residuals=run.residuals.summary(),
        doubt=run.localizer.doubt,
        limits=limits,
        estimates=pa.concat_tables(tables) if tables else None,
    )


@dataclass
class Extent(TimeExtent):
    """The part of a recording that has been processed."""

    problems: tuple[Problem, ...] = ()
    """Problems found in the file."""


class AnalysisRun:
    """One pass through a recording; keeps the localizer for the next one."""

    scene: Scene
    """The scene."""
    residuals: ResidualStatistics
    """Residual statistics of the last recording."""
    extent: Extent
    """What has been processed of it."""
    biases: tuple[np.ndarray, np.ndarray]
    """The localizer's estimates of the biases of base wrench (6,) and joint torques (n,) at its end."""

    def __init__(self, scene: Scene, localizer: Localizer | None = None, smooth: bool = True) -> None:
        """Prepare for `scene`."""
        self.localizer = localizer or Localizer(scene)
        self.scene = scene
        self._summarizer = Summarizer(scene)
        self._smooth = smooth
        self._smoothers: dict[frozenset[str], ContactSmoother | None] = {}

    @property
    def complaints(self) -> tuple[str, ...]:
        """What in the last recording contradicts sensors and scene, one sentence each."""
        doubt = self.localizer.doubt
        return (*self.localizer.refusals, *((doubt,) if doubt else ()))

    def begins_touched(self, file: RecordingFile, first: int, last: int) -> bool:
        """Whether the samples of these rows, from `first` up to, but not including, `last`, are not those of
        a free arm from the first one on; not if none of them can be used."""
        try:
            for _ in self.localizer.run_blocks(file.read(first, last).sample_blocks()):
                pass
        except RecordingError:
            return False
        return bool(self.localizer.doubt)

    def contacts(
        self,
        recording: Recording | RecordingFile | FollowedRows,
        keep: Callable[[pa.Table], None] | None = None,
        progress: Callable[[int], None] | None = None,
        *,
        statistics: ResidualStatistics | None = None,
        friction: FrictionResiduals | None = None,
    ) -> Iterator[ContactSummary]:
        """The contacts of a recording, each as soon as it has ended.

        Args:
            recording: The recording, or a part of it: only its own contacts and residuals count then.
            keep: Receives the tables of all samples.
            progress: Called with the number of samples processed since the last call.
            statistics: Collects the residuals instead of `residuals`.
            friction: Collects the same residuals.
        """
        name, joints = recording.name, len(self.scene.robot.joints)
        span = _span(recording)
        self.residuals = statistics or ResidualStatistics(joints, *span)
        self.extent = Extent(problems=recording.problems if isinstance(recording, Recording) else ())
        own = recording if isinstance(recording, FollowedRows) else None
        collector = ContactCollector(self.scene.bandwidth)
        for rows, block, found in self._blocks(recording):
            if own is None or own.has(int(rows[0])):
                self.residuals.add(found)
                if friction is not None:
                    friction.add(block, found)
                self.biases = self.localizer.biases
            if own is not None:
                own.pass_block(rows, block.t)
            if keep is not None:
                keep(sample_table(rows, found, self.scene))
            for history in collector.add(rows, block, found):
                if own is None or own.keeps(int(history.row[0])):
                    yield self._finish(history, name)
            if progress is not None:
                progress(len(found))
            if own is not None:
                own.end_unless(collector.open_since)
        for history in collector.end():
            if own is None or own.keeps(int(history.row[0])):
                yield self._finish(history, name)

    def _blocks(
        self, recording: Recording | RecordingFile | FollowedRows
    ) -> Iterator[tuple[np.ndarray, SampleBlock, BlockEstimates]]:
        """Rows of each block in the file, the block, and its estimates."""
        taken: deque[tuple[np.ndarray, SampleBlock]] = deque()

        def blocks() -> Iterator[SampleBlock]:
            for part in recording.blocks():
                self.extent.add(part.t)
                # Slices of a recording carry the problems of the whole recording.
                if not isinstance(recording, Recording):
                    self.extent.problems += part.problems
                at = 0
                for block in part.sample_blocks(MAX_BLOCK):
                    taken.append((part.rows[at : at + len(block)], block))
                    yield block
                    at += len(block)

        for found in self.localizer.run_blocks(blocks()):
            yield *taken.popleft(), found

    def _finish(self, history: ContactHistory, name: str) -> ContactSummary:
        contact = self._summarizer.summarize(history, name)
        if not self._smooth:
            return contact
        smoother = self._smoother_for(history.sensed)
        if smoother is None:
            return contact
        history = history.without_outages()
        # After a pause the arm may only ring: that is no push at one place.
        smoothed = smoother.smooth(history.strongest_stretch())
        if smoothed is None:
            return contact
        return self._summarizer.with_place(contact, smoother.with_forces(history, smoothed), smoothed)

    def _smoother_for(self, sensed: np.ndarray) -> ContactSmoother | None:
        """For contacts that lack a sensor of the scene in most of their samples: of the scene without it.

        Args:
            sensed: As `ContactHistory.sensed`.

        Returns:
            None if no sensor is left that all contacts are smoothed by.
        """
        silent = frozenset(name for name, there in zip(SENSED, sensed, strict=True) if not there)
        silent &= {field for field, there in in_scene(self.scene).items() if there}
        if silent not in self._smoothers:
            scene = without_sensors(self.scene, silent)
            none = scene.base_wrench is None and scene.joint_torque is None
            self._smoothers[silent] = None if none else ContactSmoother(scene)
        return self._smoothers[silent]


def _span(recording: Recording | RecordingFile | FollowedRows) -> tuple[float | None, float | None]:
    """Times of the first and the last sample [s], if they are known in advance."""
    if not isinstance(recording, Recording) or len(recording) == 0:
        return None, None
    return float(recording.t[0]), float(recording.t[-1])
