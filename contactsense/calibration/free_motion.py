"""Input of calibration: recordings of contact-free motion."""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Any, Self

import numpy as np

from contactsense.sensors.validation import as_floats, checked_rows

_LARGEST = 1e12
"""Larger values are none of a signal in any unit, and their squares could not be summed."""


@dataclass(frozen=True)
class FreeMotion:
    """One recording, or a part of one, without contact. N samples, n joints."""

    t: np.ndarray
    """Time, increasing [s], shape (N,)."""
    q: np.ndarray
    """Joint positions [rad], shape (N, n)."""
    qd: np.ndarray
    """Joint velocities [rad/s], shape (N, n)."""
    torque: np.ndarray | None = None
    """Joint torques [Nm], actuator's sign, with the scene's torque constants, shape (N, n)."""
    reading: np.ndarray | None = None
    """Readings of the sensor under the base, in its own frame and sign, shape (N, 6) [N, Nm]."""
    name: str = "recording"
    """Name for messages."""
    rows: np.ndarray | None = None
    """Row of each sample in its file, shape (N,), int; None: its number."""
    free: np.ndarray | None = None
    """Which samples are used, because nothing touches the arm, shape (N,), bool; None: all."""
    link_readings: Mapping[str, np.ndarray] = field(default_factory=dict)
    """The same of the sensors within the arm that were recorded, by key of `Scene.link_sensors`."""

    def __post_init__(self) -> None:
        """Check shapes and values.

        Raises:
            ValueError: an array has the wrong shape, is not finite or far too large, or time does not
                increase.
        """
        q = as_floats(f"{self.name}: q", self.q)
        if q.ndim != 2 or len(q) < 3:
            raise ValueError(f"{self.name}: q: expected at least 3 rows of joint positions, got {q.shape}")
        n, joints = q.shape
        sizes = {"q": (joints, "rad"), "qd": (joints, "rad/s"), "torque": (joints, "Nm")}
        sizes["reading"] = (6, "N")
        try:
            for name, (size, unit) in sizes.items():
                value = getattr(self, name)
                if value is not None:
                    object.__setattr__(self, name, checked_rows(name, value, n, size, unit))
            links = {name: checked_rows(name, x, n, 6, "N") for name, x in self.link_readings.items()}
            arrays = {name: getattr(self, name) for name in sizes} | links
            for name, value in arrays.items():
                if value is not None and (largest := np.abs(value).max()) > _LARGEST:
                    raise ValueError(f"{name}: expected values up to {_LARGEST:g}, got {largest:.3g}")
        except ValueError as error:
            raise ValueError(f"{self.name}: {error}") from None
        object.__setattr__(self, "link_readings", links)
        t = as_floats(f"{self.name}: t", self.t)
        if t.shape != (n,) or not np.all(np.isfinite(t)) or np.any(np.diff(t) <= 0.0):
            raise ValueError(f"{self.name}: t: expected {n} increasing times [s]")
        object.__setattr__(self, "t", t)
        if self.free is not None and (np.shape(self.free) != (n,) or np.asarray(self.free).dtype != bool):
            raise ValueError(f"{self.name}: free: expected {n} truth values, got {self.free!r:.60}")

    @property
    def readings(self) -> dict[str, np.ndarray]:
        """Readings of all force/torque sensors that were recorded, by field of the scene, each (N, 6), in the
        sensor's own frame and sign [N, Nm]."""
        base = {} if self.reading is None else {"base_wrench": self.reading}
        return base | dict(self.link_readings)

    def with_readings(self, readings: Mapping[str, np.ndarray]) -> Self:
        """The same motion with other `readings`."""
        links = {name: value for name, value in readings.items() if name != "base_wrench"}
        return replace(self, reading=readings.get("base_wrench"), link_readings=links)

    def part(self, rows: np.ndarray) -> Self:
        """Some of the samples; `rows`: their indices, increasing."""
        arrays = {name: getattr(self, name) for name in ("t", "q", "qd", "torque", "reading", "rows", "free")}
        some: dict[str, Any] = {name: array[rows] for name, array in arrays.items() if array is not None}
        links = {name: reading[rows] for name, reading in self.link_readings.items()}
        return replace(self, **some, link_readings=links)

    @property
    def usable(self) -> np.ndarray:
        """Which samples are used, shape (N,), bool."""
        return np.ones(len(self.t), dtype=bool) if self.free is None else self.free

    def row_of(self, sample: int) -> int:
        """Row of a sample in the file, from 0; negative samples count from the end."""
        return range(len(self.t))[sample] if self.rows is None else int(self.rows[sample])

    @property
    def seconds(self) -> float:
        """Duration [s]."""
        return float(self.t[-1] - self.t[0])


def check_recordings(recordings: object) -> None:
    """Raise a TypeError if an argument `recordings` is no list of them, such as a single one, the path of a
    file, or all that `read_free_motion` returns."""
    if not isinstance(recordings, list | tuple):
        raise TypeError(f"recordings: expected a list of FreeMotion, got {type(recordings).__name__}")
    for i, part in enumerate(recordings):
        if not isinstance(part, FreeMotion):
            raise TypeError(f"recordings[{i}]: expected FreeMotion, got {type(part).__name__}")
