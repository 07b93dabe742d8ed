"""A sample on its way to the kernels, and what is to be said of it in words."""

import numpy as np

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
