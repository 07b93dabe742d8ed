"""A sample on its way to the kernels, and what is to be said of it in words."""

import numpy as np

from contactsense.check import checked_vector
from contactsense.health import Health, complaints
from contactsense.stream import DOUBT, MISSING, SETTLES, SPOILT
from contactsense.types import Sample

SENSORS = ("base_wrench", "joint_torque", "wrist_wrench")


class Intake:
    """For the sensors of one scene."""

    def __init__(self, fitted: tuple[bool, bool, bool], joints: int) -> None:
        """`fitted`: which of `SENSORS` the scene has."""
        self._base, self._torque, self._wrist = fitted
        self._joints = joints
        self._no_torque, self._no_wrench = _any(joints), _any(6)
        self.heeded = ~sum((MISSING | SPOILT) << i for i, there in enumerate(fitted) if not there)
        """What can be said of samples of this scene: sensors that it does not have are not missing."""

    def fields(
        self, sample: Sample
    ) -> tuple[float, int, np.ndarray, np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
        """Time; which sensors have a value, a bit each; positions, velocities; a value for each sensor."""
        torque, base, wrist = sample.joint_torque, sample.base_wrench, sample.wrist_wrench
        given = 7
        if base is None or not self._base:
            given, base = given - 1, self._no_wrench
        if torque is None or not self._torque:
            given, torque = given - 2, self._no_torque
        if wrist is None or not self._wrist:
            given, wrist = given - 4, self._no_wrench
        return sample.t, given, sample.q, sample.qd, torque, base, wrist

    def first(self) -> Sample:
        """A sample to compile the kernels for: all arrays of floats can be handed to them then."""
        torque, wrench = self._no_torque, self._no_wrench
        return Sample(0.0, torque, torque, torque, wrench, wrench)

    def values(
        self,
        q: np.ndarray,
        torque: np.ndarray | None = None,
        base: np.ndarray | None = None,
        wrist: np.ndarray | None = None,
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
        """Positions and a value for each sensor, in the order of the kernels; zeros for what is not given."""
        return (
            q,
            self._no_torque if torque is None else torque,
            self._no_wrench if base is None else base,
            self._no_wrench if wrist is None else wrist,
        )

    def checked(
        self, q: np.ndarray, torque: np.ndarray, base: np.ndarray, wrist: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
        """The same as arrays of finite floats that can be handed on.

        Raises:
            ValueError: one has the wrong shape or is not finite; the message names it.
        """
        return (
            checked_vector("q", q, self._joints, "rad"),
            checked_vector("joint_torque", torque, self._joints, "N, Nm"),
            checked_vector("base_wrench", base, 6, "N, Nm"),
            checked_vector("wrist_wrench", wrist, 6, "N, Nm"),
        )

    def shaped(self, sample: Sample) -> Sample:
        """The same sample as arrays of floats that can be handed on.

        Raises:
            ValueError: a field has the wrong shape; the message names it.
        """
        n = self._joints
        return Sample(
            float(sample.t),
            _shaped("q", sample.q, n),
            _shaped("qd", sample.qd, n),
            None if sample.joint_torque is None else _shaped("joint_torque", sample.joint_torque, n),
            None if sample.base_wrench is None else _shaped("base_wrench", sample.base_wrench, 6),
            None if sample.wrist_wrench is None else _shaped("wrist_wrench", sample.wrist_wrench, 6),
        )


def _any(size: int) -> np.ndarray:
    """Zeros of the most general kind, strided and read-only: any array of floats can be taken for one."""
    array = np.zeros(2 * size)[::2]
    array.setflags(write=False)
    return array


def _shaped(name: str, value: object, size: int) -> np.ndarray:
    array = np.array(value, dtype=np.float64)
    if array.shape != (size,):
        raise ValueError(f"{name}: expected shape ({size},), got shape {array.shape}")
    return array


def troubles(said: int, health: Health) -> str:
    """Why a sample's estimate is `degraded`, in words.

    Args:
        said: What there is to be said, see `contactsense.stream`.
        health: Of the stream.
    """
    found = []
    for i, name in enumerate(SENSORS):
        if said & MISSING << i:
            found.append(f"{name} is missing")
        elif said & SPOILT << i:
            found.append(f"{name} is not finite, or too large to be true")
    if said & DOUBT:
        found += complaints(health)
    if said & SETTLES and not found:
        found.append("observer settles after its start")
    return "; ".join(found)
