"""The accessible share of a candidate's neighbourhood, against Monte Carlo samples."""

import math

import numpy as np
import pytest

from contactsense import Scene
from contactsense.localization.candidates.accessibility import (
    PENETRATION_SCALE,
    accessible_share,
    apply_accessibility,
    clearance,
)
from contactsense.localization.candidates.candidate_buffers import store_candidate
from contactsense.localization.candidates.simd_neighbourhood import accessible_moments
from contactsense.localization.surface.local_prior import SurfaceError
from contactsense.localization.surface.placed_surface import PlacedSurface
from contactsense.localization.surface.primitive_frames import Frame
from contactsense.robots.surface.convex_primitives import project
from contactsense.robots.vectors import tangents
from contactsense.runtime.state import State
from contactsense.scene_model.constants import Constants, build_constants
from contactsense.solvers.posterior.contact_prior import STUDENT_DOF, Contact
from contactsense.solvers.posterior.mode import Mode
from tests.contactsense.localization.placed_arm import placed

TRIALS = 4000


@pytest.fixture(scope="module")
def arm() -> tuple[Constants, State]:
    constants = build_constants(Scene(robot="ur5e"))
    return constants, placed(constants, np.array([0.3, -1.2, 1.5, -1.9, -1.4, 0.5]))[0]


def _surface(constants: Constants, state: State) -> PlacedSurface:
    return PlacedSurface(constants.surfaces, constants.deviations, state.frames)


def _clearance(constants: Constants, state: State, p: int, place: np.ndarray, normal: np.ndarray) -> float:
    """Clearance of a place on primitive p, 0 if it is positive."""
    height = constants.prior.clearance
    free: float = clearance(_surface(constants, state), p, tuple(place), tuple(normal), height, 0.0)
    return free


def _monte_carlo(
    constants: Constants, state: State, p: int, c: np.ndarray, n: np.ndarray, root: np.ndarray
) -> tuple[float, np.ndarray]:
    """Accessible share of random points about c, and the mean displacement of the accessible ones."""
    R, o = state.frames.rotation[p], state.frames.origin[p]
    t = np.array(tangents(tuple(n)))
    total, mean = 0.0, np.zeros(3)
    for u in np.random.default_rng(1).standard_normal((TRIALS, 2)):
        local = R.T @ (c + (root @ u) @ t - o)
        _, *projected = project(constants.surfaces.kind[p], constants.surfaces.size[p], *local)
        surface_point, normal = o + R @ np.array(projected[:3]), R @ np.array(projected[3:])
        share = accessible_share(_clearance(constants, state, p, surface_point, normal), constants.prior)
        total += share
        mean += share * (surface_point - c)
    return total / TRIALS, mean / total


def _candidate_at_sample(
    constants: Constants, state: State, sample: int, V: np.ndarray, error: SurfaceError
) -> tuple[int, Frame]:
    """Store a candidate at a sample of the surface in row 0; its primitive, and the frame of that.

    `V`: covariance of its place along the tangents [m^2].
    """
    p = int(np.searchsorted(constants.samples.start, sample, side="right")) - 1
    R, o = state.frames.rotation[p], state.frames.origin[p]
    body = constants.sensors.depth[constants.surfaces.link[p]]
    base = state.motion.origin[body] + state.motion.rotation[body] @ constants.samples.point[sample]
    _, *projected = project(constants.surfaces.kind[p], constants.surfaces.size[p], *(R.T @ (base - o)))
    force = tuple(-10.0 * component for component in projected[3:])
    contact = Contact(tuple(projected[:3]), tuple(projected[3:]), force, 0.0)
    t1, t2 = (tuple(R.T @ t) for t in np.array(tangents(tuple(R @ np.array(projected[3:])))))
    mode = Mode(0.0, 0.0, contact, (V[0, 0], V[0, 1], V[1, 1]), (t1, t2))
    frame = Frame(R, o)
    store_candidate(state.candidates, 0, p, frame, mode, error)
    state.candidates.score[0] = 0.0
    return p, frame


@pytest.mark.slow
@pytest.mark.parametrize("sample", range(0, 480, 24))
@pytest.mark.parametrize("root", [np.diag([0.002, 0.002]), np.array([[0.012, 0.0], [0.008, 0.003]])])
def test_share_and_mean_agree_with_monte_carlo(
    arm: tuple[Constants, State], sample: int, root: np.ndarray
) -> None:
    constants, state = arm
    candidates, V = state.candidates, root @ root.T
    error = SurfaceError(constants.prior.surface_deviation, 0.1, 1.0)
    p, frame = _candidate_at_sample(constants, state, sample, V, error)
    start, normal = candidates.point[0].copy(), candidates.normal[0].copy()
    share, mean = _monte_carlo(constants, state, p, start, normal, root)
    surface = _surface(constants, state)
    apply_accessibility(surface, candidates, 0, frame, constants.prior, -math.inf)
    full_score = candidates.score[0]
    # The quadrature has eighteen points.
    assert math.exp(full_score) == pytest.approx(share, abs=0.12)
    if share > 0.2:
        assert np.linalg.norm(candidates.point[0] - start - mean) < 0.4 * math.sqrt(np.trace(V))
    _candidate_at_sample(constants, state, sample, V, error)
    apply_accessibility(surface, candidates, 0, frame, constants.prior, -8.0)
    # Only candidates below the limit are rejected early.
    assert candidates.score[0] == full_score or full_score < -8.0


@pytest.mark.parametrize("pulls", [False, True])
def test_the_covariance_is_that_of_the_accessible_places_about_the_point(
    arm: tuple[Constants, State], pulls: bool
) -> None:
    """And along the normal that of the surface there, as where nothing covers it."""
    constants, state = arm
    candidates, offset, changed = state.candidates, 0.003, 0
    V = np.array([[1.44e-4, 9.6e-5], [9.6e-5, 7.3e-5]])
    for sample in range(0, 480, 5):
        _, frame = _candidate_at_sample(constants, state, sample, V, SurfaceError(offset, 0.1, 1.0))
        start, normal = candidates.point[0].copy(), candidates.normal[0].copy()
        before = candidates.covariance[0].copy()
        if pulls:
            # It pulls wherever the normal is another one.
            candidates.force[0] = 0.0
        apply_accessibility(_surface(constants, state), candidates, 0, frame, constants.prior, -math.inf)
        if np.array_equal(candidates.covariance[0], before):
            continue
        changed += 1
        share, mean, second = accessible_moments(
            tuple(start), constants.prior.surface_deviation / PENETRATION_SCALE, candidates.points
        )
        M = np.zeros((3, 3))
        M[np.triu_indices(3)] = second
        M = (M + np.triu(M, 1).T) / share
        d, m = candidates.point[0] - start, np.array(mean) / share
        assert np.array_equal(d, np.zeros(3)) == pulls
        expected = M - np.outer(m, d) - np.outer(d, m) + np.outer(d, d) + offset**2 * np.outer(normal, normal)
        np.testing.assert_allclose(candidates.covariance[0], expected, rtol=1e-9, atol=1e-12)
    assert changed > 10


def test_the_share_falls_as_the_tail_of_students_t() -> None:
    prior = build_constants(Scene(robot="ur5e")).prior
    for margin in (-1e-5, -1e-3, -0.1):
        penetration = PENETRATION_SCALE * margin / prior.surface_deviation
        expected = (1.0 + penetration**2 / STUDENT_DOF) ** (-0.5 * (STUDENT_DOF + 1.0))
        assert accessible_share(margin, prior) == pytest.approx(expected, rel=1e-12)
    assert accessible_share(0.0, prior) == accessible_share(0.1, prior) == 1.0
