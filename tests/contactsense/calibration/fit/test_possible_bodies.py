"""The estimated inertia of every link is that of a body."""

import numpy as np
import pytest

from contactsense.benchmarks.calibration.setup_draws import Settings, right_setup
from contactsense.calibration import FreeMotion, calibrate, default_groups
from contactsense.calibration import Settings as CalibrationSettings
from contactsense.calibration.calibration_model import CalibrationModel
from contactsense.calibration.fit.possible_bodies import _nearest, inertial_parameters, pseudo_inertia
from contactsense.calibration.residuals.equations import all_residuals
from contactsense.calibration.result import Calibration
from contactsense.kinematics.regressor import parameters_of
from contactsense.robots import Inertia
from contactsense.scene import Scene

UNIT = np.ones((1, 4))


def _points(rng: np.random.Generator, count: int) -> tuple[np.ndarray, np.ndarray]:
    """Masses and places of points."""
    return rng.uniform(0.1, 1.0, count), rng.normal(0.0, 0.3, (count, 3))


def test_the_pseudo_inertia_is_that_of_point_masses() -> None:
    """It is the sum of m (r, 1) (r, 1)'."""
    masses, places = _points(np.random.default_rng(1), 7)
    pieces = [Inertia(m, r, np.zeros((3, 3))) for m, r in zip(masses, places, strict=True)]
    parameters = sum(parameters_of(piece) for piece in pieces)
    corners = np.column_stack((places, np.ones(7)))
    found = pseudo_inertia(np.array([parameters]))[0]
    np.testing.assert_allclose(found, corners.T @ (masses[:, None] * corners), atol=1e-12)
    np.testing.assert_allclose(inertial_parameters(found), parameters, atol=1e-12)


def test_the_nearest_body_has_the_eigenvalues_that_are_not_negative() -> None:
    """In the Frobenius norm of the pseudo-inertia the projection is known: N. J. Higham (1988)."""
    rng = np.random.default_rng(2)
    vectors = np.linalg.qr(rng.standard_normal((4, 4)))[0]
    values = np.array([-0.5, -0.1, 0.7, 1.3])
    links = inertial_parameters(vectors @ np.diag(values) @ vectors.T)[None]
    entries = pseudo_inertia(np.eye(10)).reshape(10, 16)
    # So large that the barrier is negligible.
    found = _nearest(links, 1e4 * entries @ entries.T, UNIT)
    exact = vectors @ np.diag(np.maximum(values, 1e-4)) @ vectors.T
    np.testing.assert_allclose(pseudo_inertia(found)[0], exact, atol=1e-4)


@pytest.fixture(scope="module")
def calibrated() -> tuple[Scene, FreeMotion, Calibration]:
    """A motion that leaves the inertia of single links open."""
    case = right_setup("ur5e", 1, Settings(speed=0.5, seconds=20.0))
    groups = default_groups(case.scene, [case.recording])
    chosen = (*(group for group in groups if group not in ("gain", "payload")), "links")
    found = calibrate(case.scene, [case.recording], CalibrationSettings(chosen))  # type: ignore[arg-type]
    return case.scene, case.recording, found


@pytest.mark.slow
def test_every_estimated_link_is_a_body(calibrated: tuple[Scene, FreeMotion, Calibration]) -> None:
    """The best estimate without this constraint has links that are none."""
    _, _, found = calibrated
    assert found.constrained
    assert found.scene.inertia is not None
    for stated in found.scene.inertia.values():
        moments = np.linalg.eigvalsh(stated.inertia.tensor)
        assert stated.mass > 0.0
        assert moments[0] > 0.0
        assert moments[2] <= moments[0] + moments[1]


@pytest.mark.slow
def test_the_fit_is_hardly_worse(calibrated: tuple[Scene, FreeMotion, Calibration]) -> None:
    scene, recording, found = calibrated
    worse = found.after.rms / found.unconstrained.rms
    assert (worse - 1.0 < 0.01).all()
    # What is reported is what the written scene leaves.
    left = all_residuals(CalibrationModel.of(found.scene), recording, scene.bandwidth)
    rms = np.sqrt(np.mean(left[len(left) // 10 :] ** 2, axis=0))
    np.testing.assert_allclose(rms, found.after.rms, rtol=0.1)


@pytest.mark.slow
def test_a_tilt_within_its_uncertainty_is_not_estimated(
    calibrated: tuple[Scene, FreeMotion, Calibration],
) -> None:
    """The scene keeps its mounting, and everything else is estimated for that."""
    scene, _, found = calibrated
    assert found.scene.mounting == scene.mounting
    tilts = [value for value in found.values if value.entry.group == "tilt"]
    assert len(tilts) == 2
    assert all("not significant" in value.kept for value in tilts)
