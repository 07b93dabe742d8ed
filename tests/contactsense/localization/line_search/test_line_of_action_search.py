"""The search along the line of action against one that leaves nothing out: a mode on each primitive, as far
as it is accessible."""

import math

import numpy as np
import pytest

from contactsense import JointTorqueSensor, Localizer, Scene, WrenchSensor
from contactsense.kinematics.wrench_information import to_body_frame
from contactsense.localization.candidates.accessibility import apply_accessibility, is_mounting_face
from contactsense.localization.candidates.candidate_buffers import store_candidate
from contactsense.localization.line_search.line_of_action_search import search_along_line_of_action
from contactsense.localization.surface.local_prior import surface_error_in_cell
from contactsense.localization.surface.placed_surface import PlacedSurface
from contactsense.localization.surface.primitive_frames import Frame
from contactsense.robots.vectors import vector
from contactsense.solvers.posterior.contact_prior import Contact, pushing_force
from contactsense.solvers.posterior.mode import ENERGY_CUTOFF
from contactsense.solvers.wrench import Wrench
from tests.contactsense.localization.latest_search import latest_search
from tests.contactsense.solvers.one_lane import enter_surface, posterior_mode
from tests.plain_arm import contacts, plain_ur5e

ARM = plain_ur5e()
TRUTH = contacts(ARM, 40, seed=4)


@pytest.fixture(scope="module")
def localizer() -> Localizer:
    return Localizer(
        Scene(
            robot=ARM,
            base_wrench=WrenchSensor(force_noise=0.1, moment_noise=0.02),
            joint_torque=JointTorqueSensor(noise=0.3),
        )
    )


def _search(localizer: Localizer, competing_evidence: float = -math.inf) -> int:
    problem, arrays = latest_search(localizer)
    found: int = search_along_line_of_action(problem, arrays, competing_evidence, 1000)
    return found


def _scores_of_all(localizer: Localizer) -> np.ndarray:
    """Score of the candidate on each primitive, minus infinity where it cannot be touched."""
    constants, state = localizer._buffers.constants, localizer._buffers.state
    surfaces, hypotheses, candidates = constants.surfaces, state.hypotheses, state.candidates
    surface = PlacedSurface(surfaces, constants.deviations, state.frames)
    prior = constants.prior
    scores = np.full(len(surfaces.kind), -np.inf)
    for p, (kind, size) in enumerate(zip(surfaces.kind, surfaces.size, strict=True)):
        link, w, L = surfaces.link[p], candidates.wrench[p], candidates.information[p]
        to_body_frame(
            hypotheses.wrench[link],
            hypotheses.information[link],
            state.frames.rotation[p],
            state.frames.origin[p],
            w,
            L,
        )
        _, point, normal = enter_surface(kind, size, Wrench((w[0], w[1], w[2]), (w[3], w[4], w[5])))
        start = Contact(point, normal, pushing_force(vector(w), normal), 0.0)
        mode = posterior_mode(kind, size, w, L, prior, start)
        if mode.log_evidence == -math.inf:
            continue
        frame = Frame(state.frames.rotation[p], state.frames.origin[p])
        error = surface_error_in_cell(prior, constants.deviations, -1)
        store_candidate(candidates, p, p, frame, mode, error)
        if is_mounting_face(link, candidates.point[p, 2], candidates.normal[p, 2], prior.surface_deviation):
            continue
        candidates.score[p] = mode.log_evidence - hypotheses.energy[link]
        apply_accessibility(surface, candidates, p, frame, prior, -math.inf)
        scores[p] = candidates.score[p]
    return scores


@pytest.mark.slow
def test_no_candidate_that_counts_is_left_out(localizer: Localizer) -> None:
    constants, state = localizer._buffers.constants, localizer._buffers.state
    for q, wrench, torque in zip(TRUTH.q, TRUTH.base_wrench, TRUTH.torque, strict=True):
        localizer.locate(q, base_wrench=wrench, joint_torque=torque)
        count = _search(localizer)
        found = np.full(len(constants.surfaces.kind), -np.inf)
        order = state.candidates.order[:count]
        found[order] = state.candidates.score[order]
        expected = _scores_of_all(localizer)
        best = expected.max()
        assert found.max() == pytest.approx(best, abs=0.05)
        # What a candidate weighs beside the best one.
        np.testing.assert_allclose(np.exp(found - best), np.exp(expected - best), atol=0.02)


@pytest.mark.slow
def test_each_primitive_is_searched_once_if_none_can_be_touched(localizer: Localizer) -> None:
    constants, state = localizer._buffers.constants, localizer._buffers.state
    for q, wrench, torque in zip(TRUTH.q, TRUTH.base_wrench, TRUTH.torque, strict=True):
        localizer.locate(q, base_wrench=wrench, joint_torque=torque)
        # A force that pulls wherever it pushed, with a moment that no line of action explains.
        state.hypotheses.wrench[:, :3] *= -1.0
        state.hypotheses.wrench[:, 3:] += 5.0
        count = _search(localizer)
        order = state.candidates.order[:count].tolist()
        assert len(set(order)) == count <= len(constants.surfaces.kind)


@pytest.mark.parametrize(("above", "fewer"), [(-20.0, False), (0.0, False), (40.0, True)])
def test_only_what_is_hopeless_beside_something_else_is_not_searched(
    localizer: Localizer, above: float, fewer: bool
) -> None:
    constants, state = localizer._buffers.constants, localizer._buffers.state
    searched = np.zeros(2, dtype=int)
    for q, wrench, torque in zip(TRUTH.q, TRUTH.base_wrench, TRUTH.torque, strict=True):
        localizer.locate(q, base_wrench=wrench, joint_torque=torque)
        scores = np.full((2, len(constants.surfaces.kind)), -np.inf)
        competing = -math.inf
        for k in range(2):
            count = _search(localizer, competing)
            order = state.candidates.order[:count]
            scores[k, order] = state.candidates.score[order]
            searched[k] += count
            competing = scores[0].max() + above
        alone, beside = np.exp(scores - competing)
        np.testing.assert_allclose(beside, alone, atol=np.exp(-ENERGY_CUTOFF))
    assert (searched[1] < searched[0]) == fewer
