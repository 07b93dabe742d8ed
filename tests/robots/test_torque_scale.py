"""Torques of joints whose limits are not known, compared with the limits of arms whose limits are."""

from dataclasses import replace

import numpy as np
import pytest

from contactsense import robots
from contactsense.robots.robot import NO_MASS
from contactsense.robots.torque_scale import torque_scales
from tests.unknown_limits import without_limits


@pytest.mark.parametrize("name", robots.names())
def test_an_unknown_limit_is_estimated_from_the_masses(name: str) -> None:
    arm = robots.load(name)
    limits = np.array([joint.torque_limit for joint in arm.joints])
    np.testing.assert_array_equal(torque_scales(arm), limits)
    ratio = torque_scales(without_limits(arm)) / limits
    assert ((ratio > 0.2) & (ratio < 1.5)).all()


def test_a_known_limit_beside_unknown_ones_counts() -> None:
    arm = robots.load("ur5e")
    partly = replace(arm, joints=(arm.joints[0], *without_limits(arm).joints[1:]))
    np.testing.assert_array_equal(
        torque_scales(partly), [arm.joints[0].torque_limit, *torque_scales(without_limits(arm))[1:]]
    )


def test_an_arm_without_masses_has_a_scale() -> None:
    arm = without_limits(robots.load("ur5e"))
    empty = replace(arm, links=tuple(replace(link, inertia=NO_MASS) for link in arm.links))
    assert (torque_scales(empty) == 1.0).all()
