"""An arm as data: what is refused, what is the same, and that nothing changes it."""

import copy
from dataclasses import fields, replace
from typing import Any

import numpy as np
import pytest

from contactsense import robots
from contactsense.robots.robot import Inertia, Joint, Robot

ARM = robots.load("ur5e")
BODY = ARM.links[2].inertia
PARTS = [BODY, ARM.joints[1], ARM]


@pytest.mark.parametrize(
    ("part", "change", "told"),
    [
        (BODY, {"mass": -1.0}, "mass: expected a finite number >= 0, got -1"),
        (BODY, {"mass": np.inf}, "mass: expected a finite number >= 0, got inf"),
        (BODY, {"mass": np.nan}, "mass: expected a finite number >= 0, got nan"),
        (BODY, {"com": np.zeros(2)}, r"com: expected shape \(3,\), got \(2,\)"),
        (BODY, {"com": np.array([0.0, np.nan, 0.0])}, "com: expected finite numbers, got"),
        (BODY, {"tensor": np.zeros(3)}, r"tensor: expected shape \(3, 3\), got \(3,\)"),
        (ARM.joints[1], {"axis": np.array([0.0, 0.0, 1.01])}, "axis: expected a unit vector, got"),
        (ARM.joints[1], {"rotation": np.zeros((3, 4))}, r"rotation: expected shape \(3, 3\), got \(3, 4\)"),
        (ARM.joints[1], {"translation": np.full(3, np.inf)}, "translation: expected finite numbers, got"),
        (ARM, {"links": ARM.links[1:]}, "6 joints carry 6 links, and one base: expected 7 links, got 6"),
        (ARM, {"flange_rotation": np.eye(4)}, r"flange_rotation: expected shape \(3, 3\), got \(4, 4\)"),
        (ARM, {"flange_translation": np.zeros(2)}, r"flange_translation: expected shape \(3,\), got \(2,\)"),
    ],
)
def test_what_is_no_part_of_an_arm_is_refused(part: Any, change: dict[str, Any], told: str) -> None:
    with pytest.raises(ValueError, match=told):
        replace(part, **change)


@pytest.mark.parametrize("part", PARTS, ids=["inertia", "joint", "robot"])
def test_parts_are_the_same_where_all_their_numbers_are(part: Inertia | Joint | Robot) -> None:
    assert part == copy.deepcopy(part)
    assert part != "another"
    others: dict[str, Any] = {
        "axis": np.array([1.0, 0.0, 0.0]), "links": ARM.links[:1], "joints": (), "name": "another",
        "file": "another", "tip": "another", "held": ("another",), "position_limits": (-1.0, 1.0),
        "torque_constant": 1.0,
    }  # fmt: skip
    for each in fields(part):
        own = getattr(part, each.name)
        other = others.get(each.name, own + 1.0 if isinstance(own, float | np.ndarray) else None)
        changes = {each.name: other}
        if each.name in ("links", "joints"):
            changes = {"links": others["links"], "joints": others["joints"]}
        assert part != replace(part, **changes), each.name


def test_nothing_changes_an_arm() -> None:
    own = np.array([0.1, 0.2, 0.3])
    body = replace(BODY, com=own)
    own[0] = 5.0
    assert body.com[0] == 0.1
    with pytest.raises(ValueError, match="read-only"):
        body.com[0] = 5.0


@pytest.mark.parametrize(
    ("limits", "found"),
    [
        ((-2.0, 2.5), (-2.0, 2.5)),
        ((-6.0, 0.2), (-6.0, 0.2)),
        ((-6.0, 0.3), (-np.pi, np.pi)),
        ((-np.inf, np.inf), (-np.pi, np.pi)),
    ],
)
def test_a_joint_needs_no_more_than_a_turn(limits: tuple[float, float], found: tuple[float, float]) -> None:
    assert replace(ARM.joints[1], position_limits=limits).range_within_turn == found
