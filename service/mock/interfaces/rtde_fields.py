"""A UR controller's side of RTDE: its fields and their values over time. No sockets."""

import math
from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping, Sequence

from contactsense.service.mock.interfaces.wire_faults import TIME_BACK_BY, Fault
from contactsense.service.wire.recipe import Number, Recipe
from contactsense.service.wire.rtde_fields import INPUTS, OUTPUTS, WIDTHS, available

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
    "actual_robot_current": (1.0,),
    "actual_joint_voltage": (48.0,) * 6,
    "actual_current_window": (5.0,) * 6,
    "actual_execution_time": (0.0003,),
    "joint_temperatures": (30.0,) * 6,
    "io_current": (0.05,),
    "tool_mode": (255,),  # idle
    "tool_temperature": (30.0,),
    "euromap67_24V_voltage": (24.0,),
    "actual_tool_accelerometer": (0.0, 0.0, -9.81),
    "target_gravity": (0.0, 0.0, -9.81),
}

Getter = Callable[[float], Sequence[Number]]
"""Returns the numbers of a field at a time [s]."""


class Controller(ABC):
    """Values of RTDE output fields.

    Args:
        version: Version of the controller's software: major, minor, bugfix, build.
        t0: Time stamp at simulated time 0 [s].
    """

    def __init__(self, version: tuple[int, int, int, int] = (5, 23, 0, 0), t0: float = 0.0) -> None:
        self.version = version
        self.fault = Fault.NONE
        self.t0 = t0
        self._values: dict[str, tuple[Number, ...]] = dict(_CONSTANT)
        self.inputs: dict[str, tuple[Number, ...]] = {}
        """Values that clients wrote: input field -> numbers."""

    @abstractmethod
    def moving_field(self, name: str) -> Getter | None:
        """Return the getter of a field that changes over time; None for a constant field."""

    def advance(self, t: float) -> None:  # noqa: B027
        """Advance to simulated time t [s]; called with or without clients. A recorded motion needs no
        steps."""

    def receive(self, inputs: Mapping[str, tuple[Number, ...]]) -> None:
        """Process the values that a client wrote to input fields."""
        self.inputs.update(inputs)

    def set_output(self, name: str, values: Sequence[Number]) -> None:
        """Set a field, such as an output register, to a constant value."""
        self._values[name] = tuple(values)

    def output_types(self, names: Sequence[str]) -> list[str]:
        """Type of each output field; `NOT_FOUND` if this version does not have it."""
        return [OUTPUTS[name] if available(name, self.version[:3]) else "NOT_FOUND" for name in names]

    @staticmethod
    def input_types(names: Sequence[str]) -> list[str]:
        """Type of each input field; `NOT_FOUND` if there is none of that name."""
        return [INPUTS.get(name, "NOT_FOUND") for name in names]

    def packer(self, recipe: Recipe) -> Callable[[float], bytes]:
        """Return a function that maps simulated time [s] to the data frame of that recipe."""
        getters = [self._getter(name) for name in recipe.names]
        stamped = recipe.slices["timestamp"] if "timestamp" in recipe.slices else slice(0, 0)

        def pack(t: float) -> bytes:
            values: list[Number] = []
            for getter in getters:
                values.extend(getter(t))
            if self.fault is Fault.NAN:
                stamp = values[stamped]
                values = [math.nan if isinstance(v, float) else v for v in values]
                values[stamped] = stamp
            return recipe.pack(values)

        return pack

    def _getter(self, name: str) -> Getter:
        if name == "timestamp":
            return self._timestamp
        zero = 0.0 if OUTPUTS[name] in ("DOUBLE", "VECTOR3D", "VECTOR6D") else 0
        zeros: tuple[Number, ...] = (zero,) * WIDTHS[OUTPUTS[name]]
        if name.startswith("input_"):
            return lambda _: self.inputs.get(name, zeros)
        moving = self.moving_field(name)
        return (lambda _: self._values.get(name, zeros)) if moving is None else moving

    def _timestamp(self, t: float) -> Sequence[Number]:
        back = TIME_BACK_BY if self.fault is Fault.TIME_BACK else 0.0
        return (self.t0 + t - back,)
