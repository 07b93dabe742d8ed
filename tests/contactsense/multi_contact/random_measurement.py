"""A random measurement of random places, and dense linear algebra for it."""

from collections.abc import Sequence

import numpy as np

from contactsense import Scene
from contactsense.multi_contact.likelihood.sample_likelihood import SampleModel
from contactsense.multi_contact.memory.buffers import (
    Measurement,
    MultiContactBuffers,
    empty_multi_contact_buffers,
)
from contactsense.scene_model.constants import build_constants
from tests.plain_arm import plain_ur5e

ROWS = 12


def random_measurement(scale: float = 10.0) -> tuple[MultiContactBuffers, np.ndarray, np.ndarray]:
    """Random rows, places and normals of the samples; the covariance of the rows, and their values.

    `scale`: Standard deviation of the values.
    """
    buffers = empty_multi_contact_buffers(build_constants(Scene(robot=plain_ur5e())))
    rows, seeding = buffers.rows, buffers.seeding
    rng = np.random.default_rng(3)
    for link in range(len(rows.seen)):
        rows.seen[link] = np.arange(ROWS) < 6 + link
        rows.matrix[link] = rng.standard_normal((ROWS, 6)) * rows.seen[link][:, None]
    root = rng.standard_normal((ROWS, ROWS))
    covariance = np.eye(ROWS) + root @ root.T
    y = scale * rng.standard_normal(ROWS)
    seeding.innovation[:] = y
    seeding.prior_covariance[:], seeding.factor[:] = covariance, covariance
    count = len(buffers.seed_samples.link)
    seeding.point_normal[:, :3] = rng.standard_normal((count, 3))
    normal = rng.standard_normal((count, 3))
    seeding.point_normal[:, 3:] = normal / np.linalg.norm(normal, axis=1, keepdims=True)
    return buffers, covariance, y


def model_of(buffers: MultiContactBuffers, friction_ratio: float, force_scale: float) -> SampleModel:
    """The samples and rows of `random_measurement`."""
    return SampleModel(buffers.seed_samples, Measurement(buffers.rows, ROWS), friction_ratio, force_scale)


def _cross(c: np.ndarray) -> np.ndarray:
    return np.array([[0.0, -c[2], c[1]], [c[2], 0.0, -c[0]], [-c[1], c[0], 0.0]])


def by_force(buffers: MultiContactBuffers, i: int) -> np.ndarray:
    """Derivative of the rows by a force at sample i."""
    A, c = buffers.rows.matrix[buffers.seed_samples.link[i]], buffers.seeding.point_normal[i, :3]
    return np.asarray(A[:, :3] + A[:, 3:] @ _cross(c))


def wrench_prior(
    buffers: MultiContactBuffers, i: int, normal: float, tangential: float, moment: float
) -> np.ndarray:
    """Covariance of the wrench of a contact near sample i.

    Args:
        buffers: The places.
        i: The sample.
        normal, tangential, moment: Standard deviations of the force [N], and of each component of the
            additional moment [Nm].
    """
    c, n = buffers.seeding.point_normal[i].reshape(2, 3)
    Q = tangential**2 * np.eye(3) + (normal**2 - tangential**2) * np.outer(n, n)
    X = np.vstack((np.eye(3), _cross(c)))
    return np.asarray(X @ Q @ X.T + np.diag([0.0] * 3 + [moment**2] * 3))


def added_covariance(
    buffers: MultiContactBuffers, i: int, normal: float, tangential: float, moment: float
) -> np.ndarray:
    """Covariance of the rows due to a contact near sample i; arguments as for `wrench_prior`."""
    A = buffers.rows.matrix[buffers.seed_samples.link[i]]
    return np.asarray(A @ wrench_prior(buffers, i, normal, tangential, moment) @ A.T)


def chosen_samples(buffers: MultiContactBuffers) -> Sequence[int]:
    """The coarse samples, in the order of their blocks."""
    coarse = buffers.seed_samples.coarse
    return [
        int(i) for samples, filled in zip(coarse.sample, coarse.filled, strict=True) for i in samples[:filled]
    ]
