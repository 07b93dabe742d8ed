"""A recording with its estimates, to be shown at any time of it."""

import pickle
from collections import deque
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from contactsense import BlockEstimates, Estimate, Event, Localizer, SampleBlock
from contactsense.scene import Scene
from contactsense.service.recordings import ColumnMapping, RecordingError, RecordingFile
from contactsense.service.recordings.problem_lines import problem_lines
from contactsense.service.recordings.problems import Problem
from contactsense.service.viewer.frame import HISTORY, TRACKS, Forces, Frame, forces_of

RATE = 50.0
"""Frames kept per second [Hz]; in addition, samples with an event are kept."""
_BLOCK = 512
"""Samples estimated at a time: what an estimate without contact says of the stream is at most that old."""


@dataclass(frozen=True, eq=False)
class _Kept:
    """K frames of consecutive samples."""

    time: np.ndarray
    """Time from the start of the recording [s], shape (K,)."""
    q: np.ndarray
    """Joint positions, shape (K, n) [rad]."""
    forces: np.ndarray
    """As `Forces.force`, shape (K, TRACKS) [N], float32."""
    estimates: list[bytes | Estimate]
    """The estimates. Those with contacts are pickled, which takes a fraction of the memory; the others share
    their arrays."""


class Playback:
    """A recording and the estimates for it, `RATE` times a second.

    Times are those from the start of the recording, without the leaps of a clock that was reset.
    """

    duration: float
    """Time from the first to the last sample [s]."""
    problems: tuple[str, ...]
    """What is wrong with the file, one line each."""
    events: tuple[Event, ...]
    """Everything that happened to the contacts, in order; `Event.t` is the time from the start [s]."""

    def __init__(
        self, kept: _Kept, duration: float, events: tuple[Event, ...], problems: Sequence[Problem]
    ) -> None:
        self._kept = kept
        self.duration, self.events, self.problems = duration, events, problem_lines(tuple(problems))

    @classmethod
    def open(
        cls,
        scene: Scene,
        path: str | Path,
        mapping: ColumnMapping | None = None,
        *,
        progress: Callable[[int], object] | None = None,
        localizer: Localizer | None = None,
    ) -> "Playback":
        """Estimate a whole recording, block by block, and keep its frames.

        Args:
            scene: The arm, its mounting and its sensors.
            path: Any recording that `contactsense.service.recordings.RecordingFile` reads.
            mapping: Names of its columns and topics, and units; None: the defaults.
            progress: Called with the number of samples done since it was last called.
            localizer: A localizer of the same scene to reuse.

        Raises:
            RecordingError: the file cannot be read, or lacks a column.
        """
        file = RecordingFile(path, scene, mapping)
        run = _Run(localizer or Localizer(scene))
        problems: list[Problem] = []

        def blocks() -> Iterator[SampleBlock]:
            for part in file.blocks():
                problems.extend(part.problems)
                yield from part.sample_blocks(_BLOCK)

        for count in run.blocks(blocks()):
            if progress is not None:
                progress(count)
        if not run.parts:
            raise RecordingError(f"{path}: expected at least two samples, got none")
        kept = _Kept(
            np.concatenate([part.time for part in run.parts]),
            np.concatenate([part.q for part in run.parts]),
            np.concatenate([part.forces for part in run.parts]),
            [estimate for part in run.parts for estimate in part.estimates],
        )
        return cls(kept, run.elapsed, tuple(run.events), problems)

    def at(self, time: float) -> Frame:
        """The newest frame at a time [s] from the start; the first and the last one beyond the ends."""
        kept = self._kept
        i = max(int(np.searchsorted(kept.time, time, side="right")) - 1, 0)
        first = int(np.searchsorted(kept.time, kept.time[i] - HISTORY))
        found = kept.estimates[i]
        estimate: Estimate = pickle.loads(found) if isinstance(found, bytes) else found
        q = kept.q[i] if np.isfinite(kept.q[i]).all() else None
        forces = Forces(kept.time[first : i + 1], kept.forces[first : i + 1].astype(np.float64))
        return Frame(q, estimate, forces)


class _Run:
    """One pass of a localizer through a recording."""

    def __init__(self, localizer: Localizer) -> None:
        self._localizer = localizer
        self.parts: list[_Kept] = []
        self.events: list[Event] = []
        self.elapsed = 0.0
        self._last, self._frame = np.nan, -1

    def blocks(self, blocks: Iterator[SampleBlock]) -> Iterator[int]:
        """Process all blocks; yields the number of samples of each."""
        taken: deque[SampleBlock] = deque()

        def given() -> Iterator[SampleBlock]:
            for block in blocks:
                taken.append(block)
                yield block

        for found in self._localizer.run_blocks(given(), estimates=True):
            self.parts.append(self._keep(taken.popleft(), found))
            yield len(found)

    def _keep(self, block: SampleBlock, found: BlockEstimates) -> _Kept:
        step = np.diff(block.t, prepend=block.t[0] if np.isnan(self._last) else self._last)
        time = self.elapsed + np.cumsum(np.where(step > 0.0, step, 0.0))
        self._last, self.elapsed = float(block.t[-1]), float(time[-1])
        # A rounding error of the clock must not move a sample into the frame before it.
        frame = np.floor(time * RATE + 1e-6).astype(np.int64)
        kept = np.diff(frame, prepend=self._frame) > 0
        self._frame = int(frame[-1])
        for i, estimate in found.estimates.items():
            self.events += [replace(event, t=float(time[i])) for event in estimate.events]
            kept[i] |= len(estimate.events) > 0
        chosen = np.flatnonzero(kept)
        estimates = [
            found.estimates.get(int(i))
            or self._localizer.quiet_estimate(float(block.t[i]), int(found.flags[i]))
            for i in chosen
        ]
        forces = np.array([forces_of(estimate) for estimate in estimates], dtype=np.float32)
        packed = [
            pickle.dumps(estimate, pickle.HIGHEST_PROTOCOL) if estimate.contacts else estimate
            for estimate in estimates
        ]
        return _Kept(time[chosen], block.q[chosen], forces.reshape(-1, TRACKS), packed)
