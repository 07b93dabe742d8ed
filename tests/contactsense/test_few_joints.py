"""Arms of one and of two joints. Arrays of one number are contiguous, which others need not be."""

from dataclasses import replace

import numpy as np
import pytest

from contactsense import Localizer, Sample, SampleBlock, Scene, forward_model
from contactsense.kinematics.forward_kinematics import forward_kinematics
from contactsense.kinematics.model import build_model, empty_motion
from tests.plain_arm import plain_ur5e

PLACES = {1: ((0.06, 0.0, 0.03), (1.0, 0.0, 0.0)), 2: ((-0.2, 0.0, 0.188), (0.0, 0.0, 1.0))}
"""Place and outward normal on the last link, by the number of joints."""


@pytest.mark.slow
@pytest.mark.parametrize("joints", [1, 2])
def test_a_push_on_the_last_link_is_located(joints: int) -> None:
    whole = plain_ur5e()
    robot = replace(whole, links=whole.links[: joints + 1], joints=whole.joints[:joints])
    scene, q = Scene(robot=robot), np.full(joints, 0.3)
    link = scene.link_names[-1]
    point, normal = np.array(PLACES[joints])
    motion = empty_motion(joints)
    forward_kinematics(build_model(robot), q, motion)
    free = forward_model(scene, q, link, point, np.zeros(3))
    push = forward_model(scene, q, link, point, -20.0 * motion.rotation[joints] @ normal)
    samples = [
        Sample(0.002 * i, q, 0.0 * q, read.joint_torque, read.base_wrench)
        for i in range(400)
        for read in (free if i < 200 else push,)
    ]
    localizer = Localizer(scene)
    estimates = list(localizer.run(samples))
    assert {estimate.status for estimate in estimates[50:200]} == {"none"}
    found = estimates[-1].contacts[0]
    assert found.link == link
    np.testing.assert_allclose(found.point, point, atol=2e-3)
    columns = (np.array([getattr(s, name) for s in samples]) for name in ("t", "q", "qd"))
    readings = (np.array([getattr(s, name) for s in samples]) for name in ("joint_torque", "base_wrench"))
    (blocks,) = localizer.run_blocks([SampleBlock(*columns, *readings)])
    assert blocks.link_probability[-1].argmax() == found.link_index
    np.testing.assert_array_equal(blocks.phase[:200], blocks.phase[0])
