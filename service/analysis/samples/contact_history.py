"""The samples of an active contact, until it ends and cannot resume any more."""

from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from contactsense import BlockEstimates, SampleBlock
from contactsense.runtime.result_rows import FORCE
from contactsense.sensors.stream_state import REPEATED, RESTARTED, SETTLING_PERIODS, UNUSABLE
from contactsense.tracking.contact_track import NONE

MAX_SAMPLES = 30_000
"""A longer history keeps one sample in two, in four and so on, so that memory is bounded."""
_HEAD = 1.0
"""All samples of the beginning are kept, with the forces of an impact [s]."""
SENSED = ("base_wrench", "joint_torque")
"""Sensors whose samples a history knows to be usable, in the order of `ContactHistory.usable`."""
_OF_SAMPLES = (
    "row", "phase", "energy", "usable", "base_wrench", "base_wrench_std", "joint_torque", "joint_torque_std",
)  # fmt: skip
"""Arrays of a history with a row for each sample."""
_OF_EXPLANATIONS = "rows", "link_probability"
"""Those with a row for each explanation."""


@dataclass(frozen=True, eq=False)
class ContactHistory:
    """N samples of one contact, of which K have an explanation."""

    contact: int
    """Number of the contact."""
    row: np.ndarray
    """Row of each sample in the file, shape (N,), int64."""
    block: SampleBlock
    """The samples."""
    phase: np.ndarray
    """Phase in each, shape (N,), int64: `NONE` in a pause after which the contact resumed."""
    energy: np.ndarray
    """Energy of the no-contact hypothesis, shape (N,)."""
    usable: np.ndarray
    """Whether the sensors of `SENSED` were neither silent nor settling, shape (N, 2), bool."""
    base_wrench: np.ndarray
    """External base wrench, low-passed, shape (N, 6) [N, Nm]."""
    base_wrench_std: np.ndarray
    """Standard deviation, shape (N, 6)."""
    joint_torque: np.ndarray
    """External joint torques, low-passed, shape (N, n) [Nm]."""
    joint_torque_std: np.ndarray
    """Standard deviation, shape (N, n)."""
    sample: np.ndarray
    """Sample of each explanation, shape (K,), int64."""
    rows: np.ndarray
    """Explanations, see `contactsense.runtime.result_rows`, shape (K, WIDTH)."""
    link_probability: np.ndarray
    """Probability of each link, shape (K, links)."""
    complete: bool
    """Whether the contact ended within the recording."""

    @property
    def force(self) -> np.ndarray:
        """Size of the force in each explanation [N], shape (K,)."""
        return np.asarray(np.linalg.norm(self.rows[:, FORCE], axis=1))

    @property
    def t(self) -> np.ndarray:
        """Times of the samples [s], shape (N,)."""
        return self.block.t

    @property
    def explained_share(self) -> float:
        """How much of the sum of energies belongs to samples with an explanation, 0 to 1."""
        return float(self.energy[self.sample].sum() / max(self.energy.sum(), 1e-300))

    def strongest_stretch(self) -> "ContactHistory":
        """The samples between two pauses, or all if there is none, that differ most from no contact: those
        with the largest sum of energies."""
        on = self.phase != NONE
        if on.all():
            return self
        stretches = np.split(np.arange(len(on)), np.flatnonzero(np.diff(on.astype(np.int8))) + 1)
        touched = [stretch for stretch in stretches if on[stretch[0]]]
        return _taken(self, max(touched, key=lambda stretch: float(self.energy[stretch].sum())))

    @property
    def sensed(self) -> np.ndarray:
        """Whether most of the touched samples have each of `SENSED`, shape (2,), bool."""
        on = self.phase != NONE
        return np.asarray(2 * np.count_nonzero(self.usable[on], axis=0) > np.count_nonzero(on))

    def without_outages(self) -> "ContactHistory":
        """Without the samples that lack a sensor that most of the touched ones have. While a sensor is silent
        its residual stays as if nothing touched the arm, and the force that the others alone make most
        probable may be several times the true one."""
        kept = self.usable[:, self.sensed].all(axis=1)
        return self if kept.all() else _taken(self, np.flatnonzero(kept))


class ContactCollector:
    """Splits a stream of blocks into contacts."""

    def __init__(self, bandwidth: float) -> None:
        """Start without a contact; `bandwidth`: of the observers [Hz]."""
        self._settling_time = SETTLING_PERIODS / bandwidth
        self._open: list[ContactHistory] = []
        self._pause: list[ContactHistory] = []
        self._count, self._number = 0, 0
        self._stride = 1

    @property
    def open_since(self) -> int | None:
        """Row in which the contact began that is active, or may resume; None without one."""
        return int(self._open[0].row[0]) if self._open else None

    def add(self, rows: np.ndarray, block: SampleBlock, found: BlockEstimates) -> Iterator[ContactHistory]:
        """Add a block; yields the contacts that have ended for good in it.

        Args:
            rows: Rows of the file, shape (N,).
            block: The samples.
            found: The localizer's estimates for them.
        """
        used = (found.flags & (REPEATED | UNUSABLE)) == 0
        on = (found.phase != NONE) & used
        cut = np.flatnonzero(found.flags & RESTARTED).tolist()
        # A contact pauses where the phase is "none"; samples that were not used do not end it.
        known = np.flatnonzero(used)
        edges = np.flatnonzero(np.diff(on[known].astype(np.int8)) != 0) + 1
        starts = sorted({0, *known[edges].tolist(), *cut})
        for first, last in zip(starts, [*starts[1:], len(found)], strict=True):
            here = np.flatnonzero(on[first:last]) + first
            if first in cut:
                yield from self._end(True)
            if len(here):
                if self._pause and found.number[here[0]] != self._number:
                    yield from self._end(True)
                self._take(self._part(here, rows, block, found))
                self._number = int(found.number[here[-1]])
            elif self._open and used[first:last].any():
                here = np.flatnonzero(used[first:last]) + first
                begin = self._pause[0].t[0] if self._pause else block.t[here[0]]
                if block.t[here[-1]] - begin > self._settling_time:
                    yield from self._end(True)
                else:
                    self._pause.append(self._part(here, rows, block, found))

    def end(self) -> Iterator[ContactHistory]:
        """End the recording; yields the contact that is still active, or may have resumed later."""
        yield from self._end(bool(self._pause))

    def _take(self, part: ContactHistory) -> None:
        """Add samples to the contact, and the pause before them."""
        self._open += map(self._thinned, [*self._pause, part])
        self._pause = []
        if sum(len(part.row) for part in self._open) > MAX_SAMPLES:
            self._stride *= 2
            self._open = [self._thinned(_join(self._open, False))]

    def _thinned(self, part: ContactHistory) -> ContactHistory:
        """Samples of the contact, with one in each `_stride` rows: as many per second from its begin to its
        end. Those of `_HEAD`, the last one, and those with the largest force after `_HEAD` and with the
        largest energy are kept, too."""
        if self._stride == 1:
            return part
        begin = self._open[0]
        _, kept = np.unique((part.row - begin.row[0]) // self._stride, return_index=True)
        late = part.t - begin.t[0] > _HEAD
        strongest = [int(np.argmax(part.energy)), len(part.row) - 1]
        if late[part.sample].any():
            strongest.append(int(part.sample[np.argmax(part.force * late[part.sample])]))
        return _taken(part, np.unique([*kept, *np.flatnonzero(~late), *strongest]))

    def _part(
        self, here: np.ndarray, rows: np.ndarray, block: SampleBlock, found: BlockEstimates
    ) -> ContactHistory:
        """The samples `here` of a block."""
        inside = np.flatnonzero((found.sample >= here[0]) & (found.sample <= here[-1]))
        if len(inside):
            strongest = np.linalg.norm(found.rows[inside][:, FORCE], axis=1)
            # With simultaneous contacts, a sample is listed once for each: the strongest counts.
            order = np.lexsort((-strongest, found.sample[inside]))
            _, once = np.unique(found.sample[inside][order], return_index=True)
            inside = inside[order][once]
        return ContactHistory(
            contact=self._count + 1,
            row=rows[here],
            block=block[here],
            phase=found.phase[here],
            energy=found.energy[here],
            usable=found.usable[here],
            base_wrench=found.base_wrench[here],
            base_wrench_std=found.base_wrench_std[here],
            joint_torque=found.joint_torque[here],
            joint_torque_std=found.joint_torque_std[here],
            sample=np.searchsorted(here, found.sample[inside]),
            rows=found.rows[inside],
            link_probability=found.link_probability[inside],
            complete=False,
        )

    def _end(self, complete: bool) -> Iterator[ContactHistory]:
        if self._open:
            self._count += 1
            yield _join(self._open, complete)
        self._open, self._pause, self._stride = [], [], 1


def _join(parts: list[ContactHistory], complete: bool) -> ContactHistory:
    offsets = np.concatenate(([0], np.cumsum([len(part.row) for part in parts])))
    arrays: dict[str, Any] = {
        name: np.concatenate([getattr(part, name) for part in parts])
        for name in (*_OF_SAMPLES, *_OF_EXPLANATIONS)
    }
    return replace(
        parts[0],
        block=SampleBlock.joined([part.block for part in parts]),
        sample=np.concatenate([part.sample + offsets[i] for i, part in enumerate(parts)]),
        complete=complete,
        **arrays,
    )


def _taken(history: ContactHistory, kept: np.ndarray) -> ContactHistory:
    """Some of the samples; `kept`: which, ascending."""
    explained = np.flatnonzero(np.isin(history.sample, kept))
    arrays: dict[str, Any] = {name: getattr(history, name)[kept] for name in _OF_SAMPLES}
    arrays |= {name: getattr(history, name)[explained] for name in _OF_EXPLANATIONS}
    return replace(
        history,
        block=history.block[kept],
        sample=np.searchsorted(kept, history.sample[explained]),
        **arrays,
    )
