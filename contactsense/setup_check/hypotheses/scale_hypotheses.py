"""Wrong scales of the signals: other units, wrong torque constants or calibrations, values without signal."""

from dataclasses import replace

import numpy as np

from contactsense.scene import Scene
from contactsense.setup_check.hypotheses.hypothesis import Hypothesis
from contactsense.setup_check.hypotheses.scaled_setups import (
    FORCE_UNITS,
    MOMENT_UNITS,
    TORQUE_UNITS,
    forces_in_units,
    moments_in_units,
    torques_in_units,
    wrench_in_units,
    wrench_times_units,
)
from contactsense.setup_check.lines import FROZEN_TORQUES, SCALE, signal_line, torque_scale
from contactsense.setup_check.setup import BASE, Free, Setup

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
    line, free = signal_line(field, SCALE), (Free("force", field), Free("moment", field))
    return [
        Hypothesis(line, wrench_in_units(setup, field), free),
        Hypothesis(line, wrench_times_units(setup, field), (Free("wrench", field),), special=True),
        Hypothesis(line, forces_in_units(setup, field), free[:1], special=True),
        Hypothesis(line, moments_in_units(setup, field), free[1:], special=True),
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
    found = [Hypothesis(line, torques_in_units(setup), (Free("gain"),))]
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
