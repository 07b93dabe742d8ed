"""Samples of a recording as arrays, and the localizer's estimates for them."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Self

import numpy as np

from contactsense.sensors.validation import as_floats
from contactsense.types import Estimate, Sample


@dataclass(frozen=True, eq=False, slots=True)
class SampleBlock:
    """N consecutive samples of one stream, see `contactsense.types.Sample`; a row of NaN means that the
    sensor has no value in that sample."""

    t: np.ndarray
    """Time on the robot's clock [s], shape (N,)."""
    q: np.ndarray
    """Joint positions [rad], shape (N, n)."""
    qd: np.ndarray
    """Joint velocities [rad/s], shape (N, n)."""
    joint_torque: np.ndarray | None = None
    """Torque that each actuator applies [Nm], shape (N, n)."""
    base_wrench: np.ndarray | None = None
    """Wrench of the arm on the sensor below it, base axes, about the base origin [N, Nm], shape (N, 6)."""
    wrist_wrench: np.ndarray | None = None
    """Wrench on the wrist sensor of everything distal to it, base axes, about the base origin [N, Nm], shape
    (N, 6)."""

    def __len__(self) -> int:
        return len(self.t)

    def __repr__(self) -> str:
        span = f"{self.t[0]:.3f} to {self.t[-1]:.3f} s" if len(self.t) else "empty"
        return f"SampleBlock({len(self.t)} samples, {span})"

    @classmethod
    def checked(cls, block: Self, joints: int) -> Self:
        """The block with contiguous arrays of floats.

        Raises:
            ValueError: a field has the wrong shape; the message names it.
        """
        t = as_floats("t", block.t)
        if t.ndim != 1:
            raise ValueError(f"t: expected shape (N,), got shape {t.shape}")
        sizes = (joints, joints, joints, 6, 6)
        fields = ("q", "qd", "joint_torque", "base_wrench", "wrist_wrench")
        checked = []
        for name, size in zip(fields, sizes, strict=True):
            value = getattr(block, name)
            if value is not None:
                value = as_floats(name, value)
                if value.shape != (len(t), size):
                    raise ValueError(f"{name}: expected shape ({len(t)}, {size}), got shape {value.shape}")
            checked.append(value)
        return cls(t, *checked)

    def split(self, size: int) -> Iterator[Self]:
        """The block in parts of at most `size` samples."""
        for at in range(0, len(self), size):
            yield self[at : at + size]

    def __getitem__(self, rows: slice) -> Self:
        sensors = (
            None if value is None else value[rows]
            for value in (self.joint_torque, self.base_wrench, self.wrist_wrench)
        )
        return type(self)(self.t[rows], self.q[rows], self.qd[rows], *sensors)

    def sample(self, i: int) -> Sample:
        """Sample number i."""
        torque, base, wrist = (
            None if value is None or np.isnan(value[i]).all() else value[i]
            for value in (self.joint_torque, self.base_wrench, self.wrist_wrench)
        )
        return Sample(float(self.t[i]), self.q[i], self.qd[i], torque, base, wrist)


@dataclass(frozen=True, eq=False, slots=True)
class BlockEstimates:
    """The localizer's estimates for the N samples of a block, and their residuals."""

    t: np.ndarray
    """Times of the samples [s], shape (N,)."""
    flags: np.ndarray
    """Flags of each sample, see `contactsense.sensors.stream_state`, shape (N,), int64."""
    phase: np.ndarray
    """Phase of the contact, see `contactsense.tracking.contact_tracker`, shape (N,), int64."""
    energy: np.ndarray
    """Energy of "nothing touches": half the squared residuals in units of their covariance, shape (N,)."""
    consistency: np.ndarray
    """Mean square residuals in units of their variance, averaged over several seconds: base wrench, joint
    torques, consistency of the two, shape (N, 3)."""
    base_wrench: np.ndarray
    """External wrench on the base sensor, base axes, base origin [N, Nm], shape (N, 6)."""
    base_wrench_std: np.ndarray
    """Its standard deviation without contact, shape (N, 6)."""
    joint_torque: np.ndarray
    """External torque about each joint, that of a contact wrench w being s_j . w [Nm], shape (N, n)."""
    joint_torque_std: np.ndarray
    """Its standard deviation without contact, shape (N, n)."""
    joint_bias: np.ndarray
    """Estimated biases of the joint torques [Nm], shape (N, n)."""
    sample: np.ndarray
    """The sample of each of the K located contacts, shape (K,), int64, ascending."""
    contact: np.ndarray
    """Number of that contact in its stream, shape (K,), int64."""
    rows: np.ndarray
    """The most probable explanation, see `contactsense.runtime.result_rows`, shape (K, WIDTH)."""
    link_probability: np.ndarray
    """Probability of each link, shape (K, links)."""
    estimates: Mapping[int, Estimate]
    """Sample number -> estimate, for samples in which a contact acts or ends, if they were processed one at a
    time: because of several contacts or a payload, or because the estimates were requested."""

    def __len__(self) -> int:
        return len(self.t)

    def __repr__(self) -> str:
        return f"BlockEstimates({len(self.t)} samples, {len(np.unique(self.sample))} with a contact)"
