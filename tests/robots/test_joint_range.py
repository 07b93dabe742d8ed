"""The angles between which a joint takes all of its poses, wherever its zero lies."""

from dataclasses import replace

import numpy as np
import pytest

from contactsense import Scene
from contactsense.plausibility.largest_reading import largest_torque_at_rest
from tests.plain_arm import plain_ur5e

ARM = plain_ur5e()


@pytest.mark.parametrize(
    ("limits", "within"),
    [
        ((-1.0, 2.0), (-1.0, 2.0)),
        ((3.5, 5.0), (3.5, 5.0)),
        ((-0.02, 3.75), (-0.02, 3.75)),
        ((0.0, 2.0 * np.pi), (-np.pi, np.pi)),
        ((-2.0 * np.pi, 2.0 * np.pi), (-np.pi, np.pi)),
        ((-np.inf, np.inf), (-np.pi, np.pi)),
        ((-np.inf, 1.0), (-np.pi, np.pi)),
    ],
)
def test_it_is_the_limits_or_one_turn(limits: tuple[float, float], within: tuple[float, float]) -> None:
    assert replace(ARM.joints[0], position_limits=limits).range_within_turn == within


def test_a_joint_that_moves_beyond_half_a_turn_only_holds_the_arm_in_those_postures() -> None:
    """The upper arm is always within 0.1 rad of upright: the shoulder never holds much."""
    upright = 1.5 * np.pi
    limits = (upright - 0.1, upright + 0.1)
    joints = (ARM.joints[0], replace(ARM.joints[1], position_limits=limits), *ARM.joints[2:])
    free = largest_torque_at_rest(Scene(robot=ARM))[1]
    narrow = largest_torque_at_rest(Scene(robot=replace(ARM, joints=joints)))[1]
    assert 0.0 < narrow < 0.5 * free
