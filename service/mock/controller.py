"""The simulated controller's side of RTDE: what each output field holds at a simulated time. No sockets."""

import math
from collections.abc import Callable, Mapping, Sequence

import numpy as np

from service.mock.faults import TIME_BACK_BY, Fault
from service.mock.feed import Feed, Playback
from service.wire.recipe import Number, Recipe
from service.wire.rtde_fields import INPUTS, OUTPUTS, WIDTHS, available

TORQUE_CONSTANTS = (10.0, 10.70, 8.46, 9.00, 9.48, 10.12)
"""Joint torque per motor current of a UR10e [Nm/A], as published with the recordings of S. Mamedov and
S. Mikhel, "Practical Aspects of Model-Based Collision Detection", Frontiers in Robotics and AI, 2020."""

_CONSTANT: Mapping[str, tuple[Number, ...]] = {
    "robot_mode": (7,),  # running
    "joint_mode": (253,) * 6,  # running
    "safety_mode": (1,),  # normal
    "safety_status": (1,),
    "safety_status_bits": (1,),
    "robot_status_bits": (3,),  # powered on, a program runs
    "runtime_state": (2,),  # playing
    "speed_scaling": (1.0,),
    "target_speed_fraction": (1.0,),
    "actual_main_voltage": (48.0,),
    "actual_robot_voltage": (48.0,),
    "actual_joint_voltage": (48.0,) * 6,
    "joint_temperatures": (30.0,) * 6,
    "actual_tool_accelerometer": (0.0, 0.0, -9.81),
    "target_gravity": (0.0, 0.0, -9.81),
}

_Getter = Callable[[float, int], Sequence[Number]]


class Controller:
    """Values of RTDE output fields, off a recorded motion.

    Args:
        feed: The motion.
        playback: Which sample is due when.
        version: Major, minor and bugfix version and build of the controller's software.
        torque_constants: Newton metres per ampere, for the field `actual_current`, shape (6,).
        fields: Values of further fields, or others than usual: numbers that stay, shape (width,), or a row
            per sample, shape (N,) or (N, width).

    Raises:
        ValueError: The motion is not one of 6 joints, or `fields` holds an unknown name or a wrong shape.
    """

    def __init__(
        self,
        feed: Feed,
        playback: Playback,
        *,
        version: tuple[int, int, int, int] = (5, 23, 0, 0),
        torque_constants: Sequence[float] = TORQUE_CONSTANTS,
        fields: Mapping[str, np.ndarray] | None = None,
    ) -> None:
        if feed.q.ndim != 2 or feed.q.shape[1] != 6:
            raise ValueError(f"expected a motion of 6 joints, got joint positions of shape {feed.q.shape}")
        self.version = version
        self.fault = Fault.NONE
        self._t0 = float(feed.t[0])
        self._playback = playback
        torque = np.asarray(feed.joint_torque, dtype=float)
        current = torque / np.asarray(torque_constants, dtype=float)
        qdd = np.gradient(np.asarray(feed.qd, dtype=float), 1.0 / feed.rate, axis=0)
        self._columns: dict[str, np.ndarray] = {
            "actual_q": feed.q,
            "target_q": feed.q,
            "actual_qd": feed.qd,
            "target_qd": feed.qd,
            "target_qdd": qdd,
            "actual_current": current,
            "joint_control_output": current,
            "actual_current_as_torque": torque,
        }
        self._values: dict[str, tuple[Number, ...]] = dict(_CONSTANT)
        for name, values in (fields or {}).items():
            self._override(name, np.asarray(values), len(feed.t))
        self.inputs: dict[str, tuple[Number, ...]] = {}
        """What clients wrote: input field -> its numbers."""

    def _override(self, name: str, values: np.ndarray, n: int) -> None:
        if name not in OUTPUTS:
            raise ValueError(f"fields: expected names of RTDE outputs, got {name!r}")
        width = WIDTHS[OUTPUTS[name]]
        if values.size == width and values.ndim <= 1:
            self.set_output(name, values.reshape(width).tolist())
        elif values.shape in ((n, width), (n,)[: 1 if width == 1 else 0]):
            self._columns[name] = values.reshape(n, width)
        else:
            raise ValueError(
                f"fields: {name}: expected shape ({width},) or ({n}, {width}), got {values.shape}"
            )

    def set_output(self, name: str, values: Sequence[Number]) -> None:
        """Give a field a value that stays, such as an output register."""
        self._columns.pop(name, None)
        self._values[name] = tuple(values)

    def output_types(self, names: Sequence[str]) -> list[str]:
        """Type of each output field, `NOT_FOUND` where this version does not have it."""
        return [OUTPUTS[name] if available(name, self.version[:3]) else "NOT_FOUND" for name in names]

    @staticmethod
    def input_types(names: Sequence[str]) -> list[str]:
        """Type of each input field, `NOT_FOUND` where there is none of that name."""
        return [INPUTS.get(name, "NOT_FOUND") for name in names]

    def packer(self, recipe: Recipe) -> Callable[[float], bytes]:
        """A function from simulated time [s] to the data frame of that recipe."""
        getters = [self._getter(name) for name in recipe.names]
        stamped = recipe.slices["timestamp"] if "timestamp" in recipe.slices else slice(0, 0)

        def pack(t: float) -> bytes:
            index = self._playback.index(t)
            values: list[Number] = []
            for getter in getters:
                values.extend(getter(t, index))
            if self.fault is Fault.NAN:
                stamp = values[stamped]
                values = [math.nan if isinstance(v, float) else v for v in values]
                values[stamped] = stamp
            return recipe.pack(values)

        return pack

    def _getter(self, name: str) -> _Getter:
        if name == "timestamp":
            return self._timestamp
        if name.startswith("input_"):
            return self._written(name)
        zero = 0.0 if OUTPUTS[name] in ("DOUBLE", "VECTOR3D", "VECTOR6D") else 0
        zeros: tuple[Number, ...] = (zero,) * WIDTHS[OUTPUTS[name]]

        def get(_: float, index: int) -> Sequence[Number]:
            column = self._columns.get(name)
            if column is None:
                return self._values.get(name, zeros)
            row: list[Number] = column[index].tolist()
            return row

        return get

    def _timestamp(self, t: float, _: int) -> Sequence[Number]:
        back = TIME_BACK_BY if self.fault is Fault.TIME_BACK else 0.0
        return (self._t0 + t - back,)

    def _written(self, name: str) -> _Getter:
        zeros = (0,) * WIDTHS[OUTPUTS[name]]
        return lambda _t, _i: self.inputs.get(name, zeros)
