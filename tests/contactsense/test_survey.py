"""The evidence of a cell is an integral over force, torsion and place; brute force does the same sum."""

import numpy as np
import pytest
from scipy.special import logsumexp

from contactsense.energy import TAIL, Prior
from contactsense.lanes import A00, A55, LANES, LENGTH, NX, SPREAD, T1X, T2X, VARIANCE, W0, W5, X
from contactsense.survey import evidence, weigh
from contactsense.view import view

PRIOR = Prior(lean=0.25, lever=0.0025, offset=0.002, force=20.0, room=0.005, area=1.0)
PLACE = np.array([0.1, -0.05, 0.3])
NORMAL = np.array([0.48, 0.6, 0.64])
WIDTH = 0.01


def _drawn(chance: np.random.Generator, count: int) -> tuple[np.ndarray, np.ndarray]:
    """Wrenches of contacts drawn from the prior, and their places."""
    t1 = np.cross(NORMAL, [0.0, 0.0, 1.0])
    t1 /= np.linalg.norm(t1)
    t2 = np.cross(NORMAL, t1)
    size = PRIOR.force * np.exp(chance.standard_normal(count))
    tail = np.sqrt(chance.chisquare(TAIL, count) / TAIL)
    a, b = PRIOR.lean * chance.standard_normal((2, count)) / tail
    force = size[:, None] * (-NORMAL + a[:, None] * t1 + b[:, None] * t2)
    v = WIDTH * chance.standard_normal((2, count))
    point = PLACE + v[0][:, None] * t1 + v[1][:, None] * t2
    xi = size * PRIOR.lever * chance.standard_normal(count)
    return np.hstack((force, np.cross(point, force) + xi[:, None] * NORMAL)), point


Cell = tuple[float, ...]
"""Place, normal and spread."""


def _fill(cells: list[Cell]) -> np.ndarray:
    lanes = np.zeros(LENGTH)
    for j, cell in enumerate(cells):
        lanes[[quantity + j for quantity in range(X, SPREAD + 1, LANES)]] = cell
    return lanes


def _read(lanes: np.ndarray, first: int, last: int, j: int) -> np.ndarray:
    """Quantities `first` to `last` of cell j."""
    return lanes[first + j : last + j + 1 : LANES]


def _weigh_block(w: np.ndarray, L: np.ndarray, cells: list[Cell], known: bool) -> list[tuple[float, ...]]:
    lanes = _fill(cells)
    weigh(len(cells), w, L, PRIOR, known, np.inf, lanes)
    found = [evidence(j, PRIOR, np.inf, lanes) for j in range(len(cells))]
    return [(*f[:5], lanes[VARIANCE + j], *f[5:]) for j, f in enumerate(found)]


def _weigh(w: np.ndarray, L: np.ndarray, known: bool = True) -> tuple[float, ...]:
    """Energy, log evidence, place (3), variance and force (3)."""
    return _weigh_block(w, L, [(*PLACE, *NORMAL, WIDTH)], known)[0]


@pytest.mark.parametrize("noise", [(3.0, 1.0), (6.0, 2.0)])
def test_the_evidence_is_that_of_a_sum_over_drawn_contacts(noise: tuple[float, float]) -> None:
    chance = np.random.default_rng(1)
    sigma = np.repeat(noise, 3)
    L = np.diag(sigma**-2.0)
    drawn, _ = _drawn(chance, 2_000_000)
    for truth in _drawn(chance, 6)[0]:
        w = truth + sigma * chance.standard_normal(6)
        brute = logsumexp(-0.5 * (((drawn - w) / sigma) ** 2).sum(axis=1)) - np.log(len(drawn))
        # Laplace's integral, with a heavy tail and forces that vary: within a factor of 1.6.
        assert _weigh(w, L)[1] == pytest.approx(brute, abs=0.5)


def test_a_measurement_that_says_nothing_leaves_the_prior() -> None:
    energy, log_z, *place = _weigh(np.zeros(6), 1e-14 * np.eye(6), known=False)
    assert energy == pytest.approx(0.0, abs=1e-9)
    assert log_z == pytest.approx(-np.log((TAIL + 2.0) / TAIL), abs=1e-6)  # the curvature of Student's peak
    np.testing.assert_allclose(place[:3], PLACE, atol=1e-9)
    assert place[3] == pytest.approx(WIDTH**2, rel=1e-6)


def test_the_start_does_not_matter() -> None:
    chance = np.random.default_rng(2)
    L = np.diag(np.repeat([1.0, 0.2], 3) ** -2.0)
    for w in _drawn(chance, 10)[0]:
        values = [_weigh(w, L, known)[1] for known in (False, True)]
        assert max(values) - min(values) < 0.2


@pytest.mark.parametrize(
    "w", [np.zeros(6), np.full(6, 1e12), np.full(6, 1e-300), np.array([0, 0, 0, 0, 0, 1e6])]
)
@pytest.mark.parametrize("scale", [1e-12, 1.0, 1e8])
def test_hard_cases_give_numbers(w: np.ndarray, scale: float) -> None:
    result = _weigh(w, scale * np.eye(6))
    assert not np.isnan(result).any()


def test_a_cell_is_weighed_alike_in_every_lane_and_company() -> None:
    chance = np.random.default_rng(4)
    root = chance.standard_normal((6, 6))
    L, w = root @ root.T, _drawn(chance, 1)[0][0]
    cells: list[Cell] = []
    for _ in range(LANES):
        normal = chance.standard_normal(3)
        place = 0.2 * chance.standard_normal(3)
        cells.append((*place, *(normal / np.linalg.norm(normal)), chance.uniform(0.005, 0.02)))
    together = _weigh_block(w, L, cells, known=True)
    for j, cell in enumerate(cells):
        np.testing.assert_allclose(_weigh_block(w, L, [cell], known=True)[0], together[j], rtol=1e-9)
    turned = _weigh_block(w, L, cells[::-1], known=True)
    np.testing.assert_allclose(turned[::-1], together, rtol=1e-9)


def test_the_wrench_is_seen_from_each_cell() -> None:
    chance = np.random.default_rng(5)
    root = chance.standard_normal((6, 6))
    L, w = root @ root.T, chance.standard_normal(6)
    cells = [(*(k * PLACE), *(sign * NORMAL), WIDTH) for k in (1.0, -2.0) for sign in (1.0, -1.0)]
    lanes = _fill(cells)
    weigh(len(cells), w, L, PRIOR, True, np.inf, lanes)
    for j in range(len(cells)):
        T = np.stack(
            [_read(lanes, NX, SPREAD - 1, j), _read(lanes, T1X, T2X - 1, j), _read(lanes, T2X, W0 - 1, j)]
        )
        np.testing.assert_allclose(T @ T.T, np.eye(3), atol=1e-12)
        seen, information = np.empty(6), np.empty((6, 6))
        view(w, L, T.T.copy(), _read(lanes, X, NX - 1, j).copy(), seen, information)
        np.testing.assert_allclose(_read(lanes, W0, W5, j), seen, atol=1e-12)
        upper = information[np.triu_indices(6)]
        np.testing.assert_allclose(_read(lanes, A00, A55, j), upper, rtol=1e-9, atol=1e-12)
