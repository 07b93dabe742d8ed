"""The first view of a page shows the arm and gravity, whatever the shape of the window."""

from pathlib import Path
from types import SimpleNamespace
from typing import cast

import numpy as np
import pytest
import viser

from contactsense import Scene
from contactsense.service.drawing.posture import usual_posture
from contactsense.service.scene.summary import link_places
from contactsense.service.viewer.camera import FIELD_OF_VIEW, USUAL_ASPECT, Cameras, first_view
from tests.service.seven_joints import seven_joints

ASPECTS = {"a phone": 0.5, "1280x800 beside the panel": 1.1, "1920x1080 beside the panel": 1.4, "wide": 3.0}
GRAVITY = np.array([[-0.5, -0.5, 0.3], [-0.5, -0.5, 0.1]])


def in_picture(scene: Scene, aspect: float, places: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Columns and rows of places (N, 3) [m], to the right and up; from -1 to 1 is the picture."""
    view = first_view(scene, GRAVITY, aspect)
    ahead = view.look_at - view.position
    ahead /= np.linalg.norm(ahead)
    right = np.cross(ahead, [0.0, 0.0, 1.0])
    right /= np.linalg.norm(right)
    seen = places - view.position
    assert (seen @ ahead > 0.0).all()
    scale = np.tan(0.5 * FIELD_OF_VIEW) * (seen @ ahead)
    return seen @ right / (aspect * scale), seen @ np.cross(right, ahead) / scale


def turned(scene: Scene) -> np.ndarray:
    """Places of all links as the arm turns about its first joint, in the world [m]."""
    places = []
    for pan in np.linspace(0.0, 6.0, 13):
        q = usual_posture(scene.robot)
        q[0] = pan
        places.append(link_places(scene, q)[:, :3, 3])
    return scene.orientation.apply(np.concatenate(places))


@pytest.mark.parametrize("aspect", ASPECTS.values(), ids=ASPECTS)
@pytest.mark.parametrize("mounting", ["table", "wall", "ceiling"])
@pytest.mark.parametrize("robot", ["ur3e", "ur20"])
def test_arm_and_gravity_are_in_the_picture(aspect: float, mounting: str, robot: str) -> None:
    scene = Scene(robot=robot, mounting=mounting)
    columns, rows = in_picture(scene, aspect, np.concatenate((turned(scene), GRAVITY)))
    assert np.abs(columns).max() < 1.0
    assert np.abs(rows).max() < 1.0


@pytest.mark.parametrize("aspect", ASPECTS.values(), ids=ASPECTS)
def test_the_whole_reach_of_a_foreign_arm_is_in_the_picture(aspect: float, tmp_path: Path) -> None:
    """Its zeros are not those of UR's arms: the usual posture may be folded."""
    scene, rng = seven_joints(tmp_path), np.random.default_rng(0)
    limits = np.array([joint.range_within_turn for joint in scene.robot.joints])
    postures = limits[:, 0] + rng.random((200, 7)) * (limits[:, 1] - limits[:, 0])
    places = np.concatenate([link_places(scene, q)[:, :3, 3] for q in postures])
    above = places[places[:, 2] > 0.0]  # not through the table
    columns, rows = in_picture(scene, aspect, above)
    assert np.abs(columns).max() < 1.0
    assert rows.max() < 1.0


def test_on_a_phone_the_lower_half_is_left_to_the_panel() -> None:
    scene = Scene(robot="ur5e")
    _, rows = in_picture(scene, 0.5, turned(scene))
    assert rows.min() >= 0.0


def test_the_arm_is_not_smaller_than_it_must_be() -> None:
    scene = Scene(robot="ur5e")
    for aspect in ASPECTS.values():
        columns, rows = in_picture(scene, aspect, np.concatenate((turned(scene), GRAVITY)))
        upper = in_picture(scene, aspect, link_places(scene, np.array([0.0, -1.57, 0, 0, 0, 0]))[:, :3, 3])[1]
        assert max(np.abs(columns).max(), rows.max(), upper.max()) > 0.85


def open_page(aspect: float) -> tuple[SimpleNamespace, SimpleNamespace, Cameras]:
    """A page whose picture has this width over its height, its camera, and what aims it."""
    camera = SimpleNamespace(position=np.array([-5.0, 0.0, 0.0]), look_at=np.zeros(3), aspect=aspect)
    page = SimpleNamespace(
        initial_camera=SimpleNamespace(position=None, look_at=None, fov=None),
        get_clients=lambda: {0: SimpleNamespace(camera=camera)},
    )
    cameras = Cameras(cast(viser.ViserServer, page), Scene(robot="ur5e"), GRAVITY)
    cameras.update()
    return page, camera, cameras


def test_a_page_that_hears_late_of_its_first_camera_is_aimed_for_its_shape() -> None:
    """Its camera is at a place of its own first, and at that of all pages only when the panel has taken its
    part of the window."""
    page, page_camera, cameras = open_page(1.8)
    page_camera.position, page_camera.aspect = np.array(page.initial_camera.position), 1.0
    cameras.update()
    np.testing.assert_array_equal(page_camera.position, cameras.view(1.0).position)
    page_camera.position, page_camera.aspect = np.array([2.0, 0.0, 1.0]), 1.5  # moved by its reader
    cameras.update()
    np.testing.assert_array_equal(page_camera.position, [2.0, 0.0, 1.0])


def test_a_page_that_reports_an_earlier_place_is_aimed_again() -> None:
    """Its shape has not changed since."""
    page, page_camera, cameras = open_page(1.0)
    page_camera.position = np.array(page.initial_camera.position)
    cameras.update()
    np.testing.assert_array_equal(page_camera.position, cameras.view(1.0).position)


@pytest.mark.parametrize(
    "normal", [(0, 1, 0), (0.7, 0.7, 0.1), (-1, 0, -0.5), (0, 0, 1), (0, 0, -1), (0, -1, 0)]
)
def test_a_contact_that_is_looked_at_for_long_is_on_the_near_side(normal: tuple[float, ...]) -> None:
    page, page_camera, cameras = open_page(1.0)
    before = page_camera.position
    cameras.face(np.array(normal, dtype=float))
    cameras.update()
    ahead = page_camera.look_at - page_camera.position
    ahead /= np.linalg.norm(ahead)
    if normal != (0, 0, -1):  # no camera looks upwards
        cosine = -(ahead @ normal) / np.linalg.norm(normal)
        assert 0.2 <= cosine <= 0.9  # its arrow is not seen from the end, either
    # One that is seen already, as from above, turns nothing: a page that moves by itself confuses.
    assert np.array_equal(page_camera.position, before) == (normal in ((0, 0, 1), (0, -1, 0), (0, 0, -1)))
    assert np.allclose(page.initial_camera.position, cameras.view(USUAL_ASPECT).position)
    page_camera.position = np.array([2.0, 0.0, 1.0])  # moved by its reader
    cameras.face(-np.array(normal, dtype=float))
    cameras.update()
    np.testing.assert_array_equal(page_camera.position, [2.0, 0.0, 1.0])
