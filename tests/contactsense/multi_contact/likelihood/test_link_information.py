"""The likelihood of a further contact near samples, a block at a time, against dense linear algebra."""

import numpy as np
import pytest
from scipy.stats import multivariate_normal

from contactsense.multi_contact.likelihood.link_information import (
    fill_link_information,
    fill_sample_blocks,
    likelihood_near_samples,
    log_gain,
)
from contactsense.multi_contact.likelihood.sample_likelihood import RATIO_FACTOR
from contactsense.multi_contact.memory.buffers import Measurement
from contactsense.multi_contact.memory.sample_layout import NORMAL_FORCE
from contactsense.multi_contact.memory.seed_samples import in_blocks
from contactsense.multi_contact.seeding.seed_list import SAME_SIDE_COSINE
from contactsense.multi_contact.seeding.seed_search import drop_seeds_at_candidates, find_seeds
from tests.contactsense.multi_contact.random_measurement import (
    ROWS,
    added_covariance,
    by_force,
    chosen_samples,
    model_of,
    random_measurement,
)

pytestmark = pytest.mark.slow  # its kernels compile for long

NORMAL, TANGENTIAL, MOMENT = 20.0, 8.0, 0.7
"""Standard deviations of the force [N] and of the moment [Nm]."""


def test_the_likelihood_is_that_of_dense_linear_algebra() -> None:
    buffers, covariance, y = random_measurement()
    seed_samples, seeding = buffers.seed_samples, buffers.seeding
    chosen = seed_samples.coarse
    fill_sample_blocks(seed_samples, seeding)
    base = fill_link_information(Measurement(buffers.rows, ROWS), seeding)
    alone = multivariate_normal(np.zeros(ROWS), covariance).logpdf(y)
    for b in range(0, len(chosen.link), 5):
        link = chosen.link[b]
        likelihood_near_samples(
            seeding.link_information[link], seeding.link_vector[link], (NORMAL, TANGENTIAL), MOMENT,
            seeding.block[b],
        )  # fmt: skip
        for j in range(chosen.filled[b]):
            i = chosen.sample[b, j]
            n = seeding.point_normal[i, 3:]
            S = covariance + added_covariance(buffers, i, NORMAL, TANGENTIAL, MOMENT)
            expected = multivariate_normal(np.zeros(ROWS), S).logpdf(y) - alone
            np.testing.assert_allclose(log_gain(seeding.block[b], j), expected, rtol=1e-8, atol=1e-8)
            push = -(NORMAL**2) * n @ by_force(buffers, i).T @ np.linalg.solve(S, y)
            np.testing.assert_allclose(seeding.block[b, NORMAL_FORCE + j], push, rtol=1e-7, atol=1e-7)
    log_volume = -0.5 * ROWS * np.log(2.0 * np.pi)
    np.testing.assert_allclose(base + log_volume, alone)


def test_the_evidence_of_a_pair_of_links_is_the_sum_over_pairs_of_samples() -> None:
    buffers, covariance, y = random_measurement()
    seed_samples, friction_ratio, force_scale = buffers.seed_samples, 0.25, 15.0
    find_seeds(model_of(buffers, friction_ratio, force_scale), 2, buffers.seeding)
    chosen = chosen_samples(buffers)
    link = seed_samples.link[list(chosen)]
    spread = seed_samples.spread[link]
    parts = [
        added_covariance(buffers, i, force_scale, RATIO_FACTOR * friction_ratio * force_scale, moment)
        for i, moment in zip(chosen, force_scale * spread, strict=True)
    ]
    log_area = 2.0 * np.log(spread)
    one, other = np.tril_indices(len(chosen), -1)
    L = np.linalg.cholesky(covariance + np.array(parts)[one] + np.array(parts)[other])
    z = np.linalg.solve(L, np.broadcast_to(y, (len(one), ROWS))[..., None])[..., 0]
    log_pair = -0.5 * (z**2).sum(axis=1) - np.log(np.diagonal(L, axis1=1, axis2=2)).sum(axis=1)
    log_pair += log_area[one] + log_area[other]
    for k in range(len(buffers.rows.seen)):
        for j in range(k + 1):
            on = (link[one] == k) & (link[other] == j)
            expected = np.logaddexp.reduce(log_pair[on]) if on.any() else -np.inf
            np.testing.assert_allclose(buffers.seeding.pair_evidence[k, j], expected, atol=1e-6)


def test_seeds_of_two_contacts_are_the_most_likely_pairs_that_push() -> None:
    buffers, covariance, y = random_measurement()
    seed_samples, seeding, friction_ratio, force_scale = buffers.seed_samples, buffers.seeding, 0.25, 15.0
    count = find_seeds(model_of(buffers, friction_ratio, force_scale), 2, seeding)
    parts, pushes_with = {}, {}
    chosen = np.unique(seed_samples.coarse.sample)
    for i in chosen:
        moment = force_scale * seed_samples.spread[seed_samples.link[i]]
        parts[i] = added_covariance(
            buffers, i, force_scale, RATIO_FACTOR * friction_ratio * force_scale, moment
        )
        pushes_with[i] = -seeding.point_normal[i, 3:] @ by_force(buffers, i).T
    score = {}
    for i in chosen:
        for k in chosen[chosen < i]:
            S = covariance + parts[i] + parts[k]
            x = np.linalg.solve(S, y)
            if min(pushes_with[i] @ x, pushes_with[k] @ x) > 0.0:
                score[(i, k)] = -0.5 * (y @ x + np.linalg.slogdet(S)[1])
    found = [(max(pair), min(pair)) for pair in seeding.seed[:count, :2].tolist()]
    np.testing.assert_allclose(seeding.seed_score[:count], [score[pair] for pair in found], rtol=1e-8)
    assert seeding.seed_score[0] == pytest.approx(max(score.values()))
    assert count == len(seeding.seed_score)


def test_no_seed_is_where_a_candidate_starts() -> None:
    buffers, _, _ = random_measurement()
    seed_samples, seeding, candidates = buffers.seed_samples, buffers.seeding, buffers.candidates
    count = find_seeds(model_of(buffers, 0.25, 15.0), 1, seeding)
    before = seeding.seed[:count, 0].copy()
    candidates.order[:2] = 4, 1
    candidates.primitive[4] = seed_samples.primitive[before[3]]
    candidates.normal[4] = seeding.point_normal[before[3], 3:]
    # On the same primitive, on the other side.
    candidates.primitive[1] = seed_samples.primitive[before[0]]
    candidates.normal[1] = -seeding.point_normal[before[0], 3:]
    left = drop_seeds_at_candidates(seed_samples.primitive, candidates, 2, seeding, count)
    kept = [i for i in before if i in seeding.seed[:left, 0]]
    assert seeding.seed[:left, 0].tolist() == kept
    assert before[3] not in kept
    for i in set(before) - set(kept):
        assert any(
            candidates.primitive[k] == seed_samples.primitive[i]
            and candidates.normal[k] @ seeding.point_normal[i, 3:] > SAME_SIDE_COSINE
            for k in (4, 1)
        )


def test_seeds_of_one_contact_are_the_most_likely_samples_that_push() -> None:
    buffers, covariance, y = random_measurement()
    seed_samples, seeding, friction_ratio, force_scale = buffers.seed_samples, buffers.seeding, 0.25, 15.0
    count = find_seeds(model_of(buffers, friction_ratio, force_scale), 1, seeding)
    score = {}
    for i in np.unique(seed_samples.coarse.sample):
        n = seeding.point_normal[i, 3:]
        S = covariance + added_covariance(
            buffers, i, force_scale, RATIO_FACTOR * friction_ratio * force_scale,
            force_scale * seed_samples.spread[seed_samples.link[i]],
        )  # fmt: skip
        if n @ by_force(buffers, i).T @ np.linalg.solve(S, y) < 0.0:
            score[i] = multivariate_normal(np.zeros(ROWS), S).logpdf(y) + 0.5 * ROWS * np.log(2.0 * np.pi)
    found, expected = seeding.seed[:count, 0], sorted(score.values(), reverse=True)
    np.testing.assert_allclose(seeding.seed_score[:count], [score[i] for i in found], rtol=1e-8)
    # Of samples on the same side of a primitive only the best is kept.
    assert seeding.seed_score[0] == pytest.approx(expected[0])
    assert count == len(seeding.seed_score)
    for i, value in score.items():
        if value > seeding.seed_score[count - 1] + 1e-9 and i not in found:
            near = seed_samples.primitive[found] == seed_samples.primitive[i]
            cosine = seeding.point_normal[found, 3:] @ seeding.point_normal[i, 3:]
            better = seeding.seed_score[:count] >= value
            assert (near & (cosine > SAME_SIDE_COSINE) & better).any()


def test_blocks_hold_each_sample_once_and_one_link_each() -> None:
    link = np.array([2, 0, 0, 2, 1, 0, 0, 0, 0, 0, 0, 0])
    found = in_blocks(range(len(link)), link)
    held = [(b, i) for b, count in enumerate(found.filled) for i in found.sample[b, :count]]
    assert sorted(i for _, i in held) == list(range(len(link)))
    assert all(link[i] == found.link[b] for b, i in held)
    assert (link[found.sample] == found.link[:, None]).all()
    assert (np.diff(found.link) >= 0).all()
