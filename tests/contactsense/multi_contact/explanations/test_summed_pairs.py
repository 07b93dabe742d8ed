"""Pairs of links without an optimum: against brute force over all pairs of samples, and what an estimate
states of them."""

from typing import NamedTuple

import numpy as np
import pytest
from scipy.special import logsumexp

from contactsense import Estimate, JointTorqueSensor, Localizer, Scene, WrenchSensor
from contactsense.benchmarks.multi_contact.trials import Trial, Trials
from contactsense.multi_contact.explanations.ranked_sets import rank_sets
from contactsense.multi_contact.explanations.summed_pairs import store_summed_pairs
from contactsense.multi_contact.likelihood.pair_places import (
    fill_place_covariance,
    fill_place_likelihood,
    find_likeliest_pair,
    sample_at,
)
from contactsense.multi_contact.likelihood.pair_wrench import fill_pair_wrench
from contactsense.multi_contact.likelihood.sample_likelihood import RATIO_FACTOR, SampleModel
from contactsense.multi_contact.memory.buffers import MAX_SUMMED_PAIRS, Explanations, MultiContactBuffers
from contactsense.multi_contact.memory.seed_samples import in_blocks
from contactsense.multi_contact.seeding.seed_search import find_seeds
from contactsense.robots.jit.flat_buffers import zeros
from contactsense.runtime.candidate_rows import MIN_REPORTED_PROBABILITY
from tests.contactsense.multi_contact.random_measurement import (
    added_covariance,
    by_force,
    chosen_samples,
    model_of,
    random_measurement,
    wrench_prior,
)
from tests.plain_arm import plain_ur5e

pytestmark = pytest.mark.slow  # its kernels compile for long

FRICTION_RATIO, FORCE_SCALE, SURFACE_DEVIATION = 0.25, 15.0, 0.002
TANGENTIAL = RATIO_FACTOR * FRICTION_RATIO * FORCE_SCALE
SMALL = 2.0
"""Standard deviation of values that many pairs of samples explain."""


class Pairs(NamedTuple):
    """All pairs of samples on two links, by dense linear algebra."""

    samples: list[tuple[int, int]]
    """The one on the farther link first."""
    weight: np.ndarray
    """Their likelihoods, with the sum one."""
    pushes: np.ndarray
    """Whether both most likely forces push."""


def _deviations(buffers: MultiContactBuffers, i: int) -> tuple[float, float, float]:
    """Standard deviations of a contact near sample i: along the normal, across it, and of the moment."""
    spread = buffers.seed_samples.spread[buffers.seed_samples.link[i]]
    return FORCE_SCALE, TANGENTIAL, FORCE_SCALE * float(spread)


def _all_pairs(
    buffers: MultiContactBuffers, covariance: np.ndarray, y: np.ndarray, own: int, link: int
) -> Pairs:
    chosen, of = chosen_samples(buffers), buffers.seed_samples.link
    samples = [
        (i, k)
        for a, i in enumerate(chosen)
        for k in (chosen[:a] if own == link else chosen)
        if of[i] == own and of[k] == link
    ]
    added = {i: added_covariance(buffers, i, *_deviations(buffers, i)) for i in chosen}
    log_weight, pushes = [], []
    for i, k in samples:
        S = covariance + added[i] + added[k]
        x = np.linalg.solve(S, y)
        log_weight.append(-0.5 * (y @ x + np.linalg.slogdet(S)[1]))
        forces = [-buffers.seeding.point_normal[e, 3:] @ by_force(buffers, e).T @ x for e in (i, k)]
        pushes.append(min(forces) > 0.0)
    weight = np.exp(np.array(log_weight) - logsumexp(log_weight))
    return Pairs(samples, weight, np.array(pushes))


def _found_places(
    buffers: MultiContactBuffers, own: int, link: int
) -> tuple[tuple[int, int], list[np.ndarray]]:
    """The likeliest pair of samples, and the covariances of both places."""
    seed_samples, seeding = buffers.seed_samples, buffers.seeding
    pair = find_likeliest_pair(seed_samples, own, link, seeding)
    fill_place_likelihood(seed_samples, own, link, pair, seeding)
    covariances = [np.zeros((3, 3)), np.zeros((3, 3))]
    likeliest = sample_at(seed_samples, pair[0]), sample_at(seed_samples, pair[1])
    for i, (of, sample) in enumerate(zip((own, link), likeliest, strict=True)):
        point = seeding.point_normal[sample]
        fill_place_covariance(seed_samples, of, i, point, SURFACE_DEVIATION, seeding, covariances[i])
    return likeliest, covariances


def _model(buffers: MultiContactBuffers) -> SampleModel:
    return model_of(buffers, FRICTION_RATIO, FORCE_SCALE)


def _seeded(scale: float) -> tuple[MultiContactBuffers, np.ndarray, np.ndarray]:
    """A random measurement after `find_seeds`."""
    buffers, covariance, y = random_measurement(scale)
    find_seeds(_model(buffers), 2, buffers.seeding)
    return buffers, covariance, y


@pytest.mark.parametrize(("own", "link"), [(4, 1), (5, 4), (2, 0), (3, 3)])
def test_places_are_those_of_all_pairs_of_samples(own: int, link: int) -> None:
    buffers, covariance, y = _seeded(SMALL)
    pairs = _all_pairs(buffers, covariance, y, own, link)
    assert 1.0 / (pairs.weight**2).sum() > 5.0  # several pairs count
    likeliest, covariances = _found_places(buffers, own, link)
    expected = pairs.samples[int(np.argmax(np.where(pairs.pushes, pairs.weight, 0.0)))]
    assert likeliest == expected
    point_normal, spread = buffers.seeding.point_normal, buffers.seed_samples.spread
    center = point_normal[list(likeliest), :3]
    sums = np.zeros((2, 3, 3))
    for weight, pair in zip(pairs.weight, pairs.samples, strict=True):
        places = point_normal[list(pair)]
        orders = [places, places[::-1]] if own == link else [places]
        nearest = min(orders, key=lambda order: float(((order[:, :3] - center) ** 2).sum()))
        for i, (place, of) in enumerate(zip(nearest, (own, link), strict=True)):
            d, n = place[:3] - center[i], place[3:]
            cell = spread[of] ** 2 * (np.eye(3) - np.outer(n, n)) + SURFACE_DEVIATION**2 * np.outer(n, n)
            sums[i] += weight * (np.outer(d, d) + cell)
    np.testing.assert_allclose(covariances, sums, rtol=1e-4, atol=1e-6)


def test_the_likeliest_pair_pushes() -> None:
    """Somewhere the likeliest pair of all pulls, so that another one is taken."""
    passed_over = 0
    buffers, covariance, y = _seeded(SMALL)
    for own in range(1, 7):
        pairs = _all_pairs(buffers, covariance, y, own, own - 1)
        likeliest, _ = _found_places(buffers, own, own - 1)
        assert pairs.pushes[pairs.samples.index(likeliest)]
        passed_over += not pairs.pushes[int(np.argmax(pairs.weight))]
    assert passed_over > 0


def test_no_pair_is_found_where_none_pushes() -> None:
    buffers, _, _ = _seeded(SMALL)
    likelihood = buffers.seeding.pair_likelihood
    likelihood[:] = -np.abs(likelihood)
    assert find_likeliest_pair(buffers.seed_samples, 4, 1, buffers.seeding) == (-1, -1)


@pytest.mark.parametrize(("own", "link"), [(4, 1), (3, 3)])
def test_the_order_of_the_samples_does_not_matter(own: int, link: int) -> None:
    answers = []
    for turned in (False, True):
        buffers, _, _ = random_measurement(SMALL)
        if turned:
            order = chosen_samples(buffers)[::-1]
            coarse = in_blocks(order, buffers.seed_samples.link)
            buffers = buffers._replace(seed_samples=buffers.seed_samples._replace(coarse=coarse))
        find_seeds(_model(buffers), 2, buffers.seeding)
        answers.append(_found_places(buffers, own, link))
    (one, covariances), (other, same) = answers
    # On one link, which contact comes first is a matter of the order.
    if own == link and one != other:
        other, same = other[::-1], same[::-1]
    assert one == other
    np.testing.assert_allclose(covariances, same, rtol=1e-6, atol=1e-9)


def test_the_wrench_is_the_conditional_normal_distribution() -> None:
    buffers, covariance, y = _seeded(10.0)
    explanations = buffers.explanations
    i, k = chosen_samples(buffers)[-1], chosen_samples(buffers)[40]
    fill_pair_wrench(_model(buffers), (i, k), buffers.seeding, explanations, 5)
    rows = np.hstack([buffers.rows.matrix[buffers.seed_samples.link[e]] for e in (i, k)])
    prior = np.zeros((12, 12))
    for a, e in enumerate((i, k)):
        prior[6 * a : 6 * a + 6, 6 * a : 6 * a + 6] = wrench_prior(buffers, e, *_deviations(buffers, e))
    S = covariance + rows @ prior @ rows.T
    gain = prior @ rows.T @ np.linalg.inv(S)
    wrenches, after = gain @ y, prior - gain @ rows @ prior
    total = np.hstack((np.eye(6), np.eye(6)))
    np.testing.assert_allclose(explanations.wrench[5], total @ wrenches, rtol=1e-8, atol=1e-8)
    np.testing.assert_allclose(explanations.force[5, :2], wrenches.reshape(2, 6)[:, :3], rtol=1e-8, atol=1e-8)
    np.testing.assert_allclose(
        explanations.wrench_covariance[5], total @ after @ total.T, rtol=1e-7, atol=1e-7
    )
    assert explanations.energy[5] == pytest.approx(0.5 * y @ np.linalg.solve(S, y))


def test_the_most_probable_pairs_take_their_evidence_along() -> None:
    buffers, _, _ = _seeded(SMALL)
    evidence, score = buffers.seeding.pair_evidence, buffers.explanations.score
    before, score[0] = evidence.copy(), evidence.max() - 1.0
    stored = store_summed_pairs(_model(buffers), SURFACE_DEVIATION, buffers.seeding, buffers.explanations, 1)
    total = logsumexp(np.append(before, score[0]))
    assert logsumexp(np.append(evidence, score[:stored])) == pytest.approx(total)
    shares = np.exp(score[1:stored] - total)
    assert (shares > MIN_REPORTED_PROBABILITY).all()
    assert (np.diff(shares) <= 0.0).all()
    assert stored == 1 + min(int((np.exp(before - total) > MIN_REPORTED_PROBABILITY).sum()), MAX_SUMMED_PAIRS)
    for t in range(1, stored):
        links = buffers.seed_samples.link[
            [int(np.flatnonzero((buffers.seeding.point_normal[:, :3] == c).all(axis=1))[0])
             for c in buffers.explanations.point[t, :2]]
        ]  # fmt: skip
        assert before[links[0], links[1]] == score[t]
        assert evidence[links[0], links[1]] == -np.inf


@pytest.fixture(scope="module")
def noisy() -> Localizer:
    return Localizer(
        Scene(
            robot=plain_ur5e(),
            base_wrench=WrenchSensor(force_noise=0.25, moment_noise=0.05),
            joint_torque=JointTorqueSensor(noise=1.0),
        )
    )


def _estimates(localizer: Localizer, count: int) -> list[tuple[Trial, Estimate, np.ndarray]]:
    """Answers to two contacts at once, and which of their explanations have no optimum."""
    trials, rng = Trials(localizer.scene, seed=21), np.random.default_rng(1)
    answers = []
    for _ in range(count):
        trial = trials.draw(2, 20.0, "different")
        base, torque = trial.measure(trial.pushes)
        base += rng.standard_normal(6) * np.repeat((0.25, 0.05), 3)
        torque += rng.standard_normal(len(torque))
        estimate = localizer.locate(trial.q, base_wrench=base, joint_torque=torque, contacts=2, detect=False)
        explanations = localizer._locator.explanations
        rows = explanations.order[: len(estimate.explanations)]
        answers.append((trial, estimate, explanations.log_evidence[rows] == -np.inf))
    return answers


def test_links_without_an_optimum_are_listed(noisy: Localizer) -> None:
    only_summed = 0
    for trial, estimate, summed in _estimates(noisy, 40):
        links = [tuple(sorted(c.link_index for c in e.contacts)) for e in estimate.explanations]
        of_sum = [pair for pair, is_summed in zip(links, summed, strict=True) if is_summed]
        # Each pair of links once, and none that has an optimum.
        assert len(of_sum) == len(set(of_sum))
        assert not set(of_sum) & {
            pair for pair, is_summed in zip(links, summed, strict=True) if not is_summed
        }
        only_summed += tuple(sorted(push.link for push in trial.pushes)) in of_sum
        for explanation in estimate.explanations:
            assert all(c.force_base @ c.normal_base < 0.0 for c in explanation.contacts)
            assert all(np.linalg.eigvalsh(c.covariance).min() > 0.0 for c in explanation.contacts)
    # A fifth of the true pairs have no optimum at this noise.
    assert only_summed >= 3


def test_the_answer_is_the_most_probable_set_with_an_optimum(noisy: Localizer) -> None:
    put_first = 0
    for _, estimate, summed in _estimates(noisy, 160):
        if not estimate.explanations:
            continue
        p = np.array([explanation.probability for explanation in estimate.explanations])
        assert p.sum() + estimate.other == pytest.approx(1.0)
        assert estimate.contacts == estimate.explanations[0].contacts
        assert (np.diff(p[1:]) <= 0.0).all()
        assert not summed[0]
        assert p[0] == p[~summed].max()
        put_first += p[0] < p.max()
    assert put_first > 0


def test_what_has_no_optimum_is_the_answer_if_nothing_else_is_listed() -> None:
    explanations, link = zeros(Explanations), np.arange(3, dtype=np.int64)
    explanations.contacts[:3] = 2
    explanations.primitive[:3, :2] = ((0, 1), (0, 2), (1, 2))
    explanations.log_evidence[:3] = -np.inf, -5.0, -np.inf
    explanations.score[:3] = 0.0, -5.0, 1.0
    ranked = rank_sets(link, explanations, 3, -np.inf, 2.0 * SURFACE_DEVIATION)
    # Its probability is less than what is reported.
    assert explanations.order[:ranked].tolist() == [2, 0, 1]
    explanations.score[1] = -2.0
    ranked = rank_sets(link, explanations, 3, -np.inf, 2.0 * SURFACE_DEVIATION)
    assert explanations.order[:ranked].tolist() == [1, 2, 0]
