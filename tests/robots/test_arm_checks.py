"""A robot that was built in Python is checked as one from a file, where a scene takes it."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from contactsense import Scene, SceneError, robots
from tests.unknown_limits import without_limits

ARM = robots.load("ur5e")
ELBOW, FOREARM = 2, 3
INERTIA = ARM.links[FOREARM].inertia
SKEWED = np.array([[0.1, 0.05, 0.0], [0.0, 0.1, 0.0], [0.0, 0.0, 0.1]])


def with_joint(**changes: Any) -> robots.Robot:
    joints = list(ARM.joints)
    joints[ELBOW] = replace(joints[ELBOW], **changes)
    return replace(ARM, joints=tuple(joints))


def with_link(**changes: Any) -> robots.Robot:
    links = list(ARM.links)
    links[FOREARM] = replace(links[FOREARM], **changes)
    return replace(ARM, links=tuple(links))


@pytest.mark.parametrize(
    ("arm", "message"),
    [
        (with_joint(rotation=2.0 * np.eye(3)), "joint elbow_joint: rotation: expected a rotation matrix"),
        (with_joint(rotation=np.diag([1.0, 1.0, -1.0])), "joint elbow_joint: rotation: expected a rotation"),
        (with_joint(translation=(-425.0, 0.0, 0.0)), r"translation: .* if these are mm: \[-0.425, 0, 0\]"),
        (with_joint(position_limits=(3.0, -3.0)), "position_limits: expected two angles, the lower first"),
        (with_joint(position_limits=(np.nan, 3.0)), "position_limits: expected two angles, the lower first"),
        (with_joint(position_limits=(3.0,)), "position_limits: expected two angles, the lower first"),
        (with_joint(position_limits=(-180.0, 180.0)), r"if these are degrees: \(-3.142, 3.142\)"),
        (with_joint(velocity_limit=-1.0), "velocity_limit: expected a number above 0"),
        (with_joint(torque_limit=0.0), "joint elbow_joint: torque_limit: expected a number above 0"),
        (with_joint(torque_limit="150"), "torque_limit: expected a number above 0, .* got '150'"),
        (with_joint(rotor_inertia=np.nan), "rotor_inertia: expected a number of at least 0, got nan"),
        (with_joint(torque_constant=0.0), "torque_constant: expected a number above 0, or None, got 0.0"),
        (with_joint(name="wrist_1_joint"), "joints: expected names, each once, got 'wrist_1_joint' 2 times"),
        (with_link(name="upper_arm"), "links: expected names, each once, got 'upper_arm' 2 times"),
        (with_link(name=""), "links: expected names, each once, got an empty one"),
        (with_link(inertia=replace(INERTIA, com=1e3 * INERTIA.com)), "link forearm: com: .* if these are mm"),
        (with_link(inertia=replace(INERTIA, tensor=SKEWED)), "tensor: expected a symmetric matrix"),
        (with_link(inertia=replace(INERTIA, tensor=-np.eye(3))), "tensor: expected the inertia of a body"),
        (replace(ARM, flange_rotation=np.zeros((3, 3))), "flange: rotation: expected a rotation matrix"),
        (replace(ARM, links=ARM.links[:1], joints=()), "joints: expected at least one, got none"),
    ],
)
def test_what_no_arm_is_like_is_named(arm: robots.Robot, message: str) -> None:
    with pytest.raises(SceneError, match=rf"^robot: .*{message}"):
        Scene(robot=arm)


def test_what_an_arm_may_be_is_accepted() -> None:
    rounded = with_joint(rotation=ARM.joints[ELBOW].rotation.round(4), position_limits=(-np.inf, np.inf))
    for arm in (ARM, without_limits(ARM), rounded, with_joint(position_limits=(0.0, 0.0))):
        assert Scene(robot=arm).robot is arm
