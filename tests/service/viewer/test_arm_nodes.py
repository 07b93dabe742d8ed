"""The nodes of the drawn arm, with a tool on a flange that is not the last link's frame."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from contactsense import Scene
from contactsense.robots.primitives import Sphere
from contactsense.robots.surroundings import Body
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


def test_pedestals_are_drawn_with_the_base_link() -> None:
    pytest.importorskip("viser")
    from contactsense.service.viewer.arm_nodes import ArmNodes, link_node
    from contactsense.service.viewer.viewer import serve_page

    ball = Sphere(center=(0.0, 0.0, -0.5), radius=0.2)
    scene = Scene(robot="ur5e", bodies=(Body(name="ball", role="pedestal", primitives=(ball,)),))
    page = serve_page("127.0.0.1", 0)
    try:
        nodes = ArmNodes(page.scene, scene)
        skins = [skin[0] for skin in nodes._skins.values()]
        assert {skin.name for skin in skins} == {f"{link_node(0)}/mesh", f"{link_node(0)}/primitives"}
        for skin in skins:
            assert skin.vertices[:, 2].min() == pytest.approx(-0.7, abs=1e-3)
    finally:
        page.stop()


@pytest.mark.parametrize("mounting", ["wall", (1.5708, 0.0, 0.0)])
@pytest.mark.filterwarnings("error")
def test_an_arm_on_a_wall_is_in_the_picture(mounting: str | tuple[float, float, float]) -> None:
    pytest.importorskip("viser")
    from contactsense.service.viewer.viewer import Viewer, serve_page

    scene = Scene(robot="ur10e", mounting=mounting)
    page = serve_page("127.0.0.1", 0)
    try:
        Viewer(page, scene)
        camera = page.initial_camera
        ahead = camera.look_at - camera.position
        ahead /= np.linalg.norm(ahead)
        right = np.cross(ahead, [0.0, 0.0, 1.0])
        up = np.cross(right / np.linalg.norm(right), ahead)
        stretched = [
            [pan, lift, 0.0, 0.0, 0.0, 0.0] for pan in np.arange(0.0, 6.2, 0.7) for lift in (0.0, -1.57)
        ]
        places = np.array([link_places(scene, np.array(q))[:, :3, 3] for q in stretched])
        seen = scene.orientation.apply(places.reshape(-1, 3)) - camera.position
        assert np.abs(seen @ up / (seen @ ahead)).max() < np.tan(0.5 * camera.fov)
    finally:
        page.stop()
