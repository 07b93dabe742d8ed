"""A contact appears where the truth is: the simulated arm is pushed, and the browser's picture is read.

The truth is a point of the simulation, turned into the world, seen by the browser's camera.
"""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
import pytest

from contactsense import Localizer, Scene
from contactsense.scene import JointTorqueSensor, WrenchSensor
from contactsense.service.mock.arm.script import Script
from contactsense.service.mock.arm.simulated_arm import simulate
from contactsense.types import Estimate, Sample
from tests.browser import require_browser
from tests.service.viewer.shown import Shown, showing

pytestmark = pytest.mark.slow
NOISE = {"base_force": 0.05, "base_moment": 0.01, "joint_torque": 0.3}
SCENE = Scene(
    robot="ur5e", mounting=(0.4, -0.3, 0.5),
    base_wrench=WrenchSensor(force_noise=0.05, moment_noise=0.01),
    joint_torque=JointTorqueSensor(noise=0.3),
)  # fmt: skip
SCRIPT = {
    "robot": "ur5e",
    "noise": {**NOISE, "seed": 17},
    "gravity": SCENE.gravity_base.tolist(),
    "trajectory": {
        "start": [0.0, -1.3, 1.6, -1.9, -1.57, 0.0],
        "dwell": 3.5,
        "moves": [{"to": [0.3, -1.2, 1.4, -1.9, -1.4, 0.2], "duration": 4.0, "dwell": 0.5}],
    },
    "contacts": [
        {
            "link": "forearm", "point": [-0.1747, 0.0373, 0.0095], "normal": [-0.0008, 0.9931, 0.1174],
            "push": 25.0, "start": 2.0, "duration": 1.0,
        },
        {
            "link": "upper_arm", "point": [-0.2699, 0.0425, 0.1348], "normal": [0.0003, 0.9958, -0.0913],
            "push": 25.0, "start": 5.0, "duration": 1.0,
        },
    ],
}  # fmt: skip
NEAR = 4.0
"""Distance that may be between truth and picture [pixels], about 2 mm each."""
ARROW = 0.45
"""No arrow is longer [m]."""


@dataclass(frozen=True)
class Push:
    """A push in the middle of its duration, in the world."""

    q: np.ndarray
    estimate: Estimate
    point: np.ndarray
    force: np.ndarray


@pytest.fixture(scope="module")
def pushes() -> tuple[Push, ...]:
    motion = simulate(Script.model_validate(SCRIPT))
    localizer, to_world = Localizer(SCENE), SCENE.orientation
    middle = {(touch.first + touch.last) // 2: touch for touch in motion.touches}
    found = []
    for i in range(max(middle) + 1):
        q = motion.q[i]
        estimate = localizer.step(
            Sample(motion.t[i], q, motion.qd[i], motion.joint_torque[i], motion.base_wrench[i])
        )
        if i in middle:
            touch = middle[i]
            point, force = touch.point_base[i - touch.first], touch.force_base[i - touch.first]
            found.append(Push(q, estimate, to_world.apply(point), to_world.apply(force)))
    return tuple(found)


@pytest.fixture(scope="module")
def shown(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Shown]:
    require_browser()
    with showing(SCENE, tmp_path_factory.mktemp("profile")) as shown:
        yield shown


def facing(push: Push) -> np.ndarray:
    """A place for the camera on the side from which an arm is pushed [m]."""
    against = -push.force / np.linalg.norm(push.force)
    aslant = np.cross([0.0, 0.0, 1.0], against)
    toward = against + 1.5 * aslant / np.linalg.norm(aslant)
    return np.asarray(push.point + 0.9 * toward / np.linalg.norm(toward))


def new_contact_pixels(picture: np.ndarray, without: np.ndarray) -> np.ndarray:
    """Columns and rows, shape (K, 2), that are violet as contacts are, and were not without a contact."""
    red, green, blue = np.moveaxis(picture, -1, 0)
    changed = np.abs(picture - without).max(axis=-1) > 40
    rows, columns = np.nonzero(changed & (np.minimum(red + 100, blue) > green + 60))
    return np.stack((columns, rows), axis=1)


def from_segment(pixels: np.ndarray, begin: np.ndarray, end: np.ndarray) -> np.ndarray:
    """Distance of pixels (K, 2) from a line between two places (2,)."""
    along = end - begin
    share = np.clip((pixels - begin) @ along / (along @ along), 0.0, 1.0)
    return np.asarray(np.linalg.norm(pixels - begin - share[:, None] * along, axis=1))


@pytest.mark.parametrize("number", [0, 1])
def test_a_contact_appears_where_the_truth_is(shown: Shown, pushes: tuple[Push, ...], number: int) -> None:
    push, other = pushes[number], pushes[1 - number]
    shown.look(push.point, facing(push), aside=0.45)
    shown.q, shown.estimate = push.q, None
    shown.page.wait_for("No current estimate")
    without = shown.picture()
    shown.estimate = push.estimate
    shown.page.wait_for("is touched")
    found = new_contact_pixels(shown.picture(), without)

    truth = shown.pixel(push.point)
    assert 0.0 < truth[0] < without.shape[1]
    assert len(found) > 50
    assert np.linalg.norm(found - truth, axis=1).min() < NEAR
    # The arrow comes from where the push comes from, and ends there; nothing is drawn elsewhere.
    tail = shown.pixel(push.point - ARROW * push.force / np.linalg.norm(push.force))
    assert from_segment(found, truth, tail).max() < 3.0 * NEAR
    assert np.linalg.norm(found - shown.pixel(other.point), axis=1).min() > 5.0 * NEAR


def test_it_reports_no_error(shown: Shown) -> None:
    assert shown.page.errors() == []
