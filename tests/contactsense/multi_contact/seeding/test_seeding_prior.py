"""What is known of the rows beside known contacts, before a further one is searched."""

import math

import numpy as np
import pytest

from contactsense.multi_contact.joint.known_rows import Known
from contactsense.multi_contact.seeding.seeding_prior import initialize_seeding
from tests.contactsense.multi_contact.random_measurement import ROWS, model_of, random_measurement

pytestmark = pytest.mark.slow  # its kernels compile for long

FRICTION_RATIO = 0.35


def _prior_covariance(before: float, measured: float) -> np.ndarray:
    """Covariance of the rows beside one contact whose force is free.

    Args:
        before: The force that it had [N].
        measured: What the sensors measure of all forces [N].
    """
    buffers, _, _ = random_measurement()
    rng = np.random.default_rng(4)
    buffers.joint.contact[:] = rng.standard_normal(buffers.joint.contact.shape)
    buffers.known.covariance[0] = np.diag((4e-4, 1e-4, 1e-6))
    buffers.known.force[0] = (0.0, 0.6 * before, -0.8 * before)
    links = np.full(len(buffers.seed_samples.link), 3)
    initialize_seeding(links, model_of(buffers, FRICTION_RATIO, measured), buffers, Known(1, math.inf, True))
    return np.tril(buffers.seeding.prior_covariance[:ROWS, :ROWS])


def test_a_free_force_is_not_smaller_than_before() -> None:
    """Two forces that balance each other are hardly measured, but may be as large as before."""
    np.testing.assert_allclose(_prior_covariance(20.0, 1.0), _prior_covariance(20.0, 20.0), rtol=1e-12)


@pytest.mark.parametrize("before", [0.0, 1.0, 40.0])
def test_a_free_force_is_not_smaller_than_what_is_measured(before: float) -> None:
    np.testing.assert_allclose(_prior_covariance(before, 40.0), _prior_covariance(40.0, 40.0), rtol=1e-12)


def test_a_larger_force_leaves_more_open() -> None:
    noise = np.eye(ROWS)
    one, two = (_prior_covariance(force, 1.0) - noise for force in (20.0, 40.0))
    np.testing.assert_allclose(two, 4.0 * one, rtol=1e-9, atol=1e-9)
    assert np.trace(one) > 0.0
