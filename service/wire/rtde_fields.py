"""RTDE fields of UR controllers: names, types, and the controller version that introduced each field.

Source: Universal Robots, "Real-Time Data Exchange (RTDE)", and the versions that ur_rtde 1.6.5 checks for.
"""

from collections.abc import Mapping
from types import MappingProxyType

TYPE_CODES: Mapping[str, str] = MappingProxyType(
    {
        "BOOL": "?",
        "UINT8": "B",
        "UINT32": "I",
        "UINT64": "Q",
        "INT32": "i",
        "DOUBLE": "d",
        "VECTOR3D": "3d",
        "VECTOR6D": "6d",
        "VECTOR6INT32": "6i",
        "VECTOR6UINT32": "6I",
    }
)
"""RTDE type -> `struct` code of its big-endian form."""

WIDTHS: Mapping[str, int] = MappingProxyType(
    {name: int(code[:-1] or "1") for name, code in TYPE_CODES.items()}
)
"""RTDE type -> how many numbers it holds."""

JOINTS = WIDTHS["VECTOR6D"]
"""How many joints an arm has whose controller speaks RTDE."""

_OUTPUTS_BY_TYPE = {
    "DOUBLE": """timestamp actual_execution_time speed_scaling target_speed_fraction actual_momentum
        actual_main_voltage actual_robot_voltage actual_robot_current standard_analog_input0
        standard_analog_input1 standard_analog_output0 standard_analog_output1 io_current
        tool_analog_input0 tool_analog_input1 tool_output_current tool_temperature tcp_force_scalar
        payload joint_position_deviation_ratio collision_detection_ratio euromap67_24V_voltage
        euromap67_24V_current actual_robot_energy_consumed actual_robot_braking_energy_dissipated""",
    "VECTOR6D": """target_q target_qd target_qdd target_current target_moment actual_q actual_qd
        actual_current actual_current_window actual_current_as_torque joint_control_output
        actual_TCP_pose actual_TCP_speed actual_TCP_force target_TCP_pose target_TCP_speed
        joint_temperatures actual_joint_voltage ft_raw_wrench payload_inertia tcp_offset
        target_base_wrench wrench_calc_from_currents target_base_acceleration""",
    "VECTOR3D": "actual_tool_accelerometer elbow_position elbow_velocity payload_cog target_gravity",
    "VECTOR6INT32": "joint_mode",
    "INT32": """robot_mode safety_mode safety_status tool_output_voltage encoder0_raw encoder1_raw
        time_scale_source""",
    "UINT8": "tool_output_mode tool_digital_output0_mode tool_digital_output1_mode",
    "UINT32": """runtime_state robot_status_bits safety_status_bits analog_io_types tool_mode
        tool_analog_input_types output_bit_registers0_to_31 output_bit_registers32_to_63
        input_bit_registers0_to_31 input_bit_registers32_to_63 script_control_line
        euromap67_input_bits euromap67_output_bits""",
    "UINT64": "control_step actual_digital_input_bits actual_digital_output_bits",
}

_INPUTS_BY_TYPE = {
    "UINT8": """standard_digital_output_mask standard_digital_output configurable_digital_output_mask
        configurable_digital_output tool_digital_output_mask tool_digital_output
        standard_analog_output_mask standard_analog_output_type""",
    "UINT32": "speed_slider_mask input_bit_registers0_to_31 input_bit_registers32_to_63",
    "DOUBLE": "speed_slider_fraction standard_analog_output_0 standard_analog_output_1",
    "VECTOR6D": "external_force_torque",
}


def _registers(direction: str) -> dict[str, str]:
    registers = {f"{direction}_int_register_{i}": "INT32" for i in range(48)}
    registers |= {f"{direction}_double_register_{i}": "DOUBLE" for i in range(48)}
    registers |= {f"{direction}_bit_register_{i}": "BOOL" for i in range(64, 128)}
    return registers


def _table(by_type: Mapping[str, str], registers: Mapping[str, str]) -> Mapping[str, str]:
    named = {name: kind for kind, names in by_type.items() for name in names.split()}
    return MappingProxyType(named | dict(registers))


OUTPUTS: Mapping[str, str] = _table(_OUTPUTS_BY_TYPE, _registers("output") | _registers("input"))
"""Every field that the controller sends -> its type. Input registers can be read back."""

INPUTS: Mapping[str, str] = _table(_INPUTS_BY_TYPE, _registers("input"))
"""Every field that the controller accepts -> its type."""

SINCE: Mapping[str, Mapping[int, tuple[int, int]]] = MappingProxyType(
    {
        "payload": {3: (11, 0), 5: (5, 1)},
        "payload_cog": {3: (11, 0), 5: (5, 1)},
        "payload_inertia": {3: (15, 0), 5: (11, 0)},
        "ft_raw_wrench": {5: (9, 0)},
        "actual_current_as_torque": {5: (23, 0), 10: (11, 0)},
        "target_gravity": {5: (26, 0), 10: (12, 0)},
        "target_base_wrench": {5: (26, 0), 10: (14, 0)},
    }
)
"""Field -> controller generation -> first (minor, bugfix) with that field. Absent: in all versions."""


def available(name: str, version: tuple[int, int, int]) -> bool:
    """Whether a controller of that version (major, minor, bugfix) sends the field."""
    if name not in OUTPUTS:
        return False
    rules = SINCE.get(name)
    if rules is None:
        return True
    major, minor, bugfix = version
    if major in rules:
        return (minor, bugfix) >= rules[major]
    return major > max(rules)
