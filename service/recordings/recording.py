"""A recording in the form that the estimator needs: arrays in the frames and signs of
`contactsense.Sample`."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np

from contactsense.runtime.block_runner import MAX_BLOCK
from contactsense.sample_blocks import SampleBlock
from contactsense.sensors.link_values import by_field, column_of
from contactsense.service.recordings.problems import Problem
from contactsense.service.recordings.time_extent import TimeExtent
from contactsense.types import Sample

if TYPE_CHECKING:
    import pandas as pd
    import pyarrow as pa

BLOCK = 1 << 16
"""Default number of rows in a block."""


@dataclass(frozen=True)
class Recording:
    """Samples of one arm, in the order of the file. A value that was not measured is NaN."""

    name: str
    """The file that was read."""
    t: np.ndarray
    """Time on the robot's clock [s], shape (N,). Decreases only where the clock was reset."""
    q: np.ndarray
    """Joint positions [rad], shape (N, n)."""
    qd: np.ndarray
    """Joint velocities [rad/s], shape (N, n)."""
    joint_torque: np.ndarray | None
    """Torque that each actuator applies [Nm], shape (N, n); None without such a sensor."""
    base_wrench: np.ndarray | None
    """Wrench of the arm on the sensor below it, base axes and origin [N, Nm], shape (N, 6)."""
    wrist_wrench: np.ndarray | None
    """Wrench of everything beyond the wrist sensor on that sensor, base axes and origin [N, Nm], shape (N,
    6)."""
    rows: np.ndarray
    """Row of each sample in the file, from 0, shape (N,), int64."""
    problems: tuple[Problem, ...] = ()
    """Problems found in the file, by row."""
    repeated: int = 0
    """Number of rows dropped because they repeat the time stamp of the previous row."""
    meta: Mapping[str, str] = field(default_factory=dict)
    """Metadata of the file, such as the scene that it was recorded with."""
    link_wrenches: Mapping[str, np.ndarray] = field(default_factory=dict)
    """Wrench of everything beyond each further sensor within the arm on that sensor, by its name in
    `Scene.link_wrenches`; as `wrist_wrench`."""

    def __len__(self) -> int:
        return len(self.t)

    def __repr__(self) -> str:
        sensors = [n for n in ("joint_torque", "base_wrench") if getattr(self, n) is not None]
        sensors += self.link_values
        return (
            f"<Recording {self.name}: {len(self)} samples, {self.seconds:.1f} s, "
            f"{', '.join(sensors) or 'no sensors'}, {len(self.problems)} problems>"
        )

    @property
    def seconds(self) -> float:
        """Time from the first to the last sample, including sections before a clock reset [s]. Of rows that
        are not in the order of time, from the earliest to the latest."""
        extent = TimeExtent()
        extent.add(self.t)
        return extent.seconds

    @property
    def sensors(self) -> frozenset[str]:
        """Fields of the sensors that it has."""
        own = {"joint_torque": self.joint_torque, "base_wrench": self.base_wrench, **self.link_values}
        return frozenset(field for field, values in own.items() if values is not None)

    @property
    def heard(self) -> frozenset[str]:
        """Fields of the sensors that have a value in at least one sample: a file may have the columns of a
        sensor that was silent throughout."""
        own = {"joint_torque": self.joint_torque, "base_wrench": self.base_wrench, **self.link_values}
        there = {field: values for field, values in own.items() if values is not None}
        return frozenset(field for field, x in there.items() if np.isfinite(x).all(axis=1).any())

    @property
    def link_values(self) -> dict[str, np.ndarray]:
        """Values of the link sensors by field, see `contactsense.sensors.link_values`."""
        return by_field(self.wrist_wrench, self.link_wrenches)

    @property
    def gaps(self) -> tuple[Problem, ...]:
        """The gaps among `problems`."""
        return tuple(problem for problem in self.problems if problem.kind == "gap")

    def __getitem__(self, key: slice) -> "Recording":
        """A slice of the samples; `problems` remain those of the whole file."""
        parts: dict[str, Any] = {
            name: None if getattr(self, name) is None else getattr(self, name)[key]
            for name in ("t", "q", "qd", "joint_torque", "base_wrench", "wrist_wrench", "rows")
        }
        parts["link_wrenches"] = {name: values[key] for name, values in self.link_wrenches.items()}
        return Recording(self.name, **parts, problems=self.problems, repeated=self.repeated, meta=self.meta)

    def blocks(self, size: int = BLOCK) -> Iterator["Recording"]:
        """Consecutive parts of at most `size` samples."""
        for first in range(0, len(self), size):
            yield self[first : first + size]

    def sample_blocks(self, size: int = MAX_BLOCK) -> Iterator[SampleBlock]:
        """The recording for `Localizer.run_blocks`."""
        links = self.link_wrenches or None
        whole = SampleBlock(
            self.t, self.q, self.qd, self.joint_torque, self.base_wrench, self.wrist_wrench, links
        )
        return whole.split(size)

    def samples(self) -> Iterator[Sample]:
        """The recording as a stream for `Localizer.run`; a sensor whose values are not finite is None."""
        for i in range(len(self)):
            yield Sample(
                float(self.t[i]),
                self.q[i],
                self.qd[i],
                _finite(self.joint_torque, i),
                _finite(self.base_wrench, i),
                _finite(self.wrist_wrench, i),
                {
                    name: values[i]
                    for name, values in self.link_wrenches.items()
                    if np.isfinite(values[i]).all()
                }
                or None,
            )

    def columns(self) -> dict[str, np.ndarray]:
        """Contract columns: `timestamp`, `actual_q_0`, ...; wrenches in base axes."""
        columns = {"timestamp": self.t}
        parts = (
            ("actual_q", self.q),
            ("actual_qd", self.qd),
            ("joint_torque", self.joint_torque),
            ("base_wrench", self.base_wrench),
            *((column_of(name), values) for name, values in self.link_values.items()),
        )
        for name, array in parts:
            if array is not None:
                columns |= {f"{name}_{i}": array[:, i] for i in range(array.shape[1])}
        return columns

    def to_arrow(self) -> "pa.Table":
        """The contract columns as an Arrow table. It carries no scene: that of the file states the frames of
        the sensors, and these wrenches are in base axes."""
        import pyarrow as pa

        return pa.table(self.columns())

    def to_pandas(self) -> "pd.DataFrame":
        """The contract columns as a pandas data frame; needs pandas."""
        return self.to_arrow().to_pandas()


def _finite(array: np.ndarray | None, i: int) -> np.ndarray | None:
    if array is None:
        return None
    row: np.ndarray = array[i]
    return row if np.isfinite(row).all() else None


def concatenate(parts: list[Recording], name: str, meta: Mapping[str, str]) -> Recording:
    """Concatenate consecutive parts of one recording."""

    def joined(key: str) -> Any:
        arrays = [getattr(part, key) for part in parts]
        if arrays[0] is None or len(arrays) == 1:
            return arrays[0]
        return np.concatenate(arrays)

    return Recording(
        name,
        joined("t"),
        joined("q"),
        joined("qd"),
        joined("joint_torque"),
        joined("base_wrench"),
        joined("wrist_wrench"),
        joined("rows"),
        tuple(problem for part in parts for problem in part.problems),
        parts[-1].repeated,
        meta,
        {
            name: np.concatenate([part.link_wrenches[name] for part in parts])
            for name in parts[0].link_wrenches
        },
    )
