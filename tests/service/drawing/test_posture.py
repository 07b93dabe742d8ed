"""The posture of an arm while none is known."""

from dataclasses import replace

import numpy as np
import pytest

from contactsense import robots
from contactsense.service.drawing.posture import usual_posture


def test_an_arm_of_universal_robots_is_bent_over_the_table() -> None:
    np.testing.assert_allclose(np.degrees(usual_posture(robots.load("ur5e"))), [0, -70, 80, -60, 0, 0])


@pytest.mark.parametrize("joints", [1, 3, 6])
@pytest.mark.parametrize("limits", [(-0.1, 0.2), (0.5, 1.0), (-3.0, -2.0)])
def test_other_arms_are_within_their_limits(joints: int, limits: tuple[float, float]) -> None:
    arm = robots.load("ur5e")
    some = tuple(replace(joint, position_limits=limits) for joint in arm.joints[:joints])
    q = usual_posture(replace(arm, joints=some, links=arm.links[: joints + 1]))
    assert q.shape == (joints,)
    assert np.all((q >= limits[0]) & (q <= limits[1]))
