"""The controls of the picture in a real browser: colours, meshes, mounting."""

from collections.abc import Iterator

import numpy as np
import numpy.typing as npt
import pytest
from scipy.spatial.transform import Rotation

from contactsense import Scene
from contactsense.robots.link_poses import link_poses
from contactsense.service.drawing.palette import HEAT, LINK_COLOURS, TOUCHED, between, rgb
from tests.browser import require_browser
from tests.service.loopback import until
from tests.service.viewer.estimates import POSTURE, contact, estimate
from tests.service.viewer.shown import Shown, showing

pytestmark = pytest.mark.long
MOUNTING = (0.0, 0.0, 0.3)
SCENE = Scene(robot="ur5e", mounting=MOUNTING)
LINKS = (2, 3)
"""Upper arm and forearm."""
MIDDLES = (np.array([-0.2, 0.0, 0.14]), np.array([-0.2, 0.0, 0.01]))
"""In the middle of these links, in their frames [m]; the camera sees the surface before them."""

SAME = 0.97
"""Cosine between hues from which on they are the same; that of the two links is 0.41."""


def place(link: int, point: np.ndarray, mounting: tuple[float, ...] = MOUNTING) -> np.ndarray:
    """A point of a link in the world [m]."""
    pose = link_poses(SCENE.robot, POSTURE)[link]
    return Rotation.from_euler("xyz", mounting).apply(pose[:3, :3] @ point + pose[:3, 3])


@pytest.fixture(scope="module")
def shown(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Shown]:
    require_browser()
    with showing(SCENE, tmp_path_factory.mktemp("profile")) as shown:
        shown.look(np.array([0.0, 0.0, 0.3]), np.array([0.6, -1.2, 0.8]), aside=0.6)
        yield shown


def seen(shown: Shown, mounting: tuple[float, ...] = MOUNTING) -> list[np.ndarray]:
    """Colours of upper arm and forearm in the picture."""
    picture = shown.picture()
    found = []
    for link, point in zip(LINKS, MIDDLES, strict=True):
        column, row = np.rint(shown.pixel(place(link, point, mounting))).astype(int)
        found.append(np.median(picture[row - 2 : row + 3, column - 2 : column + 3], axis=(0, 1)))
    return found


def hue(colour: npt.ArrayLike) -> np.ndarray:
    """A colour without its brightness and whiteness, which light changes, as a unit vector."""
    without_white = np.asarray(colour, dtype=float) - np.min(colour)
    return np.asarray(without_white / np.linalg.norm(without_white))


def show_links(shown: Shown, mounting: tuple[float, ...] = MOUNTING) -> None:
    """Check that both links are where they are, each in its colour."""
    for colour, link in zip(seen(shown, mounting), LINKS, strict=True):
        assert hue(colour) @ hue(rgb(LINK_COLOURS[link])) > SAME


def test_each_link_has_its_colour_as_mesh_and_as_primitives(shown: Shown) -> None:
    show_links(shown)
    meshes = shown.picture()
    shown.page.click("Meshes")
    assert until(lambda: (shown.picture() != meshes).any())
    show_links(shown)
    shown.page.click("Meshes")
    assert until(lambda: (shown.picture() == meshes).all())


def test_probability_colours_the_touched_link(shown: Shown) -> None:
    shown.page.choose("Colour", "probability")
    shown.estimate = estimate(SCENE, contact(SCENE, POSTURE, 3, np.array([-0.2, 0.05, 0.007])))
    shown.page.wait_for("Darker: more probably touched")
    shown.page.wait_for("forearm is touched")
    upper_arm, forearm = seen(shown)
    assert hue(forearm) @ hue(rgb(TOUCHED)) > SAME
    assert np.ptp(upper_arm) < 30.0  # grey
    assert forearm.sum() < upper_arm.sum()


def test_heat_is_brighter_where_smaller_pushes_are_detected(shown: Shown) -> None:
    """A push on the forearm has a longer lever than one on the upper arm."""
    shown.page.choose("Colour", "detectable force")
    shown.page.wait_for("Smallest push that one measurement detects: ")
    heat = between(HEAT, np.linspace(0.0, 1.0, 100))
    places = []
    for colour in seen(shown):
        likeness = [hue(stop) @ hue(colour) for stop in heat]
        assert max(likeness) > SAME
        places.append(int(np.argmax(likeness)))
    assert places[1] < places[0] - 10
    shown.page.choose("Colour", "link")
    assert until(lambda: "Smallest push" not in shown.page.text())
    show_links(shown)


def test_another_mounting_turns_the_arm_at_once_and_prints_its_lines(shown: Shown) -> None:
    before = shown.picture()
    shown.page.expand("Try another mounting")
    shown.page.enter("Base, deg", 0, "-30")
    shown.page.wait_for("mounting: [-0.5236, 0, 0.3]")
    show_links(shown, (np.radians(-30.0), 0.0, 0.3))
    assert (shown.picture() != before).any()
    shown.page.press("Back to the scene")
    assert until(lambda: "mounting: [" not in shown.page.text())
    assert until(lambda: (shown.picture() == before).all())


def test_they_report_no_error(shown: Shown) -> None:
    assert shown.page.errors() == []
