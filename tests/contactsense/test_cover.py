"""The share of a place's neighbourhood that can be touched, against many random places."""

import math

import numpy as np
import pytest

from contactsense import Scene
from contactsense.arm import Arm, build_arm
from contactsense.candidates import store
from contactsense.cover import clearance, cover_place, exposed
from contactsense.energy import empty_work, tangents
from contactsense.locate import place_primitives
from contactsense.memory import Memory, empty_memory
from kinematics.core import move
from robots.surface import project

TRIALS = 4000


@pytest.fixture(scope="module")
def placed() -> tuple[Arm, Memory]:
    arm = build_arm(Scene(robot="ur5e"))
    memory = empty_memory(arm)
    q = np.array([0.3, -1.2, 1.5, -1.9, -1.4, 0.5])
    move(arm.model, q, np.zeros(6), arm.gravity, memory.motion)
    place_primitives(arm.surfaces, arm.sensors.depth, memory.motion, memory.found)
    return arm, memory


def _brute(
    arm: Arm, memory: Memory, p: int, c: np.ndarray, n: np.ndarray, root: np.ndarray
) -> tuple[float, np.ndarray]:
    """Share of random places about c that are exposed, and their mean from it."""
    R, o = memory.found.rotation[p], memory.found.origin[p]
    t = np.array(tangents(*n)).reshape(2, 3)
    total, mean = 0.0, np.zeros(3)
    for u in np.random.default_rng(1).standard_normal((TRIALS, 2)):
        local = R.T @ (c + (root @ u) @ t - o)
        _, *found = project(arm.surfaces.kind[p], arm.surfaces.size[p], *local)
        place = o + R @ np.array(found[:3])
        above = place + arm.prior.room * (R @ np.array(found[3:]))
        part = exposed(clearance(arm.surfaces, memory.found, p, *above, 0.0), arm.prior)
        total += part
        mean += part * (place - c)
    return total / TRIALS, mean / total


@pytest.mark.parametrize("which", range(0, 480, 24))
@pytest.mark.parametrize("root", [np.diag([0.002, 0.002]), np.array([[0.012, 0.0], [0.008, 0.003]])])
def test_share_and_mean_are_those_of_random_places(
    placed: tuple[Arm, Memory], which: int, root: np.ndarray
) -> None:
    arm, memory = placed
    p = int(np.searchsorted(arm.places.start, which, side="right")) - 1
    R, o = memory.found.rotation[p], memory.found.origin[p]
    body = arm.sensors.depth[arm.surfaces.link[p]]
    base = memory.motion.origin[body] + memory.motion.rotation[body] @ arm.places.point[which]
    _, *found = project(arm.surfaces.kind[p], arm.surfaces.size[p], *(R.T @ (base - o)))
    normal = R @ np.array(found[3:])
    V = root @ root.T
    work = empty_work()
    work.frame[:, 0] = found[3:]
    work.frame[:, 1:] = R.T @ np.array(tangents(*normal)).reshape(2, 3).T
    result = (0.0, 0.0, *found, *(-10.0 * np.array(found[3:])), 0.0, V[0, 0], V[0, 1], V[1, 1])
    store(memory.found, 0, p, result, work, arm.prior.offset)
    memory.found.score[0] = 0.0
    start = memory.found.point[0].copy()
    share, mean = _brute(arm, memory, p, start, normal, root)
    cover_place(arm.surfaces, memory.found, 0, arm.prior, -math.inf)
    lowered = memory.found.score[0]
    # Eighteen points stand for the neighbourhood.
    assert math.exp(memory.found.score[0]) == pytest.approx(share, abs=0.12)
    if share > 0.2:
        assert np.linalg.norm(memory.found.point[0] - start - mean) < 0.4 * math.sqrt(np.trace(V))
    store(memory.found, 0, p, result, work, arm.prior.offset)
    memory.found.score[0] = 0.0
    cover_place(arm.surfaces, memory.found, 0, arm.prior, -8.0)
    # Given up early are only those that would have come out below.
    assert memory.found.score[0] == lowered or lowered < -8.0
