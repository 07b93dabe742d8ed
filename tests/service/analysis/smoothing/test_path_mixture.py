"""Paths of a contact that slides: when it begins and ends, where it is then, also on a curved surface."""

import numpy as np
import pytest

from contactsense.robots.primitives import Capsule
from contactsense.robots.robot import Link
from contactsense.robots.surface.convex_primitives import Surfaces, pack
from contactsense.service.analysis.smoothing.contact_smoothing import distinct
from contactsense.service.analysis.smoothing.path_mixture import mixture, moving_paths
from contactsense.service.analysis.smoothing.place_search import LinkMeasurement, Place, PlaceSearch
from tests.service.analysis.smoothing.test_place_search import (
    BODY,
    NOISE,
    PRIOR,
    TOP,
    measured,
    surfaces,
)

SLOW_TO_FAST = 0.01, 0.03, 0.1
"""Standard deviations of the velocity of slides in each tangential direction [m/s]."""
RADIUS = 0.06
TUBE = pack([Link("tube", BODY, (Capsule(a=(0.0, 0.0, -0.2), b=(0.0, 0.0, 0.2), radius=RADIUS),))])


def smoothed(data: LinkMeasurement, start: np.ndarray, on: Surfaces | None = None) -> Place:
    """The mixture of a fixed place and of the paths that begin there."""
    bodies = surfaces() if on is None else on
    fixed = PlaceSearch(bodies, 0, PRIOR, data, data.t[:1]).run(start)
    assert fixed is not None
    paths = moving_paths(bodies, 0, PRIOR, data, fixed.knots, fixed.log_evidence)
    found = mixture([[fixed], *paths])
    assert found is not None
    return found


def dragged(rng: np.random.Generator, points: np.ndarray, direction: np.ndarray, noise: float) -> np.ndarray:
    """Wrenches of a push on the box's top that moves through `points`, one in each window, shape (W, 3), and
    drags it in `direction`; `noise`: in units of `NOISE`."""
    push = 8.0 + 6.0 * np.sin(np.linspace(0.2, 2.8, len(points)))
    force = push[:, None] * (0.35 * direction - np.array([0.0, 0.0, 1.0]))
    return np.hstack((force, np.cross(points, force))) + noise * NOISE * rng.standard_normal((len(points), 6))


@pytest.mark.slow
@pytest.mark.parametrize("noise", [1.0, 10.0])
def test_nine_of_ten_ends_of_holds_and_slides_lie_in_their_region(noise: float) -> None:
    """Half of the contacts hold. The others slide at a few to a few hundred millimetres a second."""
    rng, inside = np.random.default_rng(11), []
    for number in range(160):
        height = TOP + PRIOR.surface_deviation * rng.standard_normal()
        duration = rng.uniform(0.3, 1.5)
        angle, speed = (
            rng.uniform(0.0, 2.0 * np.pi),
            rng.choice(SLOW_TO_FAST) * np.linalg.norm(rng.standard_normal(2)),
        )
        direction = np.array([np.cos(angle), np.sin(angle), 0.0])
        way = min(speed * duration, 0.2) if number % 2 else 0.0
        begin = np.array([*rng.uniform(-0.02, 0.02, 2), height]) - 0.5 * way * direction
        points = begin + np.linspace(0.0, way, 16)[:, None] * direction
        data = measured(dragged(rng, points, direction, noise), duration, noise)
        place = smoothed(data, points[8])
        error = (place.point[-1] - points[-1])[:2]
        inside.append(error @ np.linalg.solve(place.covariance[-1][:2, :2], error) < 4.605)
    assert 0.83 < np.mean(inside) < 0.97


@pytest.mark.slow
@pytest.mark.parametrize(("begins", "ends"), [(0.0, 0.35), (0.6, 1.0), (0.3, 0.7)])
def test_a_slide_may_begin_and_end_within_the_contact(begins: float, ends: float) -> None:
    rng, direction = np.random.default_rng(4), np.array([0.8, 0.6, 0.0])
    t = (np.arange(24) + 0.5) / 24
    way = 0.04 * np.clip((t - begins) / (ends - begins), 0.0, 1.0)
    points = np.array([-0.02, 0.0, TOP]) + way[:, None] * direction
    data = measured(dragged(rng, points, direction, 1.0), 2.4)
    place = smoothed(data, points[12])
    even = PlaceSearch(surfaces(), 0, PRIOR, data, data.t[[0, -1]], 0.03).run(points[[0, -1]])
    assert even is not None
    error, with_even = (np.linalg.norm(one.point - points, axis=1).max() for one in (place, even))
    assert error < 0.3 * with_even
    for at in (0, -1):
        away = (place.point[at] - points[at])[:2]
        assert away @ np.linalg.solve(place.covariance[at][:2, :2], away) < 13.8  # 99.9 %


def test_an_even_slide_around_a_tube_stays_even() -> None:
    """Above an arc of 100 degrees, the middle of half a chord lies 6 mm beside that of half the arc."""
    angle = np.radians(np.linspace(-50.0, 50.0, 24))
    normals = np.column_stack((np.cos(angle), np.sin(angle), np.zeros(24)))
    tangents = np.column_stack((-np.sin(angle), np.cos(angle), np.zeros(24)))
    force = 12.0 * (0.3 * tangents - normals)
    data = measured(np.hstack((force, np.cross(RADIUS * normals, force))), 2.4)
    path = PlaceSearch(TUBE, 0, PRIOR, data, data.t[[0, -1]], 0.03).run(RADIUS * normals[[0, -1]])
    assert path is not None
    assert np.linalg.norm(path.point - RADIUS * normals, axis=1).max() < 6e-4  # a tenth of that


def test_two_searches_that_end_on_the_same_path_count_once() -> None:
    rng, direction = np.random.default_rng(6), np.array([1.0, 0.0, 0.0])
    points = np.array([-0.03, 0.0, TOP]) + np.linspace(0.0, 0.06, 24)[:, None] * direction
    data = measured(dragged(rng, points, direction, 1.0), 2.4)
    first, second = (smoothed(data, points[k]) for k in (4, 20))
    assert np.linalg.norm(first.point - second.point, axis=1).max() < 1e-3
    assert len(distinct([first, second])) == 1
