"""Skins with too few samples for a guess."""

from itertools import islice

import numpy as np
import pytest

from contactsense.robots.decomposition.decompose import Options, fit_body
from contactsense.robots.decomposition.initial_guess import FEWEST, additions
from contactsense.robots.decomposition.outer_skin import OutOfReachError, Skin, Surroundings
from tests.robots.shapes import block


def _balls(*places: float, count: int = FEWEST - 1) -> Skin:
    """Samples of balls of 10 mm at these places along x."""
    chance = np.random.default_rng(0)
    normals = chance.normal(size=(len(places), count, 3))
    normals /= np.linalg.norm(normals, axis=2, keepdims=True)
    points = 0.01 * normals + np.array(places)[:, None, None] * [1.0, 0.0, 0.0]
    number = len(places) * count
    return Skin(points.reshape(-1, 3), normals.reshape(-1, 3), np.ones(number), 0.0013 * len(places))


@pytest.mark.parametrize("skin", [_balls(0.0), _balls(0.0, 1.0), _balls(0.0, count=1)])
def test_guesses_end_where_no_place_has_enough_samples_around_it(skin: Skin) -> None:
    chance, misfit = np.random.default_rng(0), np.ones(len(skin.points))
    assert list(additions(skin.points, skin.normals, misfit, np.eye(3), 0.001, True, chance)) == []


def test_guesses_do_not_end_on_a_skin_of_enough_samples() -> None:
    skin, chance = _balls(0.0, count=500), np.random.default_rng(0)
    guesses = additions(skin.points, skin.normals, np.ones(500), np.eye(3), 0.001, True, chance)
    assert len(list(islice(guesses, 300))) == 300


@pytest.mark.parametrize(
    "skin", [_balls(0.0), pytest.param(_balls(0.0, 1.0), marks=pytest.mark.slow), _balls(0.0, count=1)]
)
def test_a_skin_of_too_few_samples_is_refused(skin: Skin) -> None:
    around, options = Surroundings(block((2.2, 0.02, 0.02), (0.0, 0.0, 0.0))), Options(samples=4000)
    with pytest.raises(OutOfReachError, match=rf"too small a part .*: {len(skin.points)} of 4000 samples"):
        fit_body(skin, around, np.eye(3), options)
