"""Which search is made: how accurately the line of action is known. Along one that is roughly known, the same
place is found as over the surface."""

import math

import numpy as np
import pytest

from contactsense import JointTorqueSensor, Localizer, Scene, WrenchSensor
from contactsense.localization.line_accuracy import (
    KNOWN,
    LINE_OF_ACTION_DEVIATION,
    ROUGH_LINE_DEVIATION,
    ROUGHLY_KNOWN,
    UNKNOWN,
    line_accuracy,
)
from contactsense.localization.line_search.line_of_action_search import search_along_line_of_action
from contactsense.localization.ranking import FEW_PRIMITIVES
from contactsense.localization.surface_search.search import search_surface
from contactsense.solvers.posterior.mode import ENERGY_CUTOFF
from tests.contactsense.localization.latest_search import latest_search
from tests.plain_arm import contacts, plain_ur5e

ARM = plain_ur5e()
TRUTH = contacts(ARM, 300, seed=8)


@pytest.fixture(scope="module")
def localizer() -> Localizer:
    """The positions of most lines of action have standard deviations of 5 to 25 mm."""
    return Localizer(
        Scene(
            robot=ARM,
            base_wrench=WrenchSensor(force_noise=0.32, moment_noise=0.08),
            joint_torque=JointTorqueSensor(noise=1.0),
        )
    )


def _locate(localizer: Localizer, i: int) -> int:
    """Locate a contact without noise; returns the link that explains it best."""
    localizer.locate(TRUTH.q[i], base_wrench=TRUTH.base_wrench[i], joint_torque=TRUTH.torque[i], detect=False)
    return int(np.argmin(latest_search(localizer)[0].hypotheses.energy))


def _accuracy(localizer: Localizer, link: int) -> int:
    problem, _ = latest_search(localizer)
    found: int = line_accuracy(
        problem.searched, problem.scene.depth, problem.motion, problem.hypotheses, link
    )
    return found


def _deviation(localizer: Localizer, link: int) -> float:
    """Standard deviation of the position of the line of action near the link's origin [m]."""
    problem, _ = latest_search(localizer)
    w, P = problem.hypotheses.wrench[link], problem.hypotheses.covariance[link]
    x, y, z = problem.motion.origin[problem.scene.depth[link]]
    across = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    to_origin = np.hstack((-across, np.eye(3)))
    return float(np.sqrt(np.trace(to_origin @ P @ to_origin.T)) / np.linalg.norm(w[:3]))


def test_a_line_of_action_is_known_near_the_best_link_and_roughly_near_all_that_explain_the_measurement(
    localizer: Localizer,
) -> None:
    seen = set()
    for i in range(len(TRUTH.q)):
        link = _locate(localizer, i)
        energy = latest_search(localizer)[0].hypotheses.energy
        explain = np.flatnonzero(energy <= energy[link] + ENERGY_CUTOFF)
        roughly = max(_deviation(localizer, k) for k in explain) < ROUGH_LINE_DEVIATION
        known = _deviation(localizer, link) < LINE_OF_ACTION_DEVIATION
        expected = KNOWN if known else ROUGHLY_KNOWN if roughly else UNKNOWN
        assert _accuracy(localizer, link) == expected
        seen.add(expected)
    assert seen == {KNOWN, ROUGHLY_KNOWN, UNKNOWN}


@pytest.mark.parametrize("factor", [0.0, math.nan])
def test_without_a_force_there_is_no_line_of_action(localizer: Localizer, factor: float) -> None:
    link = _locate(localizer, 0)
    latest_search(localizer)[0].hypotheses.wrench[:, :3] *= factor
    assert _accuracy(localizer, link) == UNKNOWN


@pytest.mark.slow
def test_along_a_line_that_is_roughly_known_the_same_place_is_found_as_over_the_surface(
    localizer: Localizer,
) -> None:
    compared = 0
    for i in range(len(TRUTH.q)):
        if _accuracy(localizer, _locate(localizer, i)) != ROUGHLY_KNOWN:
            continue
        problem, arrays = latest_search(localizer)
        candidates, link_of = arrays.candidates, problem.scene.surfaces.link
        count = search_along_line_of_action(problem, arrays, -math.inf, FEW_PRIMITIVES)
        if count < 0:
            continue
        rows = candidates.order[:count]
        best = rows[np.argmax(candidates.score[rows])]
        link, point = link_of[candidates.primitive[best]], candidates.point[best].copy()
        covariance = candidates.covariance[best].copy()
        rows = candidates.order[: search_surface(problem, arrays, -math.inf)]
        best = rows[np.argmax(candidates.score[rows])]
        assert link_of[candidates.primitive[best]] == link
        offset = candidates.point[best] - point
        assert offset @ np.linalg.solve(covariance, offset) < 0.1
        compared += 1
    assert compared >= 10


def test_nothing_is_searched_if_the_line_may_enter_too_many_primitives(localizer: Localizer) -> None:
    counts = set()
    for i in range(20):
        _locate(localizer, i)
        problem, arrays = latest_search(localizer)
        found = [
            search_along_line_of_action(problem, arrays, -math.inf, most)
            for most in range(len(problem.scene.surfaces.kind) + 1)
        ]
        # From some number on the search is made, and then it is the same one.
        made = [count >= 0 for count in found]
        assert made == sorted(made)
        assert len(set(found)) == 2
        assert found[0] == -1
        counts.add(sum(count < 0 for count in found))
    assert len(counts) > 3
