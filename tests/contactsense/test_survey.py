"""The evidence of a cell is an integral over force, torsion and place; brute force does the same sum."""

import numpy as np
import pytest
from scipy.special import logsumexp

from contactsense.energy import TAIL, Prior, empty_work
from contactsense.survey import weigh

PRIOR = Prior(lean=0.25, lever=0.0025, offset=0.002, force=20.0, room=0.005, area=1.0)
PLACE = np.array([0.1, -0.05, 0.3])
NORMAL = np.array([0.48, 0.6, 0.64])
SPREAD = 0.01


def _drawn(chance: np.random.Generator, count: int) -> tuple[np.ndarray, np.ndarray]:
    """Wrenches of contacts drawn from the prior, and their places."""
    t1 = np.cross(NORMAL, [0.0, 0.0, 1.0])
    t1 /= np.linalg.norm(t1)
    t2 = np.cross(NORMAL, t1)
    size = PRIOR.force * np.exp(chance.standard_normal(count))
    tail = np.sqrt(chance.chisquare(TAIL, count) / TAIL)
    a, b = PRIOR.lean * chance.standard_normal((2, count)) / tail
    force = size[:, None] * (-NORMAL + a[:, None] * t1 + b[:, None] * t2)
    v = SPREAD * chance.standard_normal((2, count))
    point = PLACE + v[0][:, None] * t1 + v[1][:, None] * t2
    xi = size * PRIOR.lever * chance.standard_normal(count)
    return np.hstack((force, np.cross(point, force) + xi[:, None] * NORMAL)), point


def _weigh(w: np.ndarray, L: np.ndarray, known: bool = True) -> tuple[float, ...]:
    return tuple(weigh(w, L, PRIOR, *PLACE, *NORMAL, SPREAD, known, np.inf, empty_work()))


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
    assert place[3] == pytest.approx(SPREAD**2, rel=1e-6)


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
