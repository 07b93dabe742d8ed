"""The parameters that can be estimated: names, units and prior standard deviations.

The prior is centred on the scene's own value. It matters only if the motion contains little information; a
parameter that is not excited is reported and kept.
"""

from dataclasses import dataclass
from typing import Literal, get_args

import numpy as np

from contactsense.calibration.calibration_model import CalibrationModel

Group = Literal[
    "bias",
    "coulomb",
    "viscous",
    "rotor",
    "load",
    "lubricant",
    "gain",
    "payload",
    "wrench_bias",
    "tilt",
    "turn",
    "shift",
    "delay",
    "link_bias",
    "link_turn",
    "link_shift",
    "link_delay",
    "links",
]
GROUPS: tuple[Group, ...] = get_args(Group)
"""All groups, the most important first: of two that cannot be distinguished, the later one keeps the scene's
value."""

PER_JOINT: tuple[Group, ...] = ("bias", "coulomb", "viscous", "rotor", "load", "lubricant", "gain")
NOT_NEGATIVE: tuple[Group, ...] = ("coulomb", "viscous", "rotor", "load", "lubricant")
OF_LINK_SENSORS: tuple[Group, ...] = ("link_bias", "link_turn", "link_shift", "link_delay")
"""Groups of the force/torque sensors within the arm."""
OPTIONAL: tuple[Group, ...] = ("load", "lubricant")
"""Groups that keep the scene's values if they are not significant."""

_AXES = ("x", "y", "z")
_INERTIAL = ("mass", "mass x com x", "mass x com y", "mass x com z", "Ixx", "Ixy", "Iyy", "Ixz", "Iyz", "Izz")
_BIASES = [(f"force {a}", "N", 50.0) for a in _AXES] + [(f"moment {a}", "Nm", 20.0) for a in _AXES]


@dataclass(frozen=True)
class Entry:
    """One parameter."""

    group: Group
    index: tuple[int, ...]
    """Index in the group's array in `CalibrationModel`."""
    name: str
    """Name in reports."""
    unit: str
    prior_std: float
    """Standard deviation of the prior about the scene's value, in `unit`."""
    joint: int | None = None
    """Index of the joint whose equation alone contains it; None: shared by several."""
    sensor: str | None = None
    """Key in `Scene.link_sensors` of the sensor whose equations alone contain it; None: none of these."""

    @property
    def in_base_only(self) -> bool:
        """Whether only the base sensor's equations contain it."""
        return self.group in ("wrench_bias", "turn", "shift", "delay")


def entries(arm: CalibrationModel, groups: tuple[Group, ...], inertia_error: float) -> tuple[Entry, ...]:
    """All parameters of the groups.

    Args:
        arm: The arm.
        groups: Groups to include.
        inertia_error: Prior standard deviation of each link's mass, relative; of its first and second moments
            accordingly, by the radius of gyration.
    """
    found: list[Entry] = []
    for group in GROUPS:
        if group in groups:
            found += (
                _link_parameters(arm, inertia_error) if group == "links" else _group_parameters(arm, group)
            )
    return tuple(found)


def _group_parameters(arm: CalibrationModel, group: Group) -> list[Entry]:
    joints = arm.scene.robot.joints
    if group in PER_JOINT:
        fraction, unit = {
            "bias": (0.05, "Nm"),
            "coulomb": (0.1, "Nm"),
            "viscous": (0.1, "Nms/rad"),
            "rotor": (0.03, "kg m^2"),
            "lubricant": (0.1, "Nm"),
            "load": (0.0, ""),
            "gain": (0.0, ""),
        }[group]
        ratio = {"load": 0.2, "gain": 0.3}.get(group)
        return [
            Entry(group, (j,), f"{group} of {joint.name}", unit, ratio or fraction * joint.torque_limit, j)
            for j, joint in enumerate(joints)
        ]
    if group in OF_LINK_SENSORS:
        return _link_sensor_parameters(arm, group)
    if group == "payload":
        parts = [("mass", "kg", 5.0)] + [(f"mass x com {a}", "kg m", 0.5) for a in _AXES]
    elif group == "wrench_bias":
        parts = _BIASES
    elif group == "delay":
        return [Entry("delay", (), "delay of the base sensor", "s", 0.02)]
    else:
        unit, size = ("m", 0.05) if group == "shift" else ("rad", 0.1)
        # A rotation about gravity does not change it.
        down = int(np.argmax(np.abs(arm.scene.gravity_base))) if group == "tilt" else -1
        return [
            Entry(group, (i,), f"{group} {axis}", unit, size) for i, axis in enumerate(_AXES) if i != down
        ]
    label = group.replace("_", " ")
    return [Entry(group, (i,), f"{label} {name}", unit, size) for i, (name, unit, size) in enumerate(parts)]


def _link_sensor_parameters(arm: CalibrationModel, group: Group) -> list[Entry]:
    """One group of every sensor within the arm."""
    parts = {
        "link_bias": [(f"bias {name}", unit, size) for name, unit, size in _BIASES],
        "link_turn": [(f"turn {axis}", "rad", 0.1) for axis in _AXES],
        "link_shift": [(f"shift {axis}", "m", 0.05) for axis in _AXES],
        "link_delay": [("delay", "s", 0.02)],
    }[group]
    return [
        Entry(group, (s, i) if len(parts) > 1 else (s,), f"{field} {name}", unit, size, sensor=field)
        for s, field in enumerate(arm.scene.link_sensors)
        for i, (name, unit, size) in enumerate(parts)
    ]


def _link_parameters(arm: CalibrationModel, inertia_error: float) -> list[Entry]:
    found = []
    for k, link in enumerate(arm.scene.robot.links):
        if k == 0:
            continue  # the base does not move: its weight is indistinguishable from a bias
        m, moments = arm.links[k, 0], arm.links[k, [4, 6, 9]]
        size = float(np.sqrt(max(moments.sum(), 1e-6) / (2.0 * max(m, 1e-3))))
        sizes = [m, *[m * size] * 3, *[m * size**2] * 6]
        units = ("kg", *("kg m",) * 3, *("kg m^2",) * 6)
        found += [
            Entry("links", (k, c), f"{link.name} {_INERTIAL[c]}", units[c], inertia_error * sizes[c])
            for c in range(10)
        ]
    return found


def value(arm: CalibrationModel, entry: Entry) -> float:
    """Value of the parameter."""
    return float(np.asarray(getattr(arm, entry.group))[entry.index])


def apply_step(
    arm: CalibrationModel, selected: list[Entry] | tuple[Entry, ...], step: np.ndarray
) -> CalibrationModel:
    """A copy of the arm with each selected parameter changed by its step."""
    changes: dict[str, np.ndarray | float] = {}
    for entry, change in zip(selected, step, strict=True):
        if entry.group == "delay":
            changes["delay"] = arm.delay + float(change)
            continue
        if entry.group not in changes:
            changes[entry.group] = np.array(getattr(arm, entry.group))
        array = changes[entry.group]
        assert isinstance(array, np.ndarray)
        array[entry.index] += change
    return arm.with_values(**changes)
