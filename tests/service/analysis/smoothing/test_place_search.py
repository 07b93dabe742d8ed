"""The search for a contact's path: derivatives, honest covariances, evidence of holding and sliding."""

from dataclasses import replace

import numpy as np
import pytest

from contactsense.kinematics.model import empty_motion
from contactsense.localization.surface.local_prior import no_cells
from contactsense.robots.primitives import Box
from contactsense.robots.robot import Inertia, Link
from contactsense.robots.surface.convex_primitives import Surfaces, pack
from contactsense.service.analysis.smoothing.path_arrays import WindowSums
from contactsense.service.analysis.smoothing.place_accessibility import log_accessible_share
from contactsense.service.analysis.smoothing.place_search import LinkMeasurement, PlaceSearch
from contactsense.solvers.posterior.contact_prior import Prior

PRIOR = Prior(
    friction_ratio=0.25,
    torsion_lever=0.0025,
    surface_deviation=5e-4,
    force=20.0,
    clearance=0.02,
    area=1.0,
    log_link_density=np.zeros(2),
)
NOISE = np.array([0.05, 0.05, 0.05, 0.01, 0.01, 0.01])
BODY = Inertia(1.0, np.zeros(3), np.eye(3))
BOX = Box(center=(0.0, 0.0, 0.0), half=(0.2, 0.15, 0.05), rounding=0.01)
TILTED = Box(center=(0.0, 0.0, -0.3), half=(0.2, 0.15, 0.05), rounding=0.01, rpy=(0.0, 0.3, 0.0))
TOP = 0.05


def surfaces() -> Surfaces:
    return pack([Link("flat", BODY, (BOX,)), Link("tilted", BODY, (TILTED,))])


def measured(wrench: np.ndarray, duration: float = 1.0, noise: float = 1.0) -> LinkMeasurement:
    """Noisy wrenches of W windows, in the frame of both links; biases are known well. `noise`: in units of
    `NOISE`."""
    W = len(wrench)
    information = np.diag((noise * NOISE) ** -2.0)
    return LinkMeasurement(
        WindowSums(np.tile(information, (W, 1, 1)), wrench @ information, np.tile(information, (W, 1, 1))),
        W * information,
        information @ wrench.sum(axis=0),
        (0.01 * NOISE) ** 2,
        float(np.einsum("wi,ij,wj->", wrench, information, wrench)),
        wrench.size,
        duration * (np.arange(W) + 0.5) / W,
    )


def contact(rng: np.random.Generator, begin: np.ndarray, end: np.ndarray, windows: int = 16) -> np.ndarray:
    """Wrenches of a push on the box's top that slides from begin to end, with a force that varies."""
    share = np.linspace(0.0, 1.0, windows)[:, None]
    points = (1.0 - share) * begin + share * end
    push = 8.0 + 6.0 * np.sin(np.linspace(0.2, 2.8, windows))
    force = push[:, None] * np.array([0.2, -0.1, -1.0])
    moment = np.cross(points, force) + 0.001 * push[:, None] * np.array([0.0, 0.0, 1.0])
    return np.hstack((force, moment)) + NOISE * rng.standard_normal((windows, 6))


def path_search(data: LinkMeasurement, knots: int, link: int = 0, prior: Prior = PRIOR) -> PlaceSearch:
    """A search with knots at equal times."""
    times = np.linspace(data.t[0], data.t[-1], knots) if knots > 1 else data.t[:1]
    return PlaceSearch(surfaces(), link, prior, data, times, 0.03)


@pytest.mark.parametrize("knots", [1, 3])
def test_the_gradient_is_that_of_the_energy(knots: int) -> None:
    rng = np.random.default_rng(1)
    wrench = contact(rng, np.array([0.02, 0.01, TOP]), np.array([0.05, -0.02, TOP]))
    search = path_search(measured(wrench), knots)
    places = np.array([[0.02, 0.01, TOP], [0.03, 0.0, TOP], [0.06, -0.01, TOP]])[:knots]
    h, b = 2e-4 * rng.standard_normal(knots), 1e-4 * rng.standard_normal(6)
    scale = np.column_stack((np.full(16, 10.0), np.full(16, 1.2)))
    state = search._evaluate(places.copy(), h, b, scale, True)

    def energy(x: np.ndarray) -> float:
        change = x[: 3 * knots].reshape(knots, 3)
        moved = places + np.einsum("ki,kij->kj", change[:, :2], state.frames)
        return search._evaluate(moved, h + change[:, 2], b + x[3 * knots :], scale, False).energy

    steps = np.eye(3 * knots + 6) * 1e-6
    numeric = [(energy(step) - energy(-step)) / 2e-6 for step in steps]
    np.testing.assert_allclose(state.gradient, numeric, rtol=1e-5, atol=1e-3 * np.abs(state.gradient).max())


def test_nine_of_ten_places_lie_in_their_90_percent_region() -> None:
    rng, inside = np.random.default_rng(2), []
    for _ in range(200):
        # The real surface is off by as much as the prior says.
        height = TOP + PRIOR.surface_deviation * rng.standard_normal()
        begin = np.array([*rng.uniform(-0.08, 0.08, 2), height])
        place = path_search(measured(contact(rng, begin, begin)), 1).run(begin + np.array([0.01, -0.01, 0.0]))
        assert place is not None
        error = place.point[-1] - begin
        inside.append(error @ np.linalg.solve(place.covariance[-1], error) < 6.251)
    assert 0.84 < np.mean(inside) < 0.96


@pytest.mark.slow
def test_a_slide_is_told_from_a_hold_and_followed() -> None:
    rng = np.random.default_rng(3)
    begin, end = np.array([-0.03, 0.02, TOP]), np.array([0.02, -0.01, TOP])
    hold, slide = (measured(contact(rng, begin, last)) for last in (begin, end))

    def evidence(data: LinkMeasurement, knots: int) -> float:
        place = path_search(data, knots).run(begin)
        assert place is not None
        return place.log_evidence

    assert evidence(hold, 1) > evidence(hold, 2) > evidence(hold, 4)
    assert evidence(slide, 2) > evidence(slide, 1) + 10.0
    path = path_search(slide, 2).run(begin)
    assert path is not None
    assert path.sliding
    for at, truth in ((0, begin), (-1, end)):
        error = (path.point[at] - truth)[:2]
        assert np.linalg.norm(error) < 0.003
        assert error @ np.linalg.solve(path.covariance[at][:2, :2], error) < 13.8  # 99.9 %


def test_how_finely_a_constant_force_is_cut_is_no_evidence_for_a_link() -> None:
    """Without noise both links explain the force in any number of windows: their evidence differs by the
    priors alone."""
    begin, force = np.array([0.02, 0.01, TOP]), np.array([0.0, 0.0, -12.0])
    difference = []
    for windows in (8, 64):
        data = measured(np.tile(np.hstack((force, np.cross(begin, force))), (windows, 1)))
        # Short windows know the wrench less well.
        share = 64 / windows
        data = replace(
            data,
            sums=WindowSums(*(share * part for part in data.sums)),
            bias_information=share * data.bias_information,
            bias_value=share * data.bias_value,
            square=share * data.square,
        )
        places = [
            path_search(data, 1, link).run(start)
            for link, start in ((0, begin), (1, np.array([0.02, 0.01, -0.25])))
        ]
        assert places[0] is not None
        assert places[1] is not None
        difference.append(places[0].log_evidence - places[1].log_evidence)
    assert difference[0] == pytest.approx(difference[1], abs=0.05)


def test_a_place_that_another_link_covers_is_inaccessible() -> None:
    both = pack([Link("flat", BODY, (BOX,)), Link("upon it", BODY, (BOX,))])
    motion, covariance = empty_motion(1), 1e-6 * np.eye(3)
    motion.rotation[:] = np.eye(3)
    point = np.array([0.0, 0.0, TOP])

    def log_share(height: float) -> float:
        motion.origin[:, 2] = 0.5, 0.5 + height
        return log_accessible_share(
            both, no_cells(len(both.kind)), PRIOR, 0, point, covariance, np.arange(2), motion
        )

    assert log_share(0.3) == pytest.approx(0.0, abs=1e-6)
    assert log_share(0.11) < -10.0


def test_the_prior_over_links_adds_to_the_evidence_of_a_place() -> None:
    begin = np.array([0.01, 0.02, TOP])
    data = measured(contact(np.random.default_rng(5), begin, begin))
    found = [
        path_search(data, 1, prior=prior).run(begin)
        for prior in (PRIOR, PRIOR._replace(log_link_density=np.array([0.7, -2.0])))
    ]
    assert found[0] is not None
    assert found[1] is not None
    assert found[1].log_evidence == pytest.approx(found[0].log_evidence + 0.7, abs=1e-9)
    np.testing.assert_array_equal(found[1].point, found[0].point)
