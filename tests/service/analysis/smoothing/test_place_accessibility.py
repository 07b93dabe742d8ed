"""Places that cannot be touched in a whole contact."""

import math

import numpy as np
import pytest

from contactsense import Scene
from contactsense.kinematics.forward_kinematics import forward_kinematics
from contactsense.kinematics.model import build_model, empty_motion
from contactsense.scene_model.constants import build_constants
from contactsense.service.analysis.smoothing.place_accessibility import log_accessible_share
from tests.plain_arm import plain_ur5e

SCENE = Scene(robot=plain_ur5e())


def _log_share(point: tuple[float, float, float]) -> float:
    """Of a place on the base link [m], known to a millimetre."""
    constants, motion = build_constants(SCENE), empty_motion(6)
    forward_kinematics(build_model(SCENE.robot), np.zeros(6), motion)
    return log_accessible_share(
        constants.surfaces, constants.deviations, constants.prior, 0, np.array(point), 1e-6 * np.eye(3),
        constants.sensors.depth, motion,
    )  # fmt: skip


@pytest.mark.parametrize("inside", [0.0, 0.002, 0.01])
def test_a_place_under_the_base_cannot_be_touched(inside: float) -> None:
    """The mean of several paths may be inside of the link: what counts is the place on its surface."""
    assert _log_share((0.0, 0.0, inside)) == -math.inf


def test_a_place_on_its_side_can() -> None:
    assert _log_share((0.0, 0.075, 0.04)) > -0.1
