"""What could be wrong: each hypothesis changes one line of the scene, or how a signal is read."""

import re
from collections.abc import Iterable, Mapping
from dataclasses import replace
from itertools import permutations, product
from typing import Any, get_args

import numpy as np
from scipy.linalg import block_diag
from scipy.spatial.transform import Rotation

from contactsense.scene import Scene
from contactsense.sensors.settings import CURRENTS, Meaning
from contactsense.setup_check.hypotheses.hypothesis import Hypothesis
from contactsense.setup_check.hypotheses.load_hypotheses import link_loads
from contactsense.setup_check.hypotheses.order_hypotheses import angle_orders, torque_orders
from contactsense.setup_check.hypotheses.reversed_scales import reversed_torques, reversed_wrench
from contactsense.setup_check.hypotheses.scale_hypotheses import sensor_scales, torque_scales
from contactsense.setup_check.hypotheses.zero_hypotheses import angle_zeros
from contactsense.setup_check.lines import (
    ANGLE_UNIT,
    AXES_ORDER,
    DELAYED_TORQUES,
    GRAVITY,
    MOUNTING,
    ROBOT,
    TOOL,
    TOOL_COM,
    TOOL_MASS,
    TORQUE_MEANING,
    TORQUE_SIGN,
    TORQUE_SIGNAL,
    VECTOR_ORDER,
    is_on_earth,
    sensor_lines,
    torque_scale,
)
from contactsense.setup_check.setup import Free, Setup

TORQUE_CONSTANT = 10.0
"""Torque per current where neither scene nor arm states it [Nm/A]: that of the UR10e's joints is 8.5 to 10.7.
"""
_LARGEST_ANGLE = 7.0
"""No joint turns further [rad]: those of UR arms make one turn to each side."""
_EARTH = 9.81
"""Gravity [m/s^2]."""
_DELAYS = (-0.05, -0.02, 0.0, 0.02, 0.05)


class Hypotheses:
    """All hypotheses that apply to a scene and its sensors."""

    def __init__(
        self,
        scene: Scene,
        others: Mapping[str, Scene],
        largest: float,
        torque: bool,
        fields: Iterable[str],
        moving: np.ndarray,
    ) -> None:
        """`others`: the scene with each other arm; `largest`: joint position as read; `torque`: whether joint
        torques were recorded; `fields`: which force/torque sensors were; `moving`: which joints move."""
        self._scene, self._others, self._largest, self._moving = scene, others, largest, moving
        self._torque, self._fields = torque, tuple(fields)

    def of(self, setup: Setup) -> list[Hypothesis]:
        """All single changes of a setup."""
        found = [
            *self._arm(setup),
            self._mounting(setup),
            *self._gravity(setup),
            *link_loads(self._scene, setup),
            *self._tool(setup),
        ]
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
            found.append(Hypothesis(ROBOT, tuple(robots)))
        if setup.angle_unit == 1.0 and units:
            found.append(Hypothesis(ANGLE_UNIT, tuple(units)))
        return [*found, *angle_orders(setup), *angle_zeros(setup)]

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
        return Hypothesis(MOUNTING, tuple(starts), (Free("tilt"),))

    def _gravity(self, setup: Setup) -> list[Hypothesis]:
        """The gravity of the Earth, where the scene states another one. No other value is tried: the scale of
        all torques would explain as much."""
        size = float(np.linalg.norm(setup.gravity))
        if is_on_earth(size):
            return []
        start = ("that of the Earth", replace(setup, gravity=_EARTH / size * setup.gravity))
        return [Hypothesis(GRAVITY, (start,))]

    def _tool(self, setup: Setup) -> list[Hypothesis]:
        mass, com = Free("mass"), Free("com")
        some = setup if setup.mass > 0.0 else replace(setup, mass=1.0)
        found = []
        if self._scene.tool is not None:
            found.append(Hypothesis(TOOL_MASS, (("", setup),), (mass,)))
            if setup.mass > 0.0:
                # One in centimetres is too far away for the steps of a fit.
                near = replace(setup, com=np.zeros(3))
                found.append(Hypothesis(TOOL_COM, (("", setup), ("", near)), (com,)))
        return [*found, Hypothesis(TOOL, (("", some),), (mass, com))]

    def _torques(self, setup: Setup) -> list[Hypothesis]:
        """What may be wrong with the joint torques."""
        others = [meaning for meaning in get_args(Meaning) if meaning != setup.meaning]
        other = other_signal(self._scene)
        found = [
            Hypothesis(TORQUE_SIGN, (("", replace(setup, gain=-setup.gain)),)),
            Hypothesis(TORQUE_MEANING, tuple(("", replace(setup, meaning=m)) for m in others)),
            *torque_orders(setup),
            Hypothesis(DELAYED_TORQUES, _late(setup), (Free("lag"),)),
        ]
        if reads_other_signal(setup, self._scene):
            return found
        _, values = meant_signal(self._scene)
        start = (values, replace(setup, gain=np.sign(setup.gain) * other))
        scales = torque_scales(self._scene, setup, self._moving)
        signal = Hypothesis(TORQUE_SIGNAL, (start,))
        turned = reversed_torques(torque_scale(self._scene), setup, other, self._moving)
        return [*found, signal, *scales, *turned]

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
        places = changed(), changed(translation=np.zeros(3))
        found = {
            "sign": Hypothesis("", (changed(sign=-sensor.sign),)),
            "rpy": Hypothesis("", frames, (Free("turn", field),)),
            "translation": Hypothesis("", places, (Free("shift", field),)),
            "delay": Hypothesis("", delays, (Free("delay", field),)),
            AXES_ORDER: Hypothesis("", _reordered(field, setup)),
            VECTOR_ORDER: Hypothesis("", (("the moment comes first", exchanged),)),
            "link": Hypothesis("", tuple(changed(body=body) for body in others)),
        }
        names = {line: re.split(r"\.|: ", line)[-1] for line in sensor_lines(field)}
        single = [replace(found[name], line=line) for line, name in names.items() if name in found]
        return [*single, *sensor_scales(field, setup), *reversed_wrench(field, setup)]


def _late(setup: Setup) -> tuple[tuple[str, Setup], ...]:
    """Joint torques that come earlier or later."""
    return tuple(("", replace(setup, torque_delay=setup.torque_delay + late)) for late in _DELAYS)


def _reordered(field: str, setup: Setup) -> tuple[tuple[str, Setup], ...]:
    """Two axes exchanged or one reversed, or all of them, of forces and moments or of one of them alone."""
    swaps = {"x and y": [1, 0, 2], "x and z": [2, 1, 0], "y and z": [0, 2, 1]}
    changes = [(f"{axes} are exchanged", np.eye(3)[turned]) for axes, turned in swaps.items()]
    changes += [
        (f"{axis} points the other way", np.diag(1.0 - 2.0 * unit))
        for axis, unit in zip("xyz", np.eye(3), strict=True)
    ]
    order, same = setup.sensors[field].order, np.eye(3)
    starts = [(text, block_diag(axes, axes)) for text, axes in changes]
    # All of both is a matter of the sign.
    changes.append(("all axes point the other way", -same))
    starts += [(f"of the forces {text}", block_diag(axes, same)) for text, axes in changes]
    starts += [(f"of the moments {text}", block_diag(same, axes)) for text, axes in changes]
    return tuple((text, setup.with_sensor(field, order=order @ axes)) for text, axes in starts)


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


def other_signal(scene: Scene) -> np.ndarray:
    """Joint torques as read per torque, if the values are torques where the scene states currents, or the
    reverse, shape (n,)."""
    constants = torque_constants(scene)
    return constants if _states_currents(scene) else 1.0 / constants


def meant_signal(scene: Scene) -> tuple[str, str]:
    """The signal of the joint torques other than the one that the scene states, and what its values are."""
    if _states_currents(scene):
        return "actual_current_as_torque", "the values are torques [Nm]"
    return "actual_current", "the values are currents [A]"


def _states_currents(scene: Scene) -> bool:
    return scene.joint_torque is not None and scene.joint_torque.signal in CURRENTS


def reads_other_signal(setup: Setup, scene: Scene) -> bool:
    """Whether a setup takes the joint torques for the other signal; with constants of 1, it is the same."""
    known, other = setup.gain != 0.0, other_signal(scene)  # the gain of frozen torques says nothing
    differs = (other != 1.0)[known].any()
    return bool(differs and (np.abs(setup.gain) == other)[known].all())


def signed_permutations() -> list[np.ndarray]:
    """The 48 matrices (3, 3) that exchange and reverse axes; the identity is the first."""
    return [
        np.diag(signs) @ np.eye(3)[list(order)]
        for order in permutations(range(3))
        for signs in product((1.0, -1.0), repeat=3)
    ]
