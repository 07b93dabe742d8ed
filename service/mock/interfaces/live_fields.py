"""RTDE output fields of the simulated controller that executes commands."""

from collections.abc import Callable, Mapping, Sequence

import numpy as np
from scipy.spatial.transform import Rotation

from contactsense.service.mock.controller.robot_controller import RobotController
from contactsense.service.mock.controller.robot_state import Reading, RuntimeState
from contactsense.service.mock.interfaces.rtde_fields import Controller, Getter
from contactsense.service.wire.recipe import Number

_PROTECTIVE = 3
"""safety_mode and safety_status of a protective stop."""
_DIGITAL_OUTPUTS = {"standard_digital_output": 0, "configurable_digital_output": 8, "tool_digital_output": 16}
"""Input field -> first bit of `actual_digital_output_bits` that it sets."""


class LiveController(Controller):
    """A controller whose arm executes the commands of clients.

    Args:
        robot: The simulated robot.
        version: Version of the controller's software: major, minor, bugfix, build.
    """

    def __init__(self, robot: RobotController, version: tuple[int, int, int, int] = (5, 23, 0, 0)) -> None:
        super().__init__(version)
        self.robot = robot
        self.inputs = robot.inputs
        tool = robot.cell.tool
        if tool is not None:
            self.set_output("payload", [tool.mass])
            self.set_output("payload_cog", list(tool.com))
            self.set_output("payload_inertia", [tool.tensor[i] for i in (0, 3, 5, 1, 2, 4)])
        self.set_output("target_gravity", list(robot.cell.gravity))
        self._newest: tuple[float, Reading] = (-1.0, robot.at(0.0))
        self._moving = _fields(self)
        for number, name in enumerate(robot.cell.torque_fields or ()):
            self._moving[name] = _component(number, lambda r: r.torque)
        self._delays = {"ft_raw_wrench": robot.cell.wrist_delay}
        for sensor in robot.cell.links:
            for number, name in enumerate(sensor.fields):
                self._moving[name] = _component(number, _reading_of(sensor.name))
                self._delays[name] = sensor.delay

    def advance(self, t: float) -> None:
        """Advance the robot to time t [s]."""
        self.robot.advance_to(t)

    def receive(self, inputs: Mapping[str, tuple[Number, ...]]) -> None:
        """Process the values that a client wrote to input fields: registers, speed slider, outputs."""
        self.robot.receive(dict(inputs))
        self._set_digital_outputs(inputs)

    def moving_field(self, name: str) -> Getter | None:
        """Return the getter of a field from the robot's state."""
        get = self._moving.get(name)
        if name.startswith("output_") and "_register_" in name and get is None:
            return lambda _: self.robot.outputs.get(name) or self._values.get(name, (0,))
        if get is None:
            return None
        known, delay = get, self._delays.get(name, 0.0)
        if delay > 0.0:
            return lambda t: known(self.robot.at(t - delay))
        return lambda t: known(self._at(t))

    def _at(self, t: float) -> Reading:
        if self._newest[0] != t:
            self._newest = t, self.robot.at(t)
        return self._newest[1]

    def _set_digital_outputs(self, inputs: Mapping[str, tuple[Number, ...]]) -> None:
        bits = int(self._values.get("actual_digital_output_bits", (0,))[0])
        for name, first in _DIGITAL_OUTPUTS.items():
            mask = int(inputs.get(f"{name}_mask", (0,))[0]) << first
            wanted = int(inputs.get(name, (0,))[0]) << first
            bits = (bits & ~mask) | (wanted & mask)
        self.set_output("actual_digital_output_bits", [bits])


_FieldOfReading = Callable[[Reading], Sequence[Number]]


def _reading_of(name: str) -> Callable[[Reading], np.ndarray]:
    return lambda reading: reading.links[name]


def _component(number: int, of: Callable[[Reading], np.ndarray]) -> _FieldOfReading:
    return lambda reading: (float(of(reading)[number]),)


def tcp_pose(reading: Reading, controller: LiveController) -> np.ndarray:
    """Pose of the tool flange: position [m] and rotation vector [rad], base frame, shape (6,)."""
    robot = controller.robot.cell.robot
    last = len(robot.links) - 1
    rotation = reading.rotations[last] @ robot.flange_rotation
    origin = reading.origins[last] + reading.rotations[last] @ robot.flange_translation
    return np.concatenate([origin, Rotation.from_matrix(rotation).as_rotvec()])


def _fields(controller: LiveController) -> dict[str, _FieldOfReading]:
    """Field -> function that computes it from the robot's state."""
    cell = controller.robot.cell
    last = len(cell.robot.links) - 1
    constants = cell.torque_constants

    def pose(r: Reading) -> list[float]:
        return tcp_pose(r, controller).tolist()  # type: ignore[no-any-return]

    def speed(r: Reading) -> list[float]:
        lever = r.rotations[last] @ cell.robot.flange_translation
        linear = r.twist[:3] + np.cross(r.twist[3:], lever)
        return [*linear.tolist(), *r.twist[3:].tolist()]

    def force(r: Reading) -> list[float]:
        origin = tcp_pose(r, controller)[:3]
        moment = r.external[3:] - np.cross(origin, r.external[:3])
        return [*r.external[:3].tolist(), *moment.tolist()]

    def current(r: Reading) -> list[float]:
        torque = r.torque + r.model_torque if cell.by_difference else r.torque
        return (torque / constants).tolist()  # type: ignore[no-any-return]

    return {
        "actual_q": lambda r: r.q.tolist(),
        "actual_qd": lambda r: r.qd.tolist(),
        "target_q": lambda r: r.target[0].tolist(),
        "target_qd": lambda r: r.target[1].tolist(),
        "target_qdd": lambda r: r.target[2].tolist(),
        "actual_current": current,
        "joint_control_output": current,
        "target_current": lambda r: (r.model_torque / constants).tolist(),
        "actual_current_as_torque": lambda r: r.torque.tolist(),
        "target_moment": lambda r: r.model_torque.tolist(),
        "actual_TCP_pose": pose,
        "target_TCP_pose": pose,
        "actual_TCP_speed": speed,
        "target_TCP_speed": speed,
        "actual_TCP_force": force,
        "tcp_force_scalar": lambda r: (float(np.linalg.norm(r.external[:3])),),
        "ft_raw_wrench": lambda r: r.wrist.tolist(),
        "elbow_position": lambda r: r.origins[3].tolist(),
        "runtime_state": lambda r: (int(r.runtime),),
        "robot_status_bits": lambda r: (3 if r.runtime is not RuntimeState.STOPPED else 1,),
        "safety_mode": lambda r: (_PROTECTIVE if r.protective else 1,),
        "safety_status": lambda r: (_PROTECTIVE if r.protective else 1,),
        "safety_status_bits": lambda r: (4 | 1024 if r.protective else 1,),
        "speed_scaling": lambda r: (r.speed,),
        "target_speed_fraction": lambda r: (r.slider,),
        "joint_position_deviation_ratio": lambda r: (r.deviation,),
        "collision_detection_ratio": lambda r: (r.collision,),
    }
