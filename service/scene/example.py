"""The scene of a typical cell, for docs/scene.md: every number of sensor, friction and gripper is an
example."""

from typing import Any

EXAMPLE: dict[str, Any] = {
    "robot": "ur10e",
    "mounting": [0.0, 0.5236, 0.0],
    "tool": {
        "name": "gripper",
        "mass": 1.2,
        "com": [0.0, 0.0, 0.06],
        "tensor": [0.0021, 0.0, 0.0, 0.0021, 0.0, 0.0009],
        "primitives": [
            {"kind": "cylinder", "a": [0, 0, 0.0], "b": [0, 0, 0.09], "radius_a": 0.04, "radius_b": 0.04,
             "rounding": 0.004},
            {"kind": "box", "center": [0, 0, 0.115], "half": [0.05, 0.015, 0.025], "rounding": 0.004},
        ],
    },
    "bodies": [
        {"name": "adapter", "role": "pedestal",
         "primitives": [{"kind": "cylinder", "a": [0, 0, -0.035], "b": [0, 0, 0], "radius_a": 0.11,
                         "radius_b": 0.11, "rounding": 0.003}]},
        {"name": "table", "translation": [0.86, 0.0, -0.08], "rpy": [0.0, -0.5236, 0.0],
         "primitives": [{"kind": "box", "center": [0, 0, 0], "half": [0.3, 0.5, 0.02], "rounding": 0.005}]},
    ],
    "base_wrench": {
        "force_noise": 0.3,
        "moment_noise": 0.05,
        "rpy": [0.0, 0.0, 0.7854],
        "translation": [0.0, 0.0, -0.035],
        "sign": "sensor_on_arm",
        "range": [2000.0, 600.0],
    },
    "joint_torque": {
        "signal": "actual_current",
        "torque_constants": [10.0, 10.7, 8.46, 9.0, 9.48, 10.12],
        "noise": [1.7, 1.7, 1.2, 0.5, 0.5, 0.5],
        "friction": {
            "coulomb": [11.0, 12.0, 8.0, 2.5, 2.5, 2.5],
            "viscous": [12.0, 13.0, 8.0, 2.0, 2.0, 2.0],
            "error": 0.1,
        },
    },
    "touchable": ["upper_arm", "forearm", "wrist_1", "wrist_2", "wrist_3", "gripper"],
}  # fmt: skip
"""A UR10e, tilted, on an adapter plate on a force/torque sensor, with motor currents and a gripper, beside a
table."""
