"""The most probable force at a known place: limits, and the minimum of the energy found by SciPy."""

import math

import numpy as np
import pytest
from scipy.optimize import minimize

from contactsense.localization.surface.simd_layout import LENGTH
from contactsense.localization.surface_search.force_at_place import (
    FIXED_SPREAD,
    force_at_place,
    forces_at_places,
)
from contactsense.solvers.posterior.contact_prior import STUDENT_DOF, Prior

PRIOR = Prior(
    friction_ratio=0.25,
    torsion_lever=0.0025,
    surface_deviation=0.002,
    force=20.0,
    clearance=0.005,
    area=1.0,
    log_link_density=np.zeros(1),
)
PLACE, NORMAL = np.array([0.1, -0.05, 0.3]), np.array([0.48, 0.6, 0.64])
TANGENTS = np.linalg.svd(NORMAL[None])[2][1:]


def wrench_of(force: np.ndarray, torsion: float) -> np.ndarray:
    return np.concatenate((force, np.cross(PLACE, force) + torsion * NORMAL))


def found(
    wrench: np.ndarray, information: np.ndarray, spread: float = FIXED_SPREAD
) -> tuple[np.ndarray, float]:
    force, torsion = np.zeros((1, 3)), np.zeros(1)
    places = (PLACE[None].copy(), NORMAL[None].copy(), np.array([spread]))
    forces_at_places(wrench[None], information[None], PRIOR, places, np.zeros(LENGTH), force, torsion)
    return force[0], float(torsion[0])


def energy_of(unknowns: np.ndarray, wrench: np.ndarray, information: np.ndarray) -> float:
    """Written out independently; unknowns: log force over its median, two lean ratios, torsion ratio."""
    phi, a, b, chi = unknowns
    push = PRIOR.force * math.exp(phi)
    force = push * (-NORMAL + a * TANGENTS[0] + b * TANGENTS[1])
    off = wrench_of(force, push * chi) - wrench
    ratio = (a * a + b * b) / PRIOR.friction_ratio**2
    return float(
        0.5 * off @ information @ off
        + 0.5 * phi * phi
        + 0.5 * chi * chi / PRIOR.torsion_lever**2
        + 0.5 * (STUDENT_DOF + 2.0) * math.log1p(ratio / STUDENT_DOF)
    )


@pytest.mark.parametrize("push", [0.5, 8.0, 300.0])
def test_a_wrench_that_is_known_gives_its_force(push: float) -> None:
    force = push * (-NORMAL + 0.1 * TANGENTS[0] - 0.2 * TANGENTS[1])
    wrench = wrench_of(force, 0.002 * push)
    got, torsion = found(wrench, 1e6 / push**2 * np.diag([1.0, 1.0, 1.0, 1e4, 1e4, 1e4]))
    np.testing.assert_allclose(got, force, atol=5e-3 * push)
    assert torsion == pytest.approx(0.002 * push, abs=2e-4 * push)


def test_without_information_it_is_a_straight_push_of_the_median_force() -> None:
    got, torsion = found(np.zeros(6), np.zeros((6, 6)))
    np.testing.assert_allclose(got, -PRIOR.force * NORMAL, atol=1e-9)
    assert torsion == pytest.approx(0.0, abs=1e-12)


@pytest.mark.parametrize("joints", [1, 2, 3, 5])
def test_from_a_few_torques_it_is_the_minimum_of_the_energy(joints: int) -> None:
    rng = np.random.default_rng(joints)
    for _ in range(20):
        axes = rng.standard_normal((joints, 3))
        axes /= np.linalg.norm(axes, axis=1, keepdims=True)
        at = PLACE + rng.uniform(-0.4, 0.4, (joints, 3))
        screws = np.hstack((np.cross(at, axes), axes))
        push = float(np.exp(rng.uniform(np.log(5.0), np.log(80.0))))
        lean = 0.2 * rng.standard_normal(2)
        true = wrench_of(push * (-NORMAL + lean @ TANGENTS), 0.001 * push)
        torque = screws @ true + rng.standard_normal(joints)
        wrench, information = np.linalg.pinv(screws) @ torque, screws.T @ screws
        force, torsion = found(wrench, information)
        normal_force = -force @ NORMAL
        assert normal_force > 0.0
        here = np.array(
            [
                math.log(normal_force / PRIOR.force),
                *(TANGENTS @ force / normal_force),
                torsion / normal_force,
            ]
        )
        best = minimize(
            energy_of, here, (wrench, information), method="Nelder-Mead", options={"maxiter": 4000}
        )
        assert energy_of(here, wrench, information) < best.fun + 0.1


def test_a_force_that_seems_to_pull_pushes() -> None:
    """The measurement says that the force pulls; at this place it can only be small."""
    force, _ = found(wrench_of(30.0 * NORMAL, 0.0), 0.05 * np.eye(6))
    assert force @ NORMAL < 0.0
    assert np.linalg.norm(force) < 5.0


def test_a_known_deviation_of_the_force_is_where_the_search_begins() -> None:
    force = -8.0 * NORMAL
    wrench, information = wrench_of(force, 0.0), 1e4 * np.eye(6)
    args = (wrench, information, PRIOR, 0.02, tuple(PLACE), tuple(NORMAL), FIXED_SPREAD, np.zeros(LENGTH))
    np.testing.assert_allclose(force_at_place(*args)[0], force, atol=1e-2)


def test_a_place_that_is_uncertain_yields() -> None:
    """The line of action passes 5 cm beside the place: where that may be, the force is as measured."""
    push, aside = 20.0, 0.05 * TANGENTS[0]
    force = -push * NORMAL
    wrench = np.concatenate((force, np.cross(PLACE + aside, force)))
    information = np.diag([0.01, 0.01, 0.01, 1e4, 1e4, 1e4])
    yielding, _ = found(wrench, information, spread=0.5)
    np.testing.assert_allclose(yielding, force, atol=0.2)
    fixed, _ = found(wrench, information)
    assert np.linalg.norm(fixed - force) > 5.0
