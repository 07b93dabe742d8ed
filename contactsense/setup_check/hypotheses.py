"""What could be wrong: each hypothesis changes one line of the scene, or how a signal is read."""

import re
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace
from itertools import permutations, product
from typing import Any, get_args

import numpy as np
from scipy.spatial.transform import Rotation

from contactsense.scene import Scene
from contactsense.sensors.settings import CURRENTS, Meaning
from contactsense.setup_check.setup import BASE, Free, Setup

Line = str
"""A field of the scene by its path, or, with a colon, a property of the signals that no field states."""
_ARM: tuple[Line, ...] = (
    "robot", "joint positions: unit", "mounting", "tool", "tool.mass", "tool.com",
)  # fmt: skip
TORQUE_LINES: tuple[Line, ...] = ("joint_torque.sign", "joint_torque.signal", "joint_torque.meaning")


def lines(scene: Scene) -> tuple[Line, ...]:
    """All lines of a scene that can be checked, in the order in which they are reported."""
    sensors = [line for field in wrench_fields(scene) for line in sensor_lines(field)]
    return (*_ARM, *sensors, *TORQUE_LINES)


def wrench_fields(scene: Scene) -> tuple[str, ...]:
    """Fields of the force/torque sensors of a scene, the base sensor first."""
    return (*(() if scene.base_wrench is None else (BASE,)), *scene.link_sensors)


def sensor_lines(field: str) -> tuple[Line, ...]:
    """Lines of one force/torque sensor."""
    last = field.rpartition(".")[2].removesuffix("_wrench")
    signals = (f"{last} wrench: order of axes", f"{last} wrench: force and moment")
    stated = ["sign", "rpy", "translation", "delay"]
    if field.startswith("link_wrenches."):
        stated.insert(0, "link")
    # A stream estimates the bias of the base sensor; the others keep the scene's.
    own = ("range",) if field == BASE else ("bias", "range")
    return (*(f"{field}.{name}" for name in stated), *signals, *(f"{field}.{name}" for name in own))


def sensor_of(scene: Scene, line: Line) -> str | None:
    """Field of the force/torque sensor that a line is about; None: it is about none."""
    found = [field for field in wrench_fields(scene) if line in sensor_lines(field)]
    return found[0] if found else None


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


class Hypotheses:
    """All hypotheses that apply to a scene and its sensors."""

    def __init__(
        self,
        scene: Scene,
        others: Mapping[str, Scene],
        largest: float,
        torque: bool,
        fields: Iterable[str],
    ) -> None:
        """`others`: the scene with each other arm; `largest`: joint position as read; `torque`: whether joint
        torques were recorded; `fields`: which force/torque sensors were."""
        self._scene, self._others, self._largest = scene, others, largest
        self._torque, self._fields = torque, tuple(fields)

    def of(self, setup: Setup) -> list[Hypothesis]:
        """All single changes of a setup."""
        found = [*self._arm(setup), self._mounting(setup), *self._tool(setup)]
        if self._torque:
            found += self._torques(setup)
        for field in self._fields:
            found += self._sensor(field, setup)
        return found

    def _arm(self, setup: Setup) -> list[Hypothesis]:
        """Another arm, or another unit of its joint positions."""
        robots = [(name, setup.with_robot(scene)) for name, scene in self._others.items()]
        units = [
            (text, replace(setup, angle_unit=unit))
            for text, unit in (
                ("they are in degrees", np.pi / 180.0),
                ("they were converted twice", 180.0 / np.pi),
            )
            if unit * self._largest < _LARGEST_ANGLE
        ]
        found = []
        if setup.robot == self._scene.robot.name and robots:
            found.append(Hypothesis("robot", tuple(robots)))
        if setup.angle_unit == 1.0 and units:
            found.append(Hypothesis("joint positions: unit", tuple(units)))
        return found

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
        return Hypothesis("mounting", tuple(starts), (Free("tilt"),))

    def _tool(self, setup: Setup) -> list[Hypothesis]:
        mass, com = Free("mass"), Free("com")
        some = setup if setup.mass > 0.0 else replace(setup, mass=1.0)
        found = []
        if self._scene.tool is not None:
            found.append(Hypothesis("tool.mass", (("", setup),), (mass,)))
            if setup.mass > 0.0:
                found.append(Hypothesis("tool.com", (("", setup),), (com,)))
        return [*found, Hypothesis("tool", (("", some),), (mass, com))]

    def _torques(self, setup: Setup) -> list[Hypothesis]:
        """What may be wrong with the joint torques."""
        others = [meaning for meaning in get_args(Meaning) if meaning != setup.meaning]
        return [
            Hypothesis("joint_torque.sign", (("", replace(setup, gain=-setup.gain)),)),
            *self._signal(setup),
            Hypothesis("joint_torque.meaning", tuple(("", replace(setup, meaning=m)) for m in others)),
        ]

    def _signal(self, setup: Setup) -> list[Hypothesis]:
        """Currents where the scene states torques, or the reverse. Torques that are too large in proportion
        are no signal that a scene could state."""
        if abs(setup.gain[0]) != 1.0:
            return []
        torque, constants = self._scene.joint_torque, torque_constants(self._scene)
        if torque is not None and torque.signal in CURRENTS:
            start = ("the values are torques [Nm]", replace(setup, gain=setup.gain * constants))
        else:
            start = ("the values are currents [A]", replace(setup, gain=setup.gain / constants))
        return [Hypothesis("joint_torque.signal", (start,))]

    def _sensor(self, field: str, setup: Setup) -> list[Hypothesis]:
        """What may be wrong with a force/torque sensor."""
        sensor = setup.sensors[field]

        def changed(**changes: Any) -> tuple[str, Setup]:
            return "", setup.with_sensor(field, **changes)

        turns = [turn for turn in signed_permutations() if np.linalg.det(turn) > 0.0]
        others = [link for link in range(1, len(self._scene.robot.links)) if link != sensor.body]
        swap = np.kron(np.array([[0.0, 1.0], [1.0, 0.0]]), np.eye(3))
        exchanged = setup.with_sensor(field, order=swap @ sensor.order)
        frames = tuple(changed(rotation=sensor.rotation @ turn) for turn in turns)
        delays = tuple(changed(delay=sensor.delay + late) for late in _DELAYS)
        found = {
            "sign": Hypothesis("", (changed(sign=-sensor.sign),)),
            "rpy": Hypothesis("", frames, (Free("turn", field),)),
            "translation": Hypothesis("", (("", setup),), (Free("shift", field),)),
            "delay": Hypothesis("", delays, (Free("delay", field),)),
            "order of axes": Hypothesis("", _reordered(field, setup)),
            "force and moment": Hypothesis("", (("the moment comes first", exchanged),)),
            "link": Hypothesis("", tuple(changed(body=body) for body in others)),
        }
        names = {line: re.split(r"\.|: ", line)[-1] for line in sensor_lines(field)}
        return [replace(found[name], line=line) for line, name in names.items() if name in found]


def _reordered(field: str, setup: Setup) -> tuple[tuple[str, Setup], ...]:
    swaps = {"x and y": [1, 0, 2], "x and z": [2, 1, 0], "y and z": [0, 2, 1]}
    starts = [(f"{axes} are exchanged", np.eye(3)[turned]) for axes, turned in swaps.items()]
    starts += [
        (f"{axis} points the other way", np.diag(1.0 - 2.0 * unit))
        for axis, unit in zip("xyz", np.eye(3), strict=True)
    ]
    order = setup.sensors[field].order
    return tuple(
        (text, setup.with_sensor(field, order=order @ np.kron(np.eye(2), axes))) for text, axes in starts
    )


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
