"""The body of the cell that explains a contact."""

import numpy as np
import pytest

from contactsense import Scene
from contactsense.kinematics.forward_kinematics import forward_kinematics
from contactsense.kinematics.model import empty_motion
from contactsense.output.touched_body import TouchedBody
from contactsense.robots.link_poses import link_poses
from contactsense.robots.primitives import Box, Cylinder
from contactsense.robots.surroundings import Body
from contactsense.scene_model.constants import build_constants
from tests.plain_arm import plain_ur5e

Q = np.array([0.3, -0.6, 1.2, -1.9, -1.4, 0.5])
UP = np.array([0.0, 0.0, 40.0])
COLUMN = Cylinder(a=(0, 0, -0.4), b=(0, 0, 0), radius_a=0.12, radius_b=0.12, rounding=0.01)


@pytest.mark.parametrize("unknown", [np.inf, np.nan])
def test_an_unknown_place_names_no_obstacle(unknown: float) -> None:
    place = link_poses(plain_ur5e(), Q)[3, :3, 3]
    slab = Box(center=(0, 0, -0.05), half=(0.6, 0.6, 0.05), rounding=0.01)
    table = Body(name="table", translation=tuple(place.tolist()), primitives=(slab,))
    column = Body(name="column", role="pedestal", primitives=(COLUMN,))
    scene = Scene(robot=plain_ur5e(), bodies=(table, column))
    constants, motion = build_constants(scene), empty_motion(6)
    forward_kinematics(constants.model, Q, motion)
    bodies = TouchedBody(scene, constants, motion)
    assert bodies.name(3, 0, place, UP, 1e-4 * np.eye(3)) == "table"
    for covariance in (np.full((3, 3), unknown), np.diag([1e-4, 1e-4, unknown])):
        assert bodies.name(3, 0, place, UP, covariance) == ""
        # The primitive of the base is known without the place.
        assert bodies.name(0, int(constants.surfaces.start[1]) - 1, place, UP, covariance) == "column"
