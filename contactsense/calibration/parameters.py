"""The parameters that can be estimated: their names, units, and how large they may plausibly be.

The plausible size is the standard deviation of a prior about the scene's own value. It matters only where
motion tells little; a parameter about which the motion tells next to nothing is named and kept.
"""

from dataclasses import dataclass
from typing import Literal, get_args

import numpy as np

from contactsense.calibration.plant import Plant

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
    "links",
]
GROUPS: tuple[Group, ...] = get_args(Group)
"""All groups, the most important first: of two that cannot be told apart the later one is kept as it is."""

PER_JOINT: tuple[Group, ...] = ("bias", "coulomb", "viscous", "rotor", "load", "lubricant", "gain")
NOT_NEGATIVE: tuple[Group, ...] = ("coulomb", "viscous", "rotor", "load", "lubricant")
ON_DEMAND: tuple[Group, ...] = ("load", "lubricant")
"""Groups that stay as they are where the data do not ask for a change."""

_AXES = ("x", "y", "z")
_INERTIAL = ("mass", "mass x com x", "mass x com y", "mass x com z", "Ixx", "Ixy", "Iyy", "Ixz", "Iyz", "Izz")


@dataclass(frozen=True)
class Entry:
    """One parameter."""

    group: Group
    index: tuple[int, ...]
    """Where it stands in the group's array in `Plant`."""
    name: str
    """For a person."""
    unit: str
    plausible: float
    """Standard deviation of the prior about the scene's value, in `unit`."""
    joint: int | None = None
    """Number of the joint whose equation alone holds it; None: shared by several."""

    @property
    def in_base_only(self) -> bool:
        """Whether only the base sensor's equations hold it."""
        return self.group in ("wrench_bias", "turn", "shift", "delay")


def entries(plant: Plant, groups: tuple[Group, ...], inertia_error: float) -> tuple[Entry, ...]:
    """All parameters of the groups.

    Args:
        plant: The arm.
        groups: Which are wanted.
        inertia_error: Prior standard deviation of each link's mass, relative; of its first and second moments
            accordingly, by the radius of gyration.
    """
    found: list[Entry] = []
    for group in GROUPS:
        if group in groups:
            found += _links(plant, inertia_error) if group == "links" else _of(plant, group)
    return tuple(found)


def _of(plant: Plant, group: Group) -> list[Entry]:
    joints = plant.scene.robot.joints
    if group in PER_JOINT:
        part, unit = {
            "bias": (0.05, "Nm"),
            "coulomb": (0.1, "Nm"),
            "viscous": (0.1, "Nms/rad"),
            "rotor": (0.03, "kg m^2"),
            "lubricant": (0.1, "Nm"),
            "load": (0.0, ""),
            "gain": (0.0, ""),
        }[group]
        plain = {"load": 0.2, "gain": 0.3}.get(group)
        return [
            Entry(group, (j,), f"{group} of {joint.name}", unit, plain or part * joint.torque_limit, j)
            for j, joint in enumerate(joints)
        ]
    if group == "payload":
        parts = [("mass", "kg", 5.0)] + [(f"mass x com {a}", "kg m", 0.5) for a in _AXES]
    elif group == "wrench_bias":
        parts = [(f"force {a}", "N", 50.0) for a in _AXES] + [(f"moment {a}", "Nm", 20.0) for a in _AXES]
    elif group == "delay":
        return [Entry("delay", (), "delay of the base sensor", "s", 0.02)]
    else:
        unit, size = ("m", 0.05) if group == "shift" else ("rad", 0.1)
        # Gravity turned about itself is the same gravity.
        down = int(np.argmax(np.abs(plant.scene.gravity_base))) if group == "tilt" else -1
        return [
            Entry(group, (i,), f"{group} {axis}", unit, size) for i, axis in enumerate(_AXES) if i != down
        ]
    label = group.replace("_", " ")
    return [Entry(group, (i,), f"{label} {name}", unit, size) for i, (name, unit, size) in enumerate(parts)]


def _links(plant: Plant, inertia_error: float) -> list[Entry]:
    found = []
    for k, link in enumerate(plant.scene.robot.links):
        if k == 0:
            continue  # the base does not move: its weight and a bias are the same
        m, moments = plant.links[k, 0], plant.links[k, [4, 6, 9]]
        size = float(np.sqrt(max(moments.sum(), 1e-6) / (2.0 * max(m, 1e-3))))
        sizes = [m, *[m * size] * 3, *[m * size**2] * 6]
        units = ("kg", *("kg m",) * 3, *("kg m^2",) * 6)
        found += [
            Entry("links", (k, c), f"{link.name} {_INERTIAL[c]}", units[c], inertia_error * sizes[c])
            for c in range(10)
        ]
    return found


def value(plant: Plant, entry: Entry) -> float:
    """What the parameter is."""
    return float(np.asarray(getattr(plant, entry.group))[entry.index])


def moved(plant: Plant, chosen: list[Entry] | tuple[Entry, ...], step: np.ndarray) -> Plant:
    """The same plant, each chosen parameter changed by its step."""
    changes: dict[str, np.ndarray | float] = {}
    for entry, change in zip(chosen, step, strict=True):
        if entry.group == "delay":
            changes["delay"] = plant.delay + float(change)
            continue
        if entry.group not in changes:
            changes[entry.group] = np.array(getattr(plant, entry.group))
        array = changes[entry.group]
        assert isinstance(array, np.ndarray)
        array[entry.index] += change
    return plant.with_values(**changes)
