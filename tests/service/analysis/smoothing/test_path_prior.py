"""What a tangential force tells of the motion of a contact: direction, moments, frames."""

import numpy as np
import pytest

from contactsense.service.analysis.smoothing.path_prior import drag_prior, undirected_prior
from contactsense.tracking.sliding import NORMAL_ERROR

NORMAL, ALONG, ACROSS = np.array([0.0, 0.0, 1.0]), np.array([0.6, 0.8, 0.0]), np.array([-0.8, 0.6, 0.0])
SIGMA = np.array([0.01, 0.004])
KNOT = np.array([0, 0, 0, 1, 1])


def forces(ratio: float) -> np.ndarray:
    """Pushes of different sizes with a tangential force of `ratio` times the normal one."""
    return np.array([4.0, 8.0, 10.0, 9.0, 3.0])[:, None] * (ratio * ALONG - NORMAL)


def test_without_a_tangential_force_the_direction_is_unknown() -> None:
    found = drag_prior(forces(0.0), np.tile(NORMAL, (5, 1)), KNOT, SIGMA)
    expected = undirected_prior(SIGMA)
    np.testing.assert_allclose(found.mean, 0.0, atol=1e-12)
    np.testing.assert_allclose(found.precision, expected.precision)
    assert found.log_scale == pytest.approx(expected.log_scale)


@pytest.mark.parametrize("ratio", [0.02, 0.2, 0.6])
def test_moments_are_those_of_a_velocity_whose_component_along_the_force_is_positive(ratio: float) -> None:
    """With the direction known, both components' variance belongs to the one along the force."""
    found = drag_prior(forces(ratio), np.tile(NORMAL, (5, 1)), KNOT, SIGMA)
    known = ratio**2 / (ratio**2 + NORMAL_ERROR**2)
    for k, sigma in enumerate(SIGMA):
        mean = sigma * np.sqrt(known) * np.sqrt(2.0) * np.sqrt(2.0 / np.pi)
        np.testing.assert_allclose(found.mean[k], mean * ALONG)
        covariance = np.linalg.inv(found.precision[k])
        assert ALONG @ covariance @ ALONG == pytest.approx((1.0 + known) * sigma**2 - mean**2)
        assert ACROSS @ covariance @ ACROSS == pytest.approx((1.0 - known) * sigma**2)
        # The mean square of the whole velocity does not depend on what is known of its direction.
        square = mean**2 + ALONG @ covariance @ ALONG + ACROSS @ covariance @ ACROSS
        assert square == pytest.approx(2.0 * sigma**2)


def test_the_size_of_the_force_does_not_matter_and_the_frame_turns_it() -> None:
    rng = np.random.default_rng(3)
    turn, _ = np.linalg.qr(rng.standard_normal((3, 3)))
    normals = np.tile(NORMAL, (5, 1))
    plain = drag_prior(forces(0.3), normals, KNOT, SIGMA)
    turned = drag_prior(7.0 * forces(0.3) @ turn.T, normals @ turn.T, KNOT, SIGMA)
    np.testing.assert_allclose(turned.mean, plain.mean @ turn.T, atol=1e-15)
    np.testing.assert_allclose(turned.precision, turn @ plain.precision @ turn.T, rtol=1e-9, atol=1e-3)
    assert turned.log_scale == pytest.approx(plain.log_scale)


def test_energy_and_derivatives_agree() -> None:
    rng = np.random.default_rng(4)
    prior = drag_prior(forces(0.3), np.tile(NORMAL, (5, 1)), KNOT, SIGMA)
    knots, frames = 0.01 * rng.standard_normal((3, 3)), np.tile(np.eye(3)[:2], (3, 1, 1))
    matrix, gradient = np.zeros((10, 10)), np.zeros(10)
    prior.add_derivatives(knots, frames, matrix, gradient)

    def energy(x: np.ndarray) -> float:
        return prior.energy(knots + np.einsum("ki,kij->kj", x[:9].reshape(3, 3)[:, :2], frames))

    # The energy is quadratic: central differences are exact, whatever the step.
    steps = 1e-3 * np.eye(10)
    slope = [(energy(step) - energy(-step)) / 2e-3 for step in steps]
    curvature = [
        [(energy(a + b) - energy(a) - energy(b) + energy(0.0 * a)) / 1e-6 for a in steps] for b in steps
    ]
    np.testing.assert_allclose(gradient, slope, rtol=1e-6, atol=1e-6)
    np.testing.assert_allclose(matrix, curvature, rtol=1e-6, atol=1e-3)
