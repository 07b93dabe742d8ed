"""Residuals over a whole recording in bounded memory: their size relative to their noise."""

import math
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from contactsense import BlockEstimates
from contactsense.robots.jit.kernel import kernel
from contactsense.sensors.stream_state import DEGRADED, INCONSISTENT, MAX_SENSORS, MISSING, TOUCHED

BINS = 1200
"""Maximum number of points of a curve over a whole recording."""
FIRST_WIDTH = 0.01
"""Width of a bin if the end of the recording is not yet known [s]."""


@dataclass(frozen=True, eq=False)
class ResidualSummary:
    """Residuals of a recording. B bins of equal time; n joints."""

    t: np.ndarray
    """Begin of each bin [s], shape (B,)."""
    energy: np.ndarray
    """Largest energy of the no-contact hypothesis in each, shape (B,)."""
    base_force: np.ndarray
    """Largest external force on the base sensor [N], shape (B,)."""
    base_force_std: np.ndarray
    """Standard deviation of one of its components without contact [N], shape (B,)."""
    joint_torque: np.ndarray
    """Largest external torque about each joint [Nm], shape (B, n)."""
    joint_torque_std: np.ndarray
    """Standard deviation without contact [Nm], shape (B, n)."""
    base_ratio: np.ndarray
    """Root mean square of each component of the base wrench's residual without contact, in units of its
    standard deviation, shape (6,)."""
    joint_ratio: np.ndarray
    """The same of the joint torques, shape (n,)."""
    free: int
    """Samples without contact that are not degraded."""
    usable: int
    """Samples with a residual that can be used, of the base wrench or of the joint torques."""
    touched: int
    """Samples with one."""
    degraded: int
    """Samples in which a sensor was missing, invalid or inconsistent, or the observers were settling."""
    inconsistent: int
    """Samples in which the sensors contradicted each other, or had more noise than stated."""
    missing: tuple[int, ...]
    """Samples in which each sensor was missing: base sensor, joint torques, link sensors."""

    def __repr__(self) -> str:
        return (
            f"<residuals: {self.free} samples free, {self.touched} touched, {self.degraded} degraded; base "
            f"{np.round(self.base_ratio, 2).tolist()}, joints {np.round(self.joint_ratio, 2).tolist()} times "
            "their standard deviation>"
        )


class _Statistics(NamedTuple):
    """What is collected, n joints."""

    width: np.ndarray
    """Width of the bins [s], shape (1,)."""
    largest: np.ndarray
    """Largest energy, base force and torque about each joint in each bin, shape (BINS, 2 + n)."""
    std: np.ndarray
    """Largest standard deviation of the base force and of each joint torque, shape (BINS, 1 + n)."""
    squares: np.ndarray
    """Sums over the samples without contact of the squared ratios of residual and standard deviation: base
    wrench, joint torques, shape (6 + n,)."""
    squared: np.ndarray
    """How many of these samples have a residual that can be used: base wrench, joint torques, shape (2,),
    int64."""
    counts: np.ndarray
    """Samples that are free, touched, degraded, usable, inconsistent, and in which each sensor is missing,
    int64."""
    held: np.ndarray
    """Squared ratios of the newest sample, free unless the next one has a contact, shape (6 + n,)."""
    held_counts: np.ndarray
    """How many samples, base wrenches and joint torques they are, 0 or 1 each, shape (3,), int64."""


class ResidualStatistics:
    """Collects blocks of one recording."""

    def __init__(self, joints: int, start: float | None = None, end: float | None = None) -> None:
        """Start without any block.

        Args:
            joints: Number of joints.
            start, end: When the recording begins and ends [s]; None: not known, bins are merged as it grows.
        """
        self._start = start
        width = FIRST_WIDTH if start is None or end is None else max(end - start, 1e-9) / BINS
        self._collected = _Statistics(
            np.array([width]),
            np.full((BINS, 2 + joints), np.nan),
            np.full((BINS, 1 + joints), np.nan),
            np.zeros(6 + joints),
            np.zeros(2, dtype=np.int64),
            np.zeros(5 + MAX_SENSORS, dtype=np.int64),
            np.zeros(6 + joints),
            np.zeros(3, dtype=np.int64),
        )

    def add(self, found: BlockEstimates) -> None:
        """Add a block."""
        if self._start is None:
            self._start = float(found.t[0]) if len(found) else None
        if self._start is None:
            return
        _add(
            found.t, found.flags, found.usable, found.energy, found.base_wrench, found.base_wrench_std,
            found.joint_torque, found.joint_torque_std, self._start, self._collected,
        )  # fmt: skip

    def summary(self) -> ResidualSummary:
        """Summary of the blocks so far."""
        width, largest, std, squares, squared, counts, held, held_counts = self._collected
        filled = np.flatnonzero(np.isfinite(largest[:, 0]))
        free, touched, degraded, usable, inconsistent, *missing = counts.tolist()
        free, squares, squared = free + int(held_counts[0]), squares + held, squared + held_counts[1:]
        ratio = np.sqrt(squares / np.repeat(np.maximum(squared, 1), (6, len(squares) - 6)))
        largest, std = largest[filled], std[filled]
        return ResidualSummary(
            t=(self._start or 0.0) + filled * width[0],
            energy=largest[:, 0],
            base_force=largest[:, 1],
            base_force_std=std[:, 0],
            joint_torque=largest[:, 2:],
            joint_torque_std=std[:, 1:],
            base_ratio=ratio[:6],
            joint_ratio=ratio[6:],
            free=free,
            usable=usable,
            touched=touched,
            degraded=degraded,
            inconsistent=inconsistent,
            missing=tuple(missing),
        )


@kernel
def _add(
    t: np.ndarray,
    flags: np.ndarray,
    usable: np.ndarray,
    energy: np.ndarray,
    base_wrench: np.ndarray,
    base_wrench_std: np.ndarray,
    joint_torque: np.ndarray,
    joint_torque_std: np.ndarray,
    start: float,
    collected: _Statistics,
) -> None:
    """Add a block, see `ResidualStatistics`; the first eight as in `contactsense.BlockEstimates`."""
    width, largest, std, _, _, counts, held, held_counts = collected
    n, bins = joint_torque.shape[1], largest.shape[0]
    for i in range(t.shape[0]):
        touched, degraded = flags[i] & TOUCHED != 0, flags[i] & DEGRADED != 0
        counts[1] += touched
        counts[2] += degraded
        counts[4] += flags[i] & INCONSISTENT != 0
        for k in range(MAX_SENSORS):
            counts[5 + k] += flags[i] & MISSING << k != 0
        # An onset is detected at the second sample above the threshold; the first one is part of the contact.
        if not touched:
            _count_held(collected)
        held[:] = 0.0
        held_counts[:] = 0
        if not math.isfinite(energy[i]):
            continue
        counts[3] += usable[i, 0] or usable[i, 1]
        if not (touched or degraded):
            held_counts[0] = 1
            if usable[i, 0]:
                held_counts[1] = 1
                for k in range(6):
                    held[k] = _square(base_wrench[i, k] / base_wrench_std[i, k])
            if usable[i, 1]:
                held_counts[2] = 1
                for k in range(n):
                    held[6 + k] = _square(joint_torque[i, k] / joint_torque_std[i, k])
        while t[i] - start > (bins + 1) * width[0]:
            _join_bins(largest)
            _join_bins(std)
            width[0] *= 2.0
        at = min(max(int((t[i] - start) / width[0]), 0), bins - 1)
        fx, fy, fz = base_wrench[i, 0], base_wrench[i, 1], base_wrench[i, 2]
        _keep_largest(energy[i], at, 0, largest)
        _keep_largest(math.sqrt(fx * fx + fy * fy + fz * fz), at, 1, largest)
        mean = (base_wrench_std[i, 0] + base_wrench_std[i, 1] + base_wrench_std[i, 2]) / 3.0
        _keep_largest(mean, at, 0, std)
        for k in range(n):
            _keep_largest(abs(joint_torque[i, k]), at, 2 + k, largest)
            _keep_largest(joint_torque_std[i, k], at, 1 + k, std)


@kernel
def _join_bins(kept: np.ndarray) -> None:
    """Merge each two neighbouring bins."""
    half = kept.shape[0] // 2
    for at in range(kept.shape[0]):
        for k in range(kept.shape[1]):
            value = math.nan
            if at < half:
                a, b = kept[2 * at, k], kept[2 * at + 1, k]
                value = a if a >= b or math.isnan(b) else b
            kept[at, k] = value


@kernel
def _count_held(collected: _Statistics) -> None:
    """Count the sample before as free, if it is held."""
    collected.counts[0] += collected.held_counts[0]
    for k in range(2):
        collected.squared[k] += collected.held_counts[1 + k]
    for k in range(collected.squares.shape[0]):
        collected.squares[k] += collected.held[k]


@kernel
def _square(ratio: float) -> float:
    """Square of a ratio; 0 if the sensor has no noise or no value."""
    return ratio * ratio if math.isfinite(ratio) else 0.0


@kernel
def _keep_largest(value: float, at: int, k: int, kept: np.ndarray) -> None:
    if value > kept[at, k] or math.isnan(kept[at, k]):
        kept[at, k] = value
