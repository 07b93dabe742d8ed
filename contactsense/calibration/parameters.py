"""The parameters that can be estimated: names, units and prior standard deviations.

The prior is centred on the scene's own value. It matters only if the motion contains little information; a
parameter that is not excited is reported and kept.
"""

from dataclasses import dataclass
from typing import Literal, get_args

import numpy as np

from contactsense.calibration.calibration_model import CalibrationModel
from contactsense.robots.torque_scale import torque_scales

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
OPTIONAL_FRICTION: tuple[Group, ...] = ("load", "lubricant")
"""Terms of friction that many drives do not show."""
OPTIONAL: tuple[Group, ...] = (*OPTIONAL_FRICTION, "tilt")
"""Groups that keep the scene's values if they are not significant."""

INERTIA_ERROR = 0.1
"""Usual relative standard deviation of the links' masses about the robot's data."""

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


def entries(
    arm: CalibrationModel, groups: tuple[Group, ...], inertia_error: float = INERTIA_ERROR
) -> tuple[Entry, ...]:
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
            "viscous": (0.1, "Nm s/rad"),
            "rotor": (0.03, "kg m^2"),
            "lubricant": (0.1, "Nm"),
            "load": (0.0, ""),
            "gain": (0.0, ""),
        }[group]
        ratio, torques = {"load": 0.2, "gain": 0.3}.get(group), torque_scales(arm.scene.robot)
        return [
            Entry(group, (j,), f"{group} of {joint.name}", unit, ratio or fraction * float(torques[j]), j)
            for j, joint in enumerate(joints)
        ]
    parts = _parts(group)
    if group in OF_LINK_SENSORS:
        kind = group.removeprefix("link_")
        return [
            Entry(group, (s, i)[: len(parts)], f"{field} {kind} {name}".rstrip(), unit, size, sensor=field)
            for s, field in enumerate(arm.scene.link_sensors)
            for i, (name, unit, size) in enumerate(parts)
        ]
    if group == "delay":
        return [Entry("delay", (), "delay of the base sensor", *parts[0][1:])]
    # A rotation about gravity does not change it.
    down = int(np.argmax(np.abs(arm.scene.gravity_base))) if group == "tilt" else -1
    label = group.replace("_", " ")
    return [
        Entry(group, (i,), f"{label} {name}", unit, size)
        for i, (name, unit, size) in enumerate(parts)
        if i != down
    ]


def _parts(group: Group) -> list[tuple[str, str, float]]:
    """Name, unit and prior standard deviation of each parameter of the tool, of gravity or of a sensor."""
    if group == "payload":
        return [("mass", "kg", 5.0)] + [(f"mass x com {a}", "kg m", 0.5) for a in _AXES]
    if group in ("wrench_bias", "link_bias"):
        return _BIASES
    if group in ("delay", "link_delay"):
        return [("", "s", 0.02)]
    unit, size = ("m", 0.05) if group in ("shift", "link_shift") else ("rad", 0.1)
    return [(axis, unit, size) for axis in _AXES]


def _link_parameters(arm: CalibrationModel, inertia_error: float) -> list[Entry]:
    units = ("kg", *("kg m",) * 3, *("kg m^2",) * 6)
    scales = inertia_error * inertial_scales(arm.links)
    # The base does not move: its weight is indistinguishable from a bias.
    return [
        Entry("links", (k, c), f"{link.name} {_INERTIAL[c]}", units[c], float(scales[k, c]))
        for k, link in enumerate(arm.scene.robot.links)
        for c in range(10)
        if k > 0
    ]


def inertial_scales(links: np.ndarray) -> np.ndarray:
    """Scale of each inertial parameter, (L, 10) as `links`: by the link's mass and radius of gyration."""
    mass = links[:, 0]
    size = np.sqrt(np.maximum(links[:, [4, 6, 9]].sum(axis=1), 1e-6) / (2.0 * np.maximum(mass, 1e-3)))
    return np.column_stack([mass] + [mass * size] * 3 + [mass * size**2] * 6)


def value(arm: CalibrationModel, entry: Entry) -> float:
    """Value of the parameter."""
    return float(np.asarray(getattr(arm, entry.group))[entry.index])


def apply_step(
    arm: CalibrationModel, selected: list[Entry] | tuple[Entry, ...], step: np.ndarray
) -> CalibrationModel:
    """A copy of the arm with each selected parameter changed by its step."""
    changes: dict[str, np.ndarray] = {}
    for entry, change in zip(selected, step, strict=True):
        changed = changes.setdefault(entry.group, np.array(getattr(arm, entry.group)))
        changed[entry.index] += change
    return arm.with_values(**{name: x if x.ndim else float(x) for name, x in changes.items()})
