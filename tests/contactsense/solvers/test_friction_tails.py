"""Regions of 90 % hold 90 % of the exact posterior where the friction ratio determines the place too."""

import numpy as np
import pytest
from scipy.optimize import minimize

from contactsense.solvers.posterior.contact_prior import STUDENT_DOF, Contact
from contactsense.solvers.posterior.friction_tails import curvature_along, with_friction_tails
from contactsense.solvers.posterior.region import REGION_90

FRICTION_RATIO = 0.25
TAIL = 0.5 * (STUDENT_DOF + 2.0)


def _covariances(
    curvature: np.ndarray, deviation: float, ratio: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Mode of a place that is measured with that deviation [m], where the force has the friction ratio
    `ratio`; Laplace's covariance, and that with tails."""
    scale = STUDENT_DOF * FRICTION_RATIO**2

    def energy(place: np.ndarray) -> float:
        inclined = ratio + curvature @ place
        return float(0.5 * place @ place / deviation**2 + TAIL * np.log1p(inclined @ inclined / scale))

    options = {"xatol": 1e-9, "fatol": 1e-12}
    mode = minimize(energy, np.zeros(2), method="Nelder-Mead", options=options).x
    a, b = ratio + curvature @ mode
    weight = 2.0 * TAIL / (STUDENT_DOF + (a * a + b * b) / FRICTION_RATIO**2)
    laplace = np.linalg.inv(np.eye(2) / deviation**2 + weight * curvature @ curvature / FRICTION_RATIO**2)
    contact = Contact((0.0, 0.0, 0.0), (1.0, 0.0, 0.0), (-1.0, float(a), float(b)), 0.0)
    v11, v12, v22 = with_friction_tails(
        (laplace[0, 0], laplace[0, 1], laplace[1, 1]),
        (curvature[0, 0], curvature[0, 1], curvature[1, 1]),
        contact,
        FRICTION_RATIO,
    )
    return mode, laplace, np.array([[v11, v12], [v12, v22]])


def _share(curvature: np.ndarray, deviation: float, ratio: np.ndarray) -> tuple[float, float]:
    """How much of the exact posterior, summed on a grid, is in the region of 90 % of either covariance."""
    mode, *covariances = _covariances(curvature, deviation, ratio)
    axis = np.linspace(-8.0 * deviation, 8.0 * deviation, 401)
    places = np.stack(np.meshgrid(axis, axis), axis=-1).reshape(-1, 2)
    inclined = ratio + places @ curvature
    energy = 0.5 * (places**2).sum(axis=1) / deviation**2
    energy += TAIL * np.log1p((inclined**2).sum(axis=1) / (STUDENT_DOF * FRICTION_RATIO**2))
    weight = np.exp(energy.min() - energy)
    shares = []
    for covariance in covariances:
        offset = places - mode
        inside = np.einsum("ni,ij,nj->n", offset, np.linalg.inv(covariance), offset) < REGION_90
        shares.append(float(weight[inside].sum() / weight.sum()))
    return shares[0], shares[1]


@pytest.mark.parametrize("ratio", [(0.0, 0.0), (0.3, 0.0), (0.2, 0.3)])
@pytest.mark.parametrize("deviation", [0.002, 0.005, 0.01, 0.02, 0.04])
@pytest.mark.parametrize(
    "curvature", [np.diag([20.0, 0.0]), np.diag([20.0, 20.0]), [[20.0, 5.0], [5.0, 8.0]]]
)
def test_the_region_holds_its_share_on_round_surfaces(
    curvature: np.ndarray, deviation: float, ratio: tuple[float, float]
) -> None:
    laplace, found = _share(np.array(curvature), deviation, np.array(ratio))
    assert 0.88 < found < 0.91
    assert found > laplace - 0.01


def test_on_a_sphere_the_region_of_laplace_holds_too_little() -> None:
    laplace, found = _share(np.diag([20.0, 20.0]), 0.04, np.zeros(2))
    assert laplace < 0.74
    assert found > 0.88


def test_on_a_plane_nothing_changes() -> None:
    _, laplace, found = _covariances(np.zeros((2, 2)), 0.02, np.array([0.1, 0.2]))
    np.testing.assert_array_equal(found, laplace)


def test_it_does_not_depend_on_the_tangents() -> None:
    K, V = np.array([[20.0, 5.0], [5.0, 8.0]]), np.array([[4e-4, 1e-4], [1e-4, 2e-4]])
    contact = Contact((0.0, 0.0, 0.0), (0.0, 0.0, 1.0), (2.0, 3.0, -10.0), 0.0)
    c, s = np.cos(0.7), np.sin(0.7)
    T = np.array([[c, -s], [s, c]])
    found = []
    for Q in (np.eye(2), T):
        k, v = Q.T @ K @ Q, Q.T @ V @ Q
        v11, v12, v22 = with_friction_tails(
            (v[0, 0], v[0, 1], v[1, 1]), (k[0, 0], k[0, 1], k[1, 1]), contact, FRICTION_RATIO
        )
        found.append(Q @ np.array([[v11, v12], [v12, v22]]) @ Q.T)
    np.testing.assert_allclose(found[1], found[0], rtol=1e-9)


def test_curvature_is_that_in_the_tangent_plane() -> None:
    rng = np.random.default_rng(1)
    Q = np.linalg.qr(rng.standard_normal((3, 3)))[0]
    S = rng.standard_normal((3, 3))
    S += S.T
    upper = (S[0, 0], S[0, 1], S[0, 2], S[1, 1], S[1, 2], S[2, 2])
    k11, k12, k22 = curvature_along(upper, (tuple(Q[:, 1]), tuple(Q[:, 2])))
    np.testing.assert_allclose([[k11, k12], [k12, k22]], Q[:, 1:].T @ S @ Q[:, 1:], atol=1e-12)


@pytest.mark.parametrize("variances", [(0.0, 0.0, 0.0), (1e300, 0.0, 1e300), (1.0, 1.0, 1.0), (1e-300,) * 3])
def test_degenerate_covariances_stay_finite(variances: tuple[float, float, float]) -> None:
    contact = Contact((0.0, 0.0, 0.0), (0.0, 0.0, 1.0), (1.0, 0.0, -10.0), 0.0)
    assert np.isfinite(with_friction_tails(variances, (20.0, 0.0, 20.0), contact, FRICTION_RATIO)).all()
