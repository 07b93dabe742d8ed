"""Wrong scales of the signals: other units, wrong torque constants or calibrations, values without signal."""

from dataclasses import replace

import numpy as np

from contactsense.scene import Scene
from contactsense.setup_check.hypothesis import Hypothesis
from contactsense.setup_check.lines import FROZEN_TORQUES, label, torque_scale
from contactsense.setup_check.setup import BASE, SCALED, Free, Setup

_POUND, _INCH, _G = 4.4482216152605, 0.0254, 9.80665
"""Pound-force [N], inch [m], and the force of a kilogram [N]."""
TORQUE_UNITS = {
    "Ncm": 100.0,
    "mNm": 1000.0,
    "kgf m": 1.0 / _G,
    "kgf cm": 100.0 / _G,
    "lbf ft": 1.0 / (_POUND * 12.0 * _INCH),
    "lbf in": 1.0 / (_POUND * _INCH),
}
"""Values per newton metre."""
FORCE_UNITS = {"kgf": 1.0 / _G, "lbf": 1.0 / _POUND, "mN": 1000.0}
"""Values per newton."""
MOMENT_UNITS = {**TORQUE_UNITS, "Nmm": 1000.0}
_UNIT_ERROR = 0.04
"""A scale this close to that of a unit, as a natural logarithm, is taken for it."""


def unit_remark(forces: float, moments: float) -> str:
    """Which units forces and moments are in, by their values per newton and newton metre; empty: none that is
    usual."""
    names = _named(forces, {"N": 1.0, **FORCE_UNITS}), _named(moments, {"Nm": 1.0, **MOMENT_UNITS})
    if "" in names or names == ("N", "Nm"):
        return ""
    return f"forces are in {names[0]}, moments in {names[1]}"


def torque_remark(scale: float) -> str:
    """Which unit torques are in, by their values per newton metre; empty: none."""
    unit = _named(scale, TORQUE_UNITS)
    return f"they are in {unit}" if unit else ""


def _named(scale: float, units: dict[str, float]) -> str:
    near = (unit for unit, value in units.items() if abs(np.log(scale / value)) < _UNIT_ERROR)
    return next(near, "")


def sensor_scales(field: str, setup: Setup) -> list[Hypothesis]:
    """Forces and moments of a force/torque sensor of two scales, of one, or only one of them of another."""
    sensor, line = setup.sensors[field], f"{label(field)} wrench: scale"

    def scaled(force: float, moment: float) -> tuple[str, Setup]:
        factors = force ** SCALED["force"] * moment ** SCALED["moment"]
        return "", setup.with_sensor(field, order=sensor.order * factors)

    forces, moments = (1.0, *FORCE_UNITS.values()), (1.0, *MOMENT_UNITS.values())
    same = tuple(scaled(value, value) for value in forces)
    return [
        Hypothesis(
            line,
            tuple(scaled(force, moment) for force in forces for moment in moments),
            (Free("force", field), Free("moment", field)),
        ),
        Hypothesis(line, same, (Free("wrench", field),), special=True),
        Hypothesis(line, tuple(scaled(x, 1.0) for x in forces), (Free("force", field),), special=True),
        Hypothesis(line, tuple(scaled(1.0, x) for x in moments), (Free("moment", field),), special=True),
    ]


def torque_scales(scene: Scene, setup: Setup, moving: np.ndarray) -> list[Hypothesis]:
    """The joint torques of another scale, one for all, one each or that of one joint; or values that do not
    follow them.

    One each only where a base sensor confirms arm and tool: from torques alone, six constants explain another
    arm with another tool, too.

    `moving`: which joints move, shape (n,): a joint at rest may hold any torque up to its Coulomb friction,
    so nothing is said about it alone.
    """
    line = torque_scale(scene)
    scales = [("", replace(setup, gain=scale * setup.gain)) for scale in (1.0, *TORQUE_UNITS.values())]
    found = [Hypothesis(line, tuple(scales), (Free("gain"),))]
    joints = np.flatnonzero(moving & (setup.gain != 0.0)).tolist()
    if len(joints) > 1 and BASE in setup.sensors:
        each = tuple(Free("gain", joint=joint) for joint in joints)
        found.append(Hypothesis(line, (("", setup),), each, special=True))
    for joint in joints:
        free = (Free("gain", joint=joint),)
        found.append(Hypothesis(line, (("", setup),), free, special=True, joint=joint))
        silent = setup.gain.copy()
        silent[joint] = 0.0
        starts = (("the values do not follow its torque", replace(setup, gain=silent)),)
        found.append(Hypothesis(FROZEN_TORQUES, starts, special=True, joint=joint))
    return found
