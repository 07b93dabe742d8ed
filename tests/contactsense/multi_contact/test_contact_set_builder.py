"""The probability of a contact is that of all sets that contain it."""

import numpy as np
import pytest

from contactsense import Scene, WrenchSensor
from contactsense.multi_contact.contact_set_builder import ContactSetBuilder, ContactSets, _largest_deviation
from contactsense.multi_contact.explanations.marginal_probabilities import (
    SAME_POINT_DISTANCE,
    state_marginal_probabilities,
)
from contactsense.output.estimate_builder import EstimateBuilder
from contactsense.runtime.result_rows import COVARIANCE, LINK, POINT_BASE, PROBABILITY, WIDTH
from contactsense.runtime.state import empty_state
from contactsense.scene_model.constants import build_constants

pytestmark = pytest.mark.slow  # its kernels compile for long

COUNTS = np.array([1, 2, 3, 2, 2])
STATED = np.array([0.3, 0.25, 0.2, 0.15, 0.1])


def test_each_set_with_the_contact_counts_once() -> None:
    rng = np.random.default_rng(0)
    set_of = np.repeat(np.arange(len(COUNTS)), COUNTS)
    rows = np.zeros((COUNTS.sum(), WIDTH))
    rows[:, LINK] = rng.integers(0, 2, len(rows))
    rows[:, PROBABILITY] = STATED[set_of]
    # In a cube so small that about half of the pairs are one place.
    rows[:, POINT_BASE] = rng.uniform(0.0, 1.5 * SAME_POINT_DISTANCE, (len(rows), 3))
    expected = []
    for row in rows:
        near = np.linalg.norm(rows[:, POINT_BASE] - row[POINT_BASE], axis=1) < SAME_POINT_DISTANCE
        sets = set(set_of[near & (rows[:, LINK] == row[LINK])].tolist())
        expected.append(sum(STATED[k] for k in sets))
    touched = [{int(link) for link in rows[set_of == s, LINK]} for s in range(len(COUNTS))]
    assert len(set(np.round(expected, 9))) > 3
    assert any(len(links) < count for links, count in zip(touched, COUNTS, strict=True))
    probability, link_probability = np.empty(len(COUNTS)), np.zeros(3)
    state_marginal_probabilities(rows, COUNTS, probability, link_probability)
    np.testing.assert_allclose(rows[:, PROBABILITY], expected)
    np.testing.assert_array_equal(probability, STATED)
    links = [sum(p for p, own in zip(STATED, touched, strict=True) if link in own) for link in range(3)]
    np.testing.assert_allclose(link_probability, links)


@pytest.mark.parametrize(
    "deviations", [(0.02, 0.02, 0.02), (0.3, 1e-4, 1e-4), (0.05, 0.05, 0.001), (0, 0, 0)]
)
def test_the_largest_deviation_is_along_an_axis_of_the_ellipsoid(deviations: tuple[float, ...]) -> None:
    axes, _ = np.linalg.qr(np.random.default_rng(1).standard_normal((3, 3)))
    covariance = axes @ np.diag(np.square(deviations)) @ axes.T
    assert _largest_deviation(covariance) == pytest.approx(max(deviations), rel=1e-9)


def _builder(scene: Scene) -> ContactSetBuilder:
    constants = build_constants(scene)
    return ContactSetBuilder(scene, EstimateBuilder(scene, constants, empty_state(constants)))


@pytest.mark.parametrize(("reason", "status"), [("", "ambiguous"), ("base_wrench is missing", "degraded")])
def test_without_a_set_the_answer_is_none_of_these(reason: str, status: str) -> None:
    no_sets = ContactSets(np.zeros((0, WIDTH)), np.zeros(0, dtype=np.int64), np.zeros(6), np.zeros((6, 6)), 0)
    found = _builder(Scene(robot="ur5e")).sets(0.0, no_sets, 1, reason)
    assert (found.status, found.contacts, found.other) == (status, (), 1.0)
    assert found.reason.startswith(reason)


@pytest.mark.parametrize(
    ("sensor", "known_count", "expected"),
    [(WrenchSensor(), 1, [1.0]), (WrenchSensor(), 0, [0.6, 0.4]), (None, 1, [0.6, 0.4])],
)
def test_explanations_that_overlap_are_one_where_a_contact_is_known(
    sensor: WrenchSensor | None, known_count: int, expected: list[float]
) -> None:
    # Two at once have places that depend on each other; torques alone leave wide densities.
    builder = _builder(Scene(robot="ur5e", base_wrench=sensor))
    rows = np.zeros((4, WIDTH))
    rows[:, LINK], rows[:, PROBABILITY] = [2, 3, 2, 3], [0.6, 0.6, 0.4, 0.4]
    rows[:, COVARIANCE] = 1e-4 * np.eye(3).ravel()
    rows[3, POINT_BASE] = 0.01
    sets = ContactSets(rows, np.array([2, 2]), np.zeros(6), np.zeros((6, 6)), rank=8)
    found = builder.sets(0.0, sets, known_count)
    assert [explanation.probability for explanation in found.explanations] == pytest.approx(expected)
