"""Neighbours of a link stand where the limits of the joints permit."""

from dataclasses import replace

import numpy as np
import pytest

from contactsense.robots.decomposition.neighbour_poses import neighbour_poses
from tests.robots.shapes import block, two_links


@pytest.mark.parametrize(
    ("limits", "low", "high"),
    [
        ((-2.0, 2.0), -2.0, 2.0),
        ((3.5, 4.5), 3.5, 4.5),
        ((-6.0, -4.0), -6.0, -4.0),
        ((-1.0, 5.0), -1.0, 5.0),
        ((-2.0 * np.pi, 2.0 * np.pi), -np.pi, np.pi),
        ((-np.inf, np.inf), -np.pi, np.pi),
    ],
)
def test_angles_are_within_the_limits_and_one_turn(
    limits: tuple[float, float], low: float, high: float
) -> None:
    robot = two_links()
    robot = replace(robot, joints=(replace(robot.joints[0], position_limits=limits),))
    place = np.array([0.2, 0.0, 0.0])
    meshes = {"base": block((0.1, 0.1, 0.1), (0, 0, 0)), "bar": block((0.01, 0.01, 0.01), tuple(place))}
    poses = neighbour_poses(robot, meshes, 0, count=300)
    seen = np.array([pose[0].bounds.mean(axis=0)[:2] for pose in poses])
    angles = np.arctan2(seen[:, 1], seen[:, 0])
    turned = angles + 2.0 * np.pi * np.ceil((low - angles) / (2.0 * np.pi))
    assert turned.max() <= high + 1e-9
    # They fill the range.
    assert np.ptp(turned) > 0.95 * (high - low)
