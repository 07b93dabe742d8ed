"""The camera of a page: so that the arm is in the picture, however wide that is, and a contact that is looked
at for long is on the near side, until a reader moves it."""

import itertools
from typing import NamedTuple

import numpy as np
import viser
from scipy.spatial.transform import Rotation

from contactsense.robots.library import in_library
from contactsense.scene import Scene
from contactsense.service.drawing.posture import usual_posture
from contactsense.service.scene.summary import link_places

FIELD_OF_VIEW = np.radians(75.0)
"""Of the page's camera, from top to bottom [rad]."""
AHEAD = np.array([-0.6, 0.68, -0.3])
"""Direction in which the camera looks at first, in a world whose z points up."""
SIDES = 8
"""Number of sides from which the arm may be seen."""
SEEN = (0.2, 0.85)
"""Cosines of the angle between the normal of a place and the direction to the camera: below them the place is
hidden, above them the arrow of its force is seen from its end."""
OBLIQUE = 0.5
"""The cosine that is best."""
MARGIN = 0.94
"""Part of the picture that is used."""
USUAL_ASPECT = 1.2
"""Width over height of the picture beside the panel in a usual window."""
STEPS = 7
"""Number of angles of each joint that are tried for the reach."""
PORTRAIT = 0.75
"""Width over height below which the lower half of the picture is left free: the panel is there on a phone."""


class View(NamedTuple):
    """A place of the camera."""

    position: np.ndarray
    """Shape (3,) [m]."""
    look_at: np.ndarray
    """The point around which a mouse turns the picture, shape (3,) [m]."""


def first_view(scene: Scene, landmarks: np.ndarray, aspect: float, ahead: np.ndarray = AHEAD) -> View:
    """The place from which the arm in its usual posture, turned about its first joint, fills the picture; no
    posture is cut off above or below. Of an arm that is not in the library, whose postures are not known, the
    whole reach fills it.

    Args:
        scene: The arm in its cell.
        landmarks: Further places that are in the picture, shape (N, 3), world frame [m].
        aspect: Width of the picture over its height.
        ahead: Direction in which the camera looks.
    """
    joints = len(scene.robot.joints)
    turned, stretched = [], []
    for pan in np.arange(0.0, 2.0 * np.pi, np.pi / 12.0):
        bent, straight, raised = usual_posture(scene.robot), np.zeros(joints), np.zeros(joints)
        bent[0] = straight[0] = raised[0] = pan
        raised[1:2] = -0.5 * np.pi
        turned.append(link_places(scene, bent)[:, :3, 3])
        stretched += [link_places(scene, q)[:, :3, 3] for q in (straight, raised)]
    if not in_library(scene.robot):
        stretched += _reach(scene)
        turned += stretched
    wide = np.concatenate((scene.orientation.apply(np.concatenate(turned)), landmarks))
    tall = np.concatenate((scene.orientation.apply(np.concatenate(stretched)), wide))
    return _enclosing(wide, tall, aspect, ahead / np.linalg.norm(ahead))


def facing(normal: np.ndarray, ahead: np.ndarray) -> np.ndarray:
    """The direction in which a camera looks to see a place with this outward normal: `ahead` if it does then;
    shapes (3,), world frame."""
    size = np.linalg.norm(AHEAD) * np.linalg.norm(normal)
    if SEEN[0] <= -(ahead @ normal) / size <= SEEN[1]:
        return ahead
    turns = Rotation.from_rotvec(np.outer(np.arange(SIDES) * 2.0 * np.pi / SIDES, [0.0, 0.0, 1.0]))
    sides = turns.apply(AHEAD)
    return np.asarray(sides[np.argmin(np.abs(-(sides @ normal) / size - OBLIQUE))])


def _reach(scene: Scene) -> list[np.ndarray]:
    """Places of the links in the highest and in the widest of many postures within the joints' limits, turned
    about the first joint, each of shape (L, 3), base frame [m]."""
    robot = scene.robot
    tried = [np.linspace(*joint.range_within_turn, STEPS) for joint in robot.joints[1:4]]
    found = []
    for angles in itertools.product(*tried):
        q = np.zeros(len(robot.joints))
        q[1 : 1 + len(angles)] = angles
        found.append(link_places(scene, q)[:, :3, 3])
    places = np.array(found)
    highest = places[places[:, :, 2].max(axis=1).argmax()]
    widest = places[np.linalg.norm(places[:, :, :2], axis=2).max(axis=1).argmax()]
    pans = Rotation.from_rotvec(np.outer(np.arange(0.0, 2.0 * np.pi, np.pi / 12.0), [0.0, 0.0, 1.0]))
    return [pan.apply(each) for pan in pans for each in (highest, widest)]


def _enclosing(wide: np.ndarray, tall: np.ndarray, aspect: float, ahead: np.ndarray) -> View:
    """The nearest camera that sees `wide` between the left and right edge, and `tall` between the upper and
    lower one, shapes (N, 3) [m], where it looks `ahead`, a unit vector.

    A place p is right of the left edge if r·(p - c) >= -t a·(p - c), with the camera's place c, its axes r to
    the right and a ahead, and the tangent t of half its field of view. The other edges are alike.
    """
    right = np.cross(ahead, [0.0, 0.0, 1.0])
    right /= np.linalg.norm(right)
    up = np.cross(right, ahead)
    upper = MARGIN * np.tan(0.5 * FIELD_OF_VIEW)
    lower, side = (0.0 if aspect < PORTRAIT else -upper), upper * aspect

    def least(places: np.ndarray, across: np.ndarray, low: float, high: float) -> tuple[float, float]:
        along, depth = places @ across, places @ ahead
        return float((along - high * depth).max()), float((along - low * depth).min())

    rightmost, leftmost = least(wide, right, -side, side)
    highest, lowest = least(tall, up, lower, upper)
    depth = min((leftmost - rightmost) / (2.0 * side), (lowest - highest) / (upper - lower))
    across = 0.5 * (rightmost + leftmost)
    height = 0.5 * (highest + lowest + (upper + lower) * depth)
    position = across * right + height * up + depth * ahead
    return View(position, position + (float(np.mean(wide @ ahead)) - depth) * ahead)


class Cameras:
    """Aims the camera of each page when it is opened, and again when the picture gets another shape, as when
    the window does."""

    def __init__(self, page: viser.ViserServer, scene: Scene, landmarks: np.ndarray) -> None:
        """Aim the cameras of pages to come; scene and landmarks as for `first_view`."""
        self._page, self._scene, self._landmarks = page, scene, landmarks
        self._ahead = AHEAD
        self._initial = self._aim_first()
        page.initial_camera.fov = FIELD_OF_VIEW
        self._aspects: dict[int, float] = {}
        """Shape of the picture of each page."""
        self._views: dict[int, View] = {}
        """The view of each page for that shape."""
        self._own: dict[int, list[np.ndarray]] = {}
        """Places at which the camera of each page was without its reader's doing."""

    def _aim_first(self) -> np.ndarray:
        """Aim the cameras of pages to come; returns their place."""
        initial = self.view(USUAL_ASPECT)
        camera = self._page.initial_camera
        camera.position, camera.look_at = map(tuple, initial)
        return initial.position

    def view(self, aspect: float) -> View:
        """The view of a page that nobody has moved, whose picture has this width over its height."""
        return first_view(self._scene, self._landmarks, aspect, self._ahead)

    def face(self, normal: np.ndarray) -> None:
        """Have the cameras see a place with this outward normal, world frame, shape (3,), after the next
        update."""
        ahead = facing(normal, self._ahead)
        if not np.array_equal(ahead, self._ahead):
            self._ahead = ahead
            self._initial = self._aim_first()
            self._views = {number: self.view(aspect) for number, aspect in self._aspects.items()}

    def update(self) -> None:
        """Aim those of which that is due."""
        clients = self._page.get_clients()
        for gone in self._aspects.keys() - clients.keys():
            del self._aspects[gone], self._views[gone], self._own[gone]
        for number, client in clients.items():
            camera = client.camera
            aspect = camera.aspect
            # A page may report its first place once more before it has heard of the one that it was given,
            # and a place of its own before it has heard of that of all pages. Then it is aimed again.
            own = self._own.setdefault(number, [camera.position, self._initial])
            if self._aspects.get(number) != aspect:
                self._aspects[number], self._views[number] = aspect, self.view(aspect)
            view = self._views[number]
            if np.allclose(camera.position, view.position, atol=1e-4):
                continue
            if any(np.allclose(camera.position, place, atol=1e-4) for place in own):
                camera.position, camera.look_at = view
                own.append(view.position)
