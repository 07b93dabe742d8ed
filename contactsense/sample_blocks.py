"""Samples of a recording as arrays, and the localizer's estimates for them."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Self

import numpy as np

from contactsense.robots.attribute_docs import with_attributes
from contactsense.sensors.link_values import as_fields, by_field
from contactsense.sensors.validation import as_floats
from contactsense.types import Estimate, Sample

_FIELDS = ("t", "q", "qd", "joint_torque", "base_wrench")
"""Arrays of a block besides those of the link sensors."""


@with_attributes
@dataclass(frozen=True, eq=False, slots=True)
class SampleBlock:
    """N consecutive samples of one stream, see `contactsense.types.Sample`; a row of NaN, or a masked one,
    means that the sensor has no value in that sample."""

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
        found = {"t": t}
        for name, value in block._arrays().items():
            if name != "t":
                size = joints if name in ("q", "qd", "joint_torque") else 6
                array = found[name] = as_floats(name, value)
                if array.shape != (len(t), size):
                    raise ValueError(f"{name}: expected shape ({len(t)}, {size}), got shape {array.shape}")
        return cls._of(found)

    def _arrays(self) -> dict[str, np.ndarray]:
        """What the block has, by field of the sample."""
        own = {name: getattr(self, name) for name in _FIELDS}
        there = {name: x for name, x in own.items() if x is not None or name in ("q", "qd")}
        return there | self.link_values

    @classmethod
    def _of(cls, arrays: Mapping[str, np.ndarray]) -> Self:
        """The inverse of `_arrays`."""
        own: dict[str, Any] = {name: arrays[name] for name in _FIELDS if name in arrays}
        return cls(**own, **as_fields({name: x for name, x in arrays.items() if name not in _FIELDS}))

    @property
    def link_values(self) -> dict[str, np.ndarray]:
        """Values of the link sensors by field, each (N, 6), see `contactsense.sensors.link_values`."""
        return by_field(self.wrist_wrench, self.link_wrenches)

    def split(self, size: int) -> Iterator[Self]:
        """The block in parts of at most `size` samples."""
        for at in range(0, len(self), size):
            yield self[at : at + size]

    def __getitem__(self, rows: slice | np.ndarray) -> Self:
        return self._of({name: value[rows] for name, value in self._arrays().items()})

    @classmethod
    def joined(cls, parts: Sequence[Self]) -> Self:
        """Consecutive parts of one stream as one block; at least one, with the same sensors."""
        arrays = [part._arrays() for part in parts]
        return cls._of({name: np.concatenate([part[name] for part in arrays]) for name in arrays[0]})

    def sample(self, i: int) -> Sample:
        """Sample number i."""
        row = {name: x[i] for name, x in self._arrays().items() if name != "t"}
        values = {name: x for name, x in row.items() if name in ("q", "qd") or not np.isnan(x).all()}
        own: dict[str, Any] = {name: values.pop(name) for name in _FIELDS if name in values}
        return Sample(float(self.t[i]), **own, **as_fields(values))


@with_attributes
@dataclass(frozen=True, eq=False, slots=True)
class BlockEstimates:
    """The localizer's estimates for the N samples of a block, and their residuals."""

    t: np.ndarray
    """Times of the samples [s], shape (N,)."""
    flags: np.ndarray
    """Flags of each sample, see `contactsense.sensors.stream_state`, shape (N,), int64."""
    phase: np.ndarray
    """Phase of the contact, see `contactsense.tracking.contact_track`, shape (N,), int64."""
    number: np.ndarray
    """Number of the contact, without contact that of the last one, shape (N,), int64. With several contacts,
    that of the first one."""
    usable: np.ndarray
    """Whether the residuals of base wrench and joint torques can be used: the sensor is neither silent nor
    settling after its start, shape (N, 2), bool."""
    energy: np.ndarray
    """Energy of the no-contact hypothesis: half the squared residuals in units of their covariance, shape
    (N,)."""
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
    joint_friction: np.ndarray
    """By how much the estimated factors raise friction above the scene's, low-passed [Nm], shape (N, n)."""
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
