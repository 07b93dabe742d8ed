"""Momentum for a unit velocity of each joint, against the momenta of the bodies."""

import numpy as np
import pytest

from contactsense import robots
from contactsense.kinematics.composite_inertia import unit_momenta, unit_momenta_of_arm
from contactsense.kinematics.model import build_model, empty_motion
from contactsense.kinematics.momenta import body_momentum_and_weight, kinematics_and_momenta

MODEL = build_model(robots.load("ur5e"))
GRAVITY = np.array([0.0, 0.0, -9.81])
Q = np.array([0.3, -1.1, 1.4, -0.6, 0.9, 2.0])


@pytest.mark.parametrize("first_body", [1, 3, 6, 7])
@pytest.mark.parametrize("part_mass", [0.0, 2.5])
def test_it_is_the_momentum_of_what_each_joint_moves(first_body: int, part_mass: float) -> None:
    com, inertia = np.array([0.02, -0.05, 0.1]), part_mass * np.diag([0.02, 0.03, 0.015])
    motion, found = empty_motion(6), np.empty((6, 6))
    kinematics_and_momenta(MODEL, Q, np.zeros(6), GRAVITY, motion)
    unit_momenta(MODEL, motion, first_body, (part_mass, com, inertia), found)
    carrier = first_body - 1
    for j in range(6):
        kinematics_and_momenta(MODEL, Q, np.eye(6)[j], GRAVITY, motion)
        expected = motion.momentum[first_body].copy() if first_body < 7 else np.zeros(6)
        if carrier > 0:
            part = np.empty(6)
            body_momentum_and_weight(
                part_mass, com, inertia, motion.rotation[carrier], motion.origin[carrier],
                motion.twist[carrier], GRAVITY, part, np.empty(6),
            )  # fmt: skip
            expected += part
        np.testing.assert_allclose(found[j], expected, atol=1e-12)


def test_that_of_the_whole_arm_has_all_moving_bodies() -> None:
    motion, found, expected = empty_motion(6), np.empty((6, 6)), np.empty((6, 6))
    kinematics_and_momenta(MODEL, Q, np.zeros(6), GRAVITY, motion)
    unit_momenta_of_arm(MODEL, motion, found)
    for j in range(6):
        kinematics_and_momenta(MODEL, Q, np.eye(6)[j], GRAVITY, motion)
        expected[j] = motion.momentum[0]
    np.testing.assert_allclose(found, expected, atol=1e-12)
