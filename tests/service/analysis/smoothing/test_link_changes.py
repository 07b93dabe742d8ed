"""One touched link or a change of links, against a sum over all sequences of links."""

from itertools import pairwise, product

import numpy as np
import pytest

from contactsense.service.analysis.smoothing.link_changes import log_odds_of_one_link

PRIOR = np.array([0.5, 0.3, 0.2])


def _by_enumeration(prior: np.ndarray, ratio: np.ndarray) -> float:
    """Sum over every moment of change, and over the links of every part."""
    stretches = len(ratio)
    chance = 1.0 - 0.5 ** (1.0 / (stretches - 1))
    same = other = 0.0
    for changes in product((False, True), repeat=stretches - 1):
        cuts = [0, *(i + 1 for i, change in enumerate(changes) if change), stretches]
        weight = np.prod([chance if change else 1.0 - chance for change in changes])
        weight *= np.prod([prior @ ratio[a:b].prod(axis=0) for a, b in pairwise(cuts)])
        if any(changes):
            other += weight
        else:
            same += weight
    return float(np.log(same / other))


def test_all_sequences_of_links_count() -> None:
    ratio = np.random.default_rng(1).gamma(0.3, size=(6, 3))
    assert log_odds_of_one_link(PRIOR, ratio) == pytest.approx(_by_enumeration(PRIOR, ratio), abs=1e-9)


def test_without_information_the_odds_are_even() -> None:
    assert log_odds_of_one_link(PRIOR, np.ones((9, 3))) == pytest.approx(0.0, abs=1e-12)


def test_a_single_stretch_has_one_link() -> None:
    assert log_odds_of_one_link(PRIOR, np.ones((1, 3))) == np.inf


def test_stretches_that_name_different_links_are_no_single_contact() -> None:
    first, second = np.array([1.9, 0.1, 0.1]), np.array([0.01, 3.0, 0.1])
    assert log_odds_of_one_link(PRIOR, np.array([first] * 6)) > 0.0
    assert log_odds_of_one_link(PRIOR, np.array([first] * 3 + [second] * 3)) < 0.0
    # Most stretches outvote a few in the product of their evidence, but these are not explained then.
    assert log_odds_of_one_link(PRIOR, np.array([first] * 9 + [second] * 3)) < 0.0


def test_a_link_that_cannot_be_touched_is_neither() -> None:
    prior, ratio = np.array([0.6, 0.4, 0.0]), np.ones((3, 3))
    assert np.isfinite(log_odds_of_one_link(prior, ratio))
