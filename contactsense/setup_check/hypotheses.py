"""What could be wrong: each hypothesis changes one line of the scene, or how a signal is read."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from itertools import permutations, product
from typing import Literal, get_args

import numpy as np
from scipy.spatial.transform import Rotation

from contactsense.scene import Scene
from contactsense.sensors.settings import Meaning
from contactsense.setup_check.setup import Free, Place, Setup

Line = Literal[
    "robot",
    "joint positions: unit",
    "mounting",
    "tool",
    "tool.mass",
    "tool.com",
    "base_wrench.sign",
    "base_wrench.rpy",
    "base_wrench.translation",
    "base_wrench.delay",
    "base wrench: order of axes",
    "base wrench: force and moment",
    "base_wrench.range",
    "wrist_wrench.sign",
    "wrist_wrench.rpy",
    "wrist_wrench.translation",
    "wrist wrench: order of axes",
    "wrist wrench: force and moment",
    "wrist_wrench.bias",
    "wrist_wrench.range",
    "joint_torque.sign",
    "joint_torque.signal",
    "joint_torque.meaning",
]
"""A field of the scene by its path, or, with a colon, a property of the signals that no field states."""
LINES: tuple[Line, ...] = get_args(Line)

_SENSOR_LINES: dict[Place, tuple[Line, Line, Line, Line, Line]] = {
    "base": (
        "base_wrench.sign",
        "base_wrench.rpy",
        "base_wrench.translation",
        "base wrench: order of axes",
        "base wrench: force and moment",
    ),
    "wrist": (
        "wrist_wrench.sign",
        "wrist_wrench.rpy",
        "wrist_wrench.translation",
        "wrist wrench: order of axes",
        "wrist wrench: force and moment",
    ),
}
"""Lines of each force/torque sensor."""
TORQUE_CONSTANT = 10.0
"""Torque per current where neither scene nor arm states it [Nm/A]: that of the UR10e's joints is 8.5 to 10.7.
"""
_LARGEST_ANGLE = 7.0
"""No joint turns further [rad]: those of UR arms make one turn to each side."""
_DELAYS = (-0.05, -0.02, 0.0, 0.02, 0.05)


@dataclass(frozen=True)
class Hypothesis:
    """One way in which the setup may be wrong."""

    line: Line
    starts: tuple[tuple[str, Setup], ...]
    """Alternatives, each with the remark that explains it (may be empty)."""
    free: tuple[Free, ...] = ()
    """Continuous parameters to estimate."""


Builder = Callable[[Setup], Hypothesis | None]


class Hypotheses:
    """All hypotheses that apply to a scene and its sensors."""

    def __init__(
        self,
        scene: Scene,
        others: Mapping[str, Scene],
        largest: float,
        *,
        base: bool,
        torque: bool,
        wrist: bool,
    ) -> None:
        """`others`: the scene with each other arm; `largest`: joint position as read; `base`, `torque`,
        `wrist`: which sensors were recorded."""
        self._scene, self._others, self._largest = scene, others, largest
        arm: list[Builder] = [self._robot, self._angle_unit, self._mounting]
        arm += [self._tool] if scene.tool is None else [self._tool_mass, self._tool_com, self._tool]
        torques: list[Builder] = [self._torque_sign, self._torque_signal, self._torque_meaning]
        self._builders = arm + (torques if torque else [])
        self._places: list[Place] = [*(("base",) if base else ()), *(("wrist",) if wrist else ())]

    def of(self, setup: Setup) -> list[Hypothesis]:
        """All single changes of a setup."""
        found = [hypothesis for build in self._builders if (hypothesis := build(setup)) is not None]
        for place in self._places:
            found += _of_sensor(place, setup)
        return [*found, _wrench_delay(setup)] if "base" in self._places else found

    def _robot(self, setup: Setup) -> Hypothesis | None:
        if setup.robot != self._scene.robot.name or not self._others:
            return None
        return Hypothesis("robot", tuple((name, setup.with_robot(s)) for name, s in self._others.items()))

    def _angle_unit(self, setup: Setup) -> Hypothesis | None:
        if setup.angle_unit != 1.0:
            return None
        units = (("they are in degrees", np.pi / 180.0), ("they were converted twice", 180.0 / np.pi))
        starts = tuple(
            (text, replace(setup, angle_unit=unit))
            for text, unit in units
            if unit * self._largest < _LARGEST_ANGLE
        )
        return Hypothesis("joint positions: unit", starts) if starts else None

    def _mounting(self, setup: Setup) -> Hypothesis:
        size = float(np.linalg.norm(setup.gravity))
        starts = [("", setup)]
        starts += [
            ("", replace(setup, gravity=size * axis))
            for axis in np.vstack((np.eye(3), -np.eye(3)))
            if axis @ setup.gravity < 0.9 * size
        ]
        if isinstance(self._scene.mounting, tuple):
            for text, rpy in mounting_mistakes(self._scene.mounting):
                down = Rotation.from_euler("xyz", rpy).inv().apply([0.0, 0.0, -size])
                if np.linalg.norm(down - setup.gravity) > 0.01 * size:
                    starts.append((text, replace(setup, gravity=down)))
        return Hypothesis("mounting", tuple(starts), ("tilt",))

    def _tool_mass(self, setup: Setup) -> Hypothesis:
        return Hypothesis("tool.mass", (("", setup),), ("mass",))

    def _tool_com(self, setup: Setup) -> Hypothesis | None:
        return Hypothesis("tool.com", (("", setup),), ("com",)) if setup.mass > 0.0 else None

    def _tool(self, setup: Setup) -> Hypothesis:
        some = setup if setup.mass > 0.0 else replace(setup, mass=1.0)
        return Hypothesis("tool", (("", some),), ("mass", "com"))

    def _torque_sign(self, setup: Setup) -> Hypothesis:
        return Hypothesis("joint_torque.sign", (("", replace(setup, gain=-setup.gain)),))

    def _torque_signal(self, setup: Setup) -> Hypothesis:
        constants = torque_constants(self._scene)
        return Hypothesis(
            "joint_torque.signal",
            (
                ("the values are currents [A]", replace(setup, gain=setup.gain / constants)),
                ("the values are torques [Nm]", replace(setup, gain=setup.gain * constants)),
            ),
        )

    def _torque_meaning(self, setup: Setup) -> Hypothesis:
        others = [meaning for meaning in get_args(Meaning) if meaning != setup.meaning]
        return Hypothesis("joint_torque.meaning", tuple(("", replace(setup, meaning=m)) for m in others))


def _of_sensor(place: Place, setup: Setup) -> list[Hypothesis]:
    """What may be wrong with a force/torque sensor."""
    sensor = setup.sensor(place)
    turn: Free = "turn" if place == "base" else "wrist_turn"
    shift: Free = "shift" if place == "base" else "wrist_shift"
    turns = [turn for turn in signed_permutations() if np.linalg.det(turn) > 0.0]
    frames = tuple(("", setup.with_sensor(place, rotation=sensor.rotation @ turn)) for turn in turns)
    swap = np.kron(np.array([[0.0, 1.0], [1.0, 0.0]]), np.eye(3))
    exchanged = setup.with_sensor(place, order=swap @ sensor.order)
    lines = _SENSOR_LINES[place]
    return [
        Hypothesis(lines[0], (("", setup.with_sensor(place, sign=-sensor.sign)),)),
        Hypothesis(lines[1], frames, (turn,)),
        Hypothesis(lines[2], (("", setup),), (shift,)),
        Hypothesis(lines[3], _reordered(place, setup)),
        Hypothesis(lines[4], (("the moment comes first", exchanged),)),
    ]


def _reordered(place: Place, setup: Setup) -> tuple[tuple[str, Setup], ...]:
    starts = []
    for a, b in ((0, 1), (0, 2), (1, 2)):
        swap = np.eye(3)
        swap[[a, b]] = swap[[b, a]]
        starts.append((f"{'xyz'[a]} and {'xyz'[b]} are exchanged", swap))
    for a in range(3):
        mirror = np.eye(3)
        mirror[a, a] = -1.0
        starts.append((f"{'xyz'[a]} points the other way", mirror))
    order = setup.sensor(place).order
    return tuple(
        (text, setup.with_sensor(place, order=order @ np.kron(np.eye(2), axes))) for text, axes in starts
    )


def _wrench_delay(setup: Setup) -> Hypothesis:
    starts = tuple(("", replace(setup, delay=setup.delay + d)) for d in _DELAYS)
    return Hypothesis("base_wrench.delay", starts, ("delay",))


def mounting_mistakes(rpy: tuple[float, float, float]) -> list[tuple[str, tuple[float, float, float]]]:
    """Mountings that are often meant when `rpy` [rad] is written, each with its remark."""
    roll, pitch, yaw = rpy
    degrees = (float(np.radians(roll)), float(np.radians(pitch)), float(np.radians(yaw)))
    reversed_signs = [(-roll, pitch, yaw), (roll, -pitch, yaw), (-roll, -pitch, yaw)]
    return [("given in degrees", degrees), *(("opposite sign", angles) for angles in reversed_signs)]


def torque_constants(scene: Scene) -> np.ndarray:
    """Joint torque per current, of the scene, of the arm, or else `TORQUE_CONSTANT`, shape (n,) [Nm/A]."""
    joints = scene.robot.joints
    if scene.joint_torque is not None and scene.joint_torque.torque_constants is not None:
        return np.array(scene.joint_torque.torque_constants)
    return np.array([joint.torque_constant or TORQUE_CONSTANT for joint in joints])


def signed_permutations() -> list[np.ndarray]:
    """The 48 matrices that exchange and reverse axes; the identity is the first."""
    return [
        np.diag(signs) @ np.eye(3)[list(order)]
        for order in permutations(range(3))
        for signs in product((1.0, -1.0), repeat=3)
    ]
