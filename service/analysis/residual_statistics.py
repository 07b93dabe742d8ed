"""Residuals over a whole recording in bounded memory: how large they are beside their noise."""

from dataclasses import dataclass

import numpy as np

from contactsense import BlockEstimates
from contactsense.sensors.stream_state import DEGRADED, MISSING, TOUCHED

BINS = 1200
"""Most points of a curve over a whole recording."""


@dataclass(frozen=True, eq=False)
class ResidualSummary:
    """Residuals of a recording. B bins of equal time; n joints."""

    t: np.ndarray
    """Begin of each bin [s], shape (B,)."""
    energy: np.ndarray
    """Largest energy of "nothing touches" in each, shape (B,)."""
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
    """Samples without contact."""
    touched: int
    """Samples with one."""
    degraded: int
    """Samples in which a sensor was missing, invalid or inconsistent, or the observers settled."""
    missing: tuple[int, int, int]
    """Samples in which base wrench, joint torques and wrist wrench were missing."""

    def __repr__(self) -> str:
        return (
            f"<residuals: {self.free} samples free, {self.touched} touched, {self.degraded} degraded; base "
            f"{np.round(self.base_ratio, 2).tolist()}, joints {np.round(self.joint_ratio, 2).tolist()} times "
            "their standard deviation>"
        )


class ResidualStatistics:
    """Takes in blocks of one recording."""

    def __init__(self, start: float, end: float, joints: int) -> None:
        """The recording lasts from `start` to `end` [s]."""
        self._start, self._width = start, max(end - start, 1e-9) / BINS
        self._largest = np.full((BINS, 2 + joints), np.nan)
        self._std = np.full((BINS, 1 + joints), np.nan)
        self._squares, self._free = np.zeros(6 + joints), 0
        self._touched = self._degraded = 0
        self._missing = np.zeros(3, dtype=np.int64)

    def add(self, found: BlockEstimates) -> None:
        """Count a block in."""
        known = np.flatnonzero(np.isfinite(found.energy))
        touched = (found.flags & TOUCHED) != 0
        self._touched += int(touched.sum())
        self._degraded += int(((found.flags & DEGRADED) != 0).sum())
        for i in range(3):
            self._missing[i] += int(((found.flags & MISSING << i) != 0).sum())
        if len(known) == 0:
            return
        free = known[~touched[known] & ((found.flags[known] & DEGRADED) == 0)]
        self._free += len(free)
        with np.errstate(divide="ignore", invalid="ignore"):
            ratio = np.hstack(
                (
                    found.base_wrench[free] / found.base_wrench_std[free],
                    found.joint_torque[free] / found.joint_torque_std[free],
                )
            )
        self._squares += np.nansum(np.where(np.isfinite(ratio), ratio, 0.0) ** 2, axis=0)
        values = np.column_stack(
            (
                found.energy[known],
                np.linalg.norm(found.base_wrench[known, :3], axis=1),
                np.abs(found.joint_torque[known]),
            )
        )
        spread = np.column_stack(
            (np.mean(found.base_wrench_std[known, :3], axis=1), found.joint_torque_std[known])
        )
        bins = np.clip(((found.t[known] - self._start) / self._width).astype(np.int64), 0, BINS - 1)
        for kept, new in ((self._largest, values), (self._std, spread)):
            np.fmax.at(kept, bins, new)

    def summary(self) -> ResidualSummary:
        """What has been taken in so far."""
        filled = np.flatnonzero(np.isfinite(self._largest[:, 0]))
        ratio = np.sqrt(self._squares / max(self._free, 1))
        largest, std = self._largest[filled], self._std[filled]
        base, torque, wrist = self._missing.tolist()
        return ResidualSummary(
            t=self._start + filled * self._width,
            energy=largest[:, 0],
            base_force=largest[:, 1],
            base_force_std=std[:, 0],
            joint_torque=largest[:, 2:],
            joint_torque_std=std[:, 1:],
            base_ratio=ratio[:6],
            joint_ratio=ratio[6:],
            free=self._free,
            touched=self._touched,
            degraded=self._degraded,
            missing=(base, torque, wrist),
        )
