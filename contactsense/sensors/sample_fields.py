"""Convert a `Sample` to the arguments of the kernels."""

import contextlib
from collections.abc import Mapping, Sequence

import numpy as np

from contactsense.sensors.link_values import by_field, name_of, with_values
from contactsense.sensors.stream_state import INVALID, MAX_SENSORS, MISSING, UNSETTLED, Readings
from contactsense.sensors.validation import as_floats, checked_vector
from contactsense.types import Sample

_FLOAT = np.dtype(np.float64)
"""For which NumPy mostly uses this object, but not in an array that was unpickled."""
SENSORS = ("base_wrench", "joint_torque")
"""The first two sensors of every scene; its link sensors follow."""


class SampleFields:
    """Conversion for the sensors of one scene."""

    def __init__(self, in_scene: tuple[bool, bool], link_sensors: Sequence[str], joints: int) -> None:
        """Prepare the placeholders for values that a sample does not have.

        Args:
            in_scene: Which of `SENSORS` the scene has.
            link_sensors: Fields of its link sensors, see `contactsense.sensors.link_values`.
            joints: Of its arm.
        """
        self._base, self._torque = in_scene
        self._joints = joints
        self._no_torque, self._no_wrench = _placeholder(joints), _placeholder(6)
        self._link_sensors = tuple(link_sensors)
        self._link_names = tuple(name_of(field) for field in self._link_sensors)
        self._link_wrench = np.zeros((len(self._link_sensors), 6))
        self.names = (*SENSORS, *self._link_sensors)
        """Of the sensors, in the order of their flags."""
        there = (*in_scene, *(True for _ in self._link_sensors))
        absent = (i for i in range(MAX_SENSORS) if i >= len(there) or not there[i])
        self.relevant_flags = ~sum((MISSING | INVALID | UNSETTLED) << i for i in absent)
        """Flags that apply to this scene: a sensor that the scene does not have is not missing."""

    def fields(self, sample: Sample) -> tuple[float, int, Readings]:
        """Time; which sensors have a value, one bit each; the readings. The next call fills the array of the
        link sensors anew.

        Raises:
            ValueError: the value of a link sensor has the wrong shape.
            TypeError, AttributeError: the time is no float, or a field no vector of floats.
        """
        t, q, qd, torque, base = sample.t, sample.q, sample.qd, sample.joint_torque, sample.base_wrench
        sensor_bits = 3
        if base is None or not self._base:
            sensor_bits, base = sensor_bits - 1, self._no_wrench
        if torque is None or not self._torque:
            sensor_bits, torque = sensor_bits - 2, self._no_torque
        if self._link_sensors:
            others = {} if sample.link_wrenches is None else sample.link_wrenches
            for s, name in enumerate(self._link_names):
                value = sample.wrist_wrench if name is None else others.get(name)
                if value is not None:
                    if len(value) != 6:
                        raise ValueError(f"{self._link_sensors[s]}: expected 6 numbers, got {len(value)}")
                    if type(value) is not np.ndarray or value.dtype is not _FLOAT:
                        value = as_floats(self._link_sensors[s], value)
                    self._link_wrench[s] = value
                    sensor_bits += 4 << s
        if not isinstance(t, float):  # estimates keep it as it is
            raise TypeError("expected a float")
        # Kernels that are called directly take this for granted.
        if not (
            type(q) is type(qd) is type(torque) is type(base) is np.ndarray
            and q.dtype is qd.dtype is torque.dtype is base.dtype is _FLOAT
            and q.ndim == qd.ndim == torque.ndim == base.ndim == 1
        ) and not _are_vectors(q, qd, torque, base):
            raise TypeError("expected vectors of floats")
        return t, sensor_bits, (q, qd, torque, base, self._link_wrench)

    def compile_sample(self) -> Sample:
        """A sample to compile the kernels with: any float arrays are accepted afterwards."""
        torque = self._no_torque
        return Sample(0.0, torque, torque, torque, self._no_wrench)

    def values(
        self,
        q: np.ndarray,
        torque: np.ndarray | None = None,
        base: np.ndarray | None = None,
        links: Mapping[str, np.ndarray] | None = None,
    ) -> Readings:
        """One measurement of an arm at rest, as vectors of floats: positions and a value for each sensor,
        zeros for missing values. In place of the velocities, which nothing reads, are the positions again.

        Raises:
            ValueError: a value has the wrong shape, is no number or, unless it is an array of floats, not
                finite; the message names it.
        """
        if self._link_sensors:
            for s, name in enumerate(self._link_sensors):
                value = (links or {}).get(name)
                self._link_wrench[s] = 0.0 if value is None else checked_vector(name, value, 6, "N, Nm")
        if torque is None:
            torque = self._no_torque
        if base is None:
            base = self._no_wrench
        # Kernels that are called directly take this for granted; a column of pandas is no array.
        if (
            type(q) is type(torque) is type(base) is np.ndarray
            and q.dtype is torque.dtype is base.dtype is _FLOAT
            and q.ndim == torque.ndim == base.ndim == 1
        ):
            return q, q, torque, base, self._link_wrench
        return self.checked((q, q, torque, base, self._link_wrench))

    def checked(self, values: Readings) -> Readings:
        """What `values` returns as arrays of finite floats that the kernels accept.

        Raises:
            ValueError: one has the wrong shape or is not finite; the message names it.
        """
        q, _, torque, base, link_wrench = values
        q = checked_vector("q", q, self._joints, "rad")
        return (
            q,
            q,
            checked_vector("joint_torque", torque, self._joints, "Nm"),
            checked_vector("base_wrench", base, 6, "N, Nm"),
            link_wrench,
        )

    def shaped(self, sample: Sample) -> Sample:
        """The same sample as arrays of floats that the kernels accept.

        Raises:
            ValueError: a field has the wrong shape or is no number; the message names it.
            TypeError: it is no sample.
        """
        if not isinstance(sample, Sample):
            raise TypeError(f"sample: expected a Sample, got {type(sample).__name__}")
        n = self._joints
        shaped = Sample(
            _number("t", sample.t),
            _shaped("q", sample.q, n),
            _shaped("qd", sample.qd, n),
            None if sample.joint_torque is None else _shaped("joint_torque", sample.joint_torque, n),
            None if sample.base_wrench is None else _shaped("base_wrench", sample.base_wrench, 6),
        )
        values = by_field(sample.wrist_wrench, sample.link_wrenches)
        links = {name: _shaped(name, value, 6) for name, value in values.items()}
        return with_values(shaped, links)


def _are_vectors(*values: np.ndarray) -> bool:
    return all(
        isinstance(value, np.ndarray)
        and not isinstance(value, np.ma.MaskedArray)
        and value.dtype == _FLOAT
        and value.ndim == 1
        for value in values
    )


def _placeholder(size: int) -> np.ndarray:
    """Zeros of the most general array type, strided and read-only: kernels compiled for it accept any float
    array."""
    array = np.zeros(2 * size)[::2]
    array.setflags(write=False)
    return array


def _number(name: str, value: object) -> float:
    """A number of any type; words, flags and dates are none."""
    with contextlib.suppress(TypeError, ValueError):
        if np.asarray(value).dtype.kind not in "SUbMm":
            return float(value)  # type: ignore[arg-type]
    raise ValueError(f"{name}: expected a number, got {value!r:.60}")


def _shaped(name: str, value: object, size: int) -> np.ndarray:
    array = as_floats(name, value)
    if array.shape != (size,):
        raise ValueError(f"{name}: expected shape ({size},), got shape {array.shape}")
    return array
