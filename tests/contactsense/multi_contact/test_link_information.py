"""The likelihood of a further contact near samples, a block at a time, against dense linear algebra."""

import numpy as np
from scipy.stats import multivariate_normal

from contactsense import Scene
from contactsense.multi_contact.buffers import NORMAL_FORCE, empty_multi_contact_buffers
from contactsense.multi_contact.link_information import (
    fill_link_information,
    fill_sample_blocks,
    likelihood_near_samples,
    log_gain,
)
from contactsense.multi_contact.seed_samples import in_blocks
from contactsense.runtime.constants import build_constants
from tests.plain_arm import plain_ur5e

ROWS = 12
NORMAL, TANGENTIAL, MOMENT_SCALE = 20.0, 8.0, 20.0
"""Standard deviations of the force, and of the moment relative to the spread of a sample [N]."""


def _cross(c: np.ndarray) -> np.ndarray:
    return np.array([[0.0, -c[2], c[1]], [c[2], 0.0, -c[0]], [-c[1], c[0], 0.0]])


def test_the_likelihood_is_that_of_dense_linear_algebra() -> None:
    constants = build_constants(Scene(robot=plain_ur5e()))
    buffers = empty_multi_contact_buffers(constants)
    seed_samples, rows, seeding = buffers.seed_samples, buffers.rows, buffers.seeding
    rng = np.random.default_rng(3)
    for link in range(len(rows.seen)):
        seen = np.arange(ROWS) < 6 + link
        rows.matrix[link] = rng.standard_normal((ROWS, 6)) * seen[:, None]
    root = rng.standard_normal((ROWS, ROWS))
    covariance = np.eye(ROWS) + root @ root.T
    y = 10.0 * rng.standard_normal(ROWS)
    seeding.innovation[:], seeding.factor[:] = y, covariance
    seeding.point_normal[:, :3] = rng.standard_normal((len(seed_samples.link), 3))
    normal = rng.standard_normal((len(seed_samples.link), 3))
    seeding.point_normal[:, 3:] = normal / np.linalg.norm(normal, axis=1, keepdims=True)
    chosen = seed_samples.coarse
    fill_sample_blocks(seed_samples, MOMENT_SCALE, seeding)
    base = fill_link_information(rows, ROWS, seeding)
    alone = multivariate_normal(np.zeros(ROWS), covariance).logpdf(y)
    for b in range(0, len(chosen.link), 5):
        link = chosen.link[b]
        likelihood_near_samples(
            seeding.link_information[link], seeding.link_vector[link], (NORMAL, TANGENTIAL), seeding.block[b]
        )
        for j in range(chosen.filled[b]):
            i = chosen.sample[b, j]
            c, n = seeding.point_normal[i, :3], seeding.point_normal[i, 3:]
            A, moment = rows.matrix[link], MOMENT_SCALE * seed_samples.spread[i]
            by_force = A[:, :3] + A[:, 3:] @ _cross(c)
            Q = TANGENTIAL**2 * np.eye(3) + (NORMAL**2 - TANGENTIAL**2) * np.outer(n, n)
            S = covariance + by_force @ Q @ by_force.T + moment**2 * A[:, 3:] @ A[:, 3:].T
            expected = multivariate_normal(np.zeros(ROWS), S).logpdf(y) - alone
            np.testing.assert_allclose(log_gain(seeding.block[b], j), expected, rtol=1e-8, atol=1e-8)
            force = Q @ by_force.T @ np.linalg.solve(S, y)
            np.testing.assert_allclose(seeding.block[b, NORMAL_FORCE + j], -force @ n, rtol=1e-7, atol=1e-7)
    log_volume = -0.5 * ROWS * np.log(2.0 * np.pi)
    np.testing.assert_allclose(base + log_volume, alone)


def test_blocks_hold_each_sample_once_and_one_link_each() -> None:
    link = np.array([2, 0, 0, 2, 1, 0, 0, 0, 0, 0, 0, 0])
    found = in_blocks(range(len(link)), link)
    held = [(b, i) for b, count in enumerate(found.filled) for i in found.sample[b, :count]]
    assert sorted(i for _, i in held) == list(range(len(link)))
    assert all(link[i] == found.link[b] for b, i in held)
    assert (link[found.sample] == found.link[:, None]).all()
    assert (np.diff(found.link) >= 0).all()
