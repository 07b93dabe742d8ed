"""Meshes that are too large for their links: arms of the library as they are, and with one mesh scaled."""

import numpy as np
import pytest
import trimesh

from contactsense import robots
from contactsense.robots.decomposition.mesh_size import too_large
from contactsense.robots.decomposition.mesh_sources import meshes_of


@pytest.mark.parametrize("name", ["ur3e", "ur5e"])
def test_meshes_of_twice_the_size_are_found(name: str) -> None:
    robot = robots.load(name)
    meshes = meshes_of(robot)
    assert too_large(robot, meshes) == {}
    for link in ("upper_arm", "forearm"):
        scaled = {**meshes, link: meshes[link].copy().apply_scale(2.0)}
        beyond, apart = too_large(robot, scaled)[link]
        assert list(too_large(robot, scaled)) == [link]
        joint = robot.joints[robot.link_names.index(link)]
        assert apart == pytest.approx(np.linalg.norm(joint.translation))
        reach = (meshes[link].vertices @ joint.translation).max() / apart
        assert beyond == pytest.approx(2.0 * reach - apart)


def test_a_surface_that_extends_the_other_way_is_found() -> None:
    """Of a mesh that was turned round; and a base may be of any size."""
    robot = robots.load("ur5e")
    joint = robot.joints[robot.link_names.index("upper_arm")]
    rod = trimesh.creation.cylinder(0.05, segment=[np.zeros(3), -joint.translation])
    assert list(too_large(robot, {"upper_arm": rod, "base": rod, "wrist_3": rod})) == ["upper_arm"]
