"""The nodes of the drawn arm, with a tool on a flange that is not the last link's frame."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from contactsense import Scene
from contactsense.robots.primitives import Sphere
from contactsense.robots.tool import Tool
from contactsense.service.scene.summary import link_places
from tests.plain_arm import plain_ur5e
from tests.service.viewer.estimates import POSTURE


def test_a_tool_is_drawn_at_the_flange() -> None:
    pytest.importorskip("viser")
    from contactsense.service.viewer.arm_nodes import ArmNodes
    from contactsense.service.viewer.viewer import serve_page

    turned = Rotation.from_euler("xyz", [0.0, 0.0, -0.785]).as_matrix()
    arm = replace(plain_ur5e(), flange_rotation=turned, flange_translation=np.array([0.0, 0.0, 0.107]))
    tool = Tool(mass=0.5, primitives=(Sphere(center=(0.0, 0.02, 0.05), radius=0.03),))
    scene = Scene(robot=arm, tool=tool)
    page = serve_page("127.0.0.1", 0)
    try:
        nodes = ArmNodes(page.scene, scene)
        nodes.move(POSTURE)
        np.testing.assert_array_equal(nodes.poses, link_places(scene, POSTURE))
        offset = np.linalg.inv(nodes.poses[-2]) @ nodes.poses[-1]
        np.testing.assert_allclose(offset[:3, 3], [0.0, 0.0, 0.107], atol=1e-12)
        np.testing.assert_allclose(offset[:3, :3], turned, atol=1e-12)
    finally:
        page.stop()
