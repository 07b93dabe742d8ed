"""What no single push explains is said to be that."""

import numpy as np

from contactsense import Localizer
from contactsense.kinematics.forward_kinematics import forward_kinematics
from contactsense.kinematics.model import build_model, empty_motion
from tests.plain_arm import contacts, plain_ur5e

ARM = plain_ur5e()
TRUTH = contacts(ARM, 1, seed=1)
Q = np.array([0.2, -1.1, 1.3, -0.8, -1.2, 0.5])


def test_a_force_far_beside_the_arm_is_no_contact(precise: Localizer) -> None:
    motion = empty_motion(6)
    forward_kinematics(build_model(ARM), Q, motion)
    R, o = motion.rotation[2], motion.origin[2]
    point = R @ np.array([-0.2, 0.0, 0.5]) + o
    force = R @ np.array([0.0, 20.0, 0.0])
    wrench = np.concatenate((force, np.cross(point, force)))
    torque = np.where(np.arange(6) < 2, -motion.screw @ wrench, 0.0)
    answer = precise.locate(Q, base_wrench=wrench, joint_torque=torque)
    assert answer.other > 0.9
    assert "no single push" in answer.reason
    assert answer.status == "ambiguous"


def test_a_couple_is_no_contact(precise: Localizer) -> None:
    answer = precise.locate(Q, base_wrench=np.array([0.0, 0.0, 0.0, 5.0, -3.0, 4.0]))
    assert answer.other > 0.9


def test_a_clear_push_has_little_other_probability(precise: Localizer) -> None:
    answer = precise.locate(TRUTH.q[0], base_wrench=TRUTH.base_wrench[0], joint_torque=TRUTH.torque[0])
    assert answer.other < 0.01
