"""Input of calibration: recordings of contact-free motion."""

from dataclasses import dataclass

import numpy as np

from contactsense.sensors.validation import checked_rows


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
    wrist: np.ndarray | None = None
    """Readings of the wrist sensor, in its own frame and sign, shape (N, 6) [N, Nm]."""

    def __post_init__(self) -> None:
        """Check shapes and values.

        Raises:
            ValueError: an array has the wrong shape, is not finite, or time does not increase.
        """
        q = np.asarray(self.q, dtype=float)
        if q.ndim != 2 or len(q) < 3:
            raise ValueError(f"{self.name}: q: expected at least 3 rows of joint positions, got {q.shape}")
        n, joints = q.shape
        sizes = {"q": (joints, "rad"), "qd": (joints, "rad/s"), "torque": (joints, "Nm")}
        sizes |= {"reading": (6, "N"), "wrist": (6, "N")}
        for field, (size, unit) in sizes.items():
            value = getattr(self, field)
            if value is not None:
                try:
                    object.__setattr__(self, field, checked_rows(field, value, n, size, unit))
                except ValueError as error:
                    raise ValueError(f"{self.name}: {error}") from None
        t = np.ascontiguousarray(self.t, dtype=float)
        if t.shape != (n,) or not np.all(np.isfinite(t)) or np.any(np.diff(t) <= 0.0):
            raise ValueError(f"{self.name}: t: expected {n} increasing times [s]")
        object.__setattr__(self, "t", t)

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
