"""What it is worth to know a contact before the measurement."""

import numpy as np
import pytest

import robots
from contactsense import Scene
from contactsense.arm import Arm, build_arm
from contactsense.locate import place_primitives
from contactsense.memory import Memory, empty_memory
from contactsense.several.explain import take_known, weigh_known
from contactsense.several.memory import Bodies, Several, empty_several
from kinematics.core import place
from robots.primitives import Sphere
from tests.plain_arm import plain_ur5e

RADIUS = 0.09
CENTER = np.array([0.0, 0.0, 0.05])
NORMAL = np.array([0.0, 0.6, 0.8])


def _arm() -> tuple[Arm, Memory, Several]:
    """An arm whose base is a sphere, about which nothing moves."""
    plain = plain_ur5e()
    base = robots.Link(
        plain.links[0].name, plain.links[0].inertia, (Sphere(center=(0.0, 0.0, 0.05), radius=RADIUS),)
    )
    robot = robots.Robot(
        plain.name, (base, *plain.links[1:]), plain.joints, plain.flange_rotation, plain.flange_translation
    )
    arm = build_arm(Scene(robot=robot))
    memory = empty_memory(arm)
    place(arm.model, np.zeros(6), memory.motion)
    place_primitives(arm.surfaces, arm.sensors.depth, memory.motion, memory.found)
    return arm, memory, empty_several(arm)


def log_known(covariance: np.ndarray, force: np.ndarray, drift: float) -> float:
    """Log evidence of one contact on the sphere before any measurement, and the prior's area."""
    arm, memory, several = _arm()
    bodies = Bodies(memory.found.rotation, memory.found.origin)
    known = several.known
    known.primitive[0], known.drift[0] = 0, drift
    known.point[0], known.force[0] = CENTER + RADIUS * NORMAL, force
    known.covariance[0] = covariance
    take_known(arm.surfaces, bodies, known, several.stack, several.scan.normals[0], 10.0, 0)
    whole = weigh_known(arm.surfaces, arm.prior, bodies, several.rows, 1, several.stack)
    return float(whole) + float(np.log(arm.prior.area))


@pytest.mark.parametrize("sigma", [0.003, 0.006])
def test_a_known_place_is_its_share_of_the_area(sigma: float) -> None:
    """A place known to lie within a part of the surface was as probable beforehand as that part is large."""
    whole = log_known(sigma**2 * np.eye(3), -20.0 * NORMAL, np.inf)
    assert whole == pytest.approx(np.log(2.0 * np.pi * sigma**2), abs=0.02)


def test_a_known_force_is_its_share_of_those_that_are_usual() -> None:
    """Against a sum over forces of the prior's density times what is known."""
    prior = _arm()[0].prior
    across = np.cross(NORMAL, (1.0, 0.0, 0.0))
    force, drift = -25.0 * NORMAL + 2.0 * across, 0.5
    free, known = (log_known(1e-6 * np.eye(3), force, width) for width in (np.inf, drift))
    chance = np.random.default_rng(0)
    drawn = force + drift * chance.standard_normal((200_000, 3))
    push = -drawn @ NORMAL
    lean = ((drawn**2).sum(axis=1) - push**2) / (prior.lean * push) ** 2
    log_density = -0.5 * np.log(push / prior.force) ** 2 - 3.0 * np.log1p(lean / 4.0)
    log_density -= np.log(push**3 * prior.lean**2)
    expected = np.log(np.mean(np.exp(log_density))) + 3.0 * np.log(drift)
    assert known - free == pytest.approx(expected, abs=0.05)


def test_a_force_that_does_not_push_where_it_was_told_is_not_worth_more_for_it() -> None:
    """The place told of a broad explanation may have another normal than where the force pushes: the contact
    is then thought to be where it does, as far as it is open."""
    force, broad = 20.0 * np.cross(NORMAL, (1.0, 0.0, 0.0)) - 2.0 * NORMAL, 0.05**2 * np.eye(3)
    grazing, square = log_known(broad, force, 0.5), log_known(broad, -20.0 * NORMAL, 0.5)
    assert square - 8.0 < grazing < square
