"""Convert a `Sample` to the arguments of the kernels."""

import numpy as np

from contactsense.sensors.stream_state import INVALID, MISSING
from contactsense.sensors.validation import checked_vector
from contactsense.types import Sample

SENSORS = ("base_wrench", "joint_torque", "wrist_wrench")


class SampleFields:
    """Conversion for the sensors of one scene."""

    def __init__(self, in_scene: tuple[bool, bool, bool], joints: int) -> None:
        """`in_scene`: which of `SENSORS` the scene has."""
        self._base, self._torque, self._wrist = in_scene
        self._joints = joints
        self._no_torque, self._no_wrench = _placeholder(joints), _placeholder(6)
        self.relevant_flags = ~sum((MISSING | INVALID) << i for i, there in enumerate(in_scene) if not there)
        """Flags that apply to this scene: a sensor that the scene does not have is not missing."""

    def fields(
        self, sample: Sample
    ) -> tuple[float, int, np.ndarray, np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
        """Time; which sensors have a value, one bit each; positions, velocities; a value for each sensor."""
        torque, base, wrist = sample.joint_torque, sample.base_wrench, sample.wrist_wrench
        sensor_bits = 7
        if base is None or not self._base:
            sensor_bits, base = sensor_bits - 1, self._no_wrench
        if torque is None or not self._torque:
            sensor_bits, torque = sensor_bits - 2, self._no_torque
        if wrist is None or not self._wrist:
            sensor_bits, wrist = sensor_bits - 4, self._no_wrench
        return sample.t, sensor_bits, sample.q, sample.qd, torque, base, wrist

    def compile_sample(self) -> Sample:
        """A sample to compile the kernels with: any float arrays are accepted afterwards."""
        torque, wrench = self._no_torque, self._no_wrench
        return Sample(0.0, torque, torque, torque, wrench, wrench)

    def values(
        self,
        q: np.ndarray,
        torque: np.ndarray | None = None,
        base: np.ndarray | None = None,
        wrist: np.ndarray | None = None,
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
        """Positions and a value for each sensor, in the order of the kernels; zeros for missing values."""
        return (
            q,
            self._no_torque if torque is None else torque,
            self._no_wrench if base is None else base,
            self._no_wrench if wrist is None else wrist,
        )

    def checked(
        self, q: np.ndarray, torque: np.ndarray, base: np.ndarray, wrist: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
        """The same as arrays of finite floats that the kernels accept.

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
        """The same sample as arrays of floats that the kernels accept.

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


def _placeholder(size: int) -> np.ndarray:
    """Zeros of the most general array type, strided and read-only: kernels compiled for it accept any float
    array."""
    array = np.zeros(2 * size)[::2]
    array.setflags(write=False)
    return array


def _shaped(name: str, value: object, size: int) -> np.ndarray:
    array = np.array(value, dtype=np.float64)
    if array.shape != (size,):
        raise ValueError(f"{name}: expected shape ({size},), got shape {array.shape}")
    return array
