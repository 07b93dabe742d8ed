"""Samples of a recording as arrays, and the localizer's estimates for them."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Self

import numpy as np

from contactsense.sensors.link_values import as_fields, by_field
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
    link_wrenches: Mapping[str, np.ndarray] | None = None
    """The same of each further sensor within the arm, by its name in `Scene.link_wrenches`."""

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

        def checked(name: str, value: object, size: int) -> np.ndarray:
            array = as_floats(name, value)
            if array.shape != (len(t), size):
                raise ValueError(f"{name}: expected shape ({len(t)}, {size}), got shape {array.shape}")
            return array

        torque, base = block.joint_torque, block.base_wrench
        return cls(
            t,
            checked("q", block.q, joints),
            checked("qd", block.qd, joints),
            None if torque is None else checked("joint_torque", torque, joints),
            None if base is None else checked("base_wrench", base, 6),
            **as_fields({name: checked(name, value, 6) for name, value in block.link_values.items()}),
        )

    @property
    def link_values(self) -> dict[str, np.ndarray]:
        """Values of the link sensors by field, see `contactsense.sensors.link_values`."""
        return by_field(self.wrist_wrench, self.link_wrenches)

    def split(self, size: int) -> Iterator[Self]:
        """The block in parts of at most `size` samples."""
        for at in range(0, len(self), size):
            yield self[at : at + size]

    def __getitem__(self, rows: slice | np.ndarray) -> Self:
        torque, base = self.joint_torque, self.base_wrench
        return type(self)(
            self.t[rows],
            self.q[rows],
            self.qd[rows],
            None if torque is None else torque[rows],
            None if base is None else base[rows],
            **as_fields({name: value[rows] for name, value in self.link_values.items()}),
        )

    @classmethod
    def joined(cls, parts: Sequence[Self]) -> Self:
        """Consecutive parts of one stream as one block; at least one, with the same sensors."""

        def stacked(name: str) -> np.ndarray:
            return np.concatenate([getattr(part, name) for part in parts])

        first = parts[0]
        links = {
            name: np.concatenate([part.link_values[name] for part in parts]) for name in first.link_values
        }
        return cls(
            stacked("t"),
            stacked("q"),
            stacked("qd"),
            None if first.joint_torque is None else stacked("joint_torque"),
            None if first.base_wrench is None else stacked("base_wrench"),
            **as_fields(links),
        )

    def sample(self, i: int) -> Sample:
        """Sample number i."""
        torque, base = (
            None if value is None or np.isnan(value[i]).all() else value[i]
            for value in (self.joint_torque, self.base_wrench)
        )
        links = {name: x[i] for name, x in self.link_values.items() if not np.isnan(x[i]).all()}
        return Sample(float(self.t[i]), self.q[i], self.qd[i], torque, base, **as_fields(links))


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
