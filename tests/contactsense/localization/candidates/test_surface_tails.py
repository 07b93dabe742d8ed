"""Covariance of a place with the error of the surface, against the sum of its parts."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from contactsense.localization.candidates.surface_tails import with_surface_error
from contactsense.localization.surface.local_prior import LONG_TAILS, SurfaceError, surface_error_in_cell
from contactsense.robots.vectors import tangents
from contactsense.scene import Scene
from contactsense.scene_model.constants import build_constants
from contactsense.solvers.posterior.contact_prior import Contact
from contactsense.solvers.posterior.friction_tails import Variances

NORMAL = np.array([0.6, 0.0, 0.8])
T = np.array(tangents((0.6, 0.0, 0.8)))
FORCE = 20.0


def covariance(
    measured: np.ndarray, error: SurfaceError, ratio: tuple[float, float] = (0.0, 0.0), torsion: float = 0.0
) -> np.ndarray:
    """For a posterior of which `measured` is all but the surface's offset, shape (2, 2)."""
    force = FORCE * (-NORMAL + ratio[0] * T[0] + ratio[1] * T[1])
    offset = error.offset**2 * np.outer(ratio, ratio)
    v = measured + offset
    contact = Contact((0.0, 0.0, 0.0), tuple(NORMAL), tuple(force), torsion)
    found: Variances = with_surface_error((v[0, 0], v[0, 1], v[1, 1]), tuple(map(tuple, T)), contact, error)
    return np.array([[found[0], found[1]], [found[1], found[2]]])


def test_what_the_measurement_leaves_open_is_left_as_it_is() -> None:
    measured = np.array([[4e-6, 1e-6], [1e-6, 9e-6]])
    for error in (SurfaceError(0.0, 0.0, 1.1), SurfaceError(0.001, 0.1, 1.1)):
        np.testing.assert_allclose(covariance(measured, error), measured, rtol=1e-12)


@pytest.mark.parametrize("tails", [1.0, 1.1, 2.0])
def test_what_the_surface_leaves_open_has_its_root_mean_squares(tails: float) -> None:
    error, ratio, torsion = SurfaceError(tails * 0.001, tails * 0.1, tails), (0.3, -0.4), 0.05
    surface = 0.001**2 * np.outer(ratio, ratio) + (0.1 * torsion / FORCE) ** 2 * np.eye(2)
    np.testing.assert_allclose(covariance(np.zeros((2, 2)), error, ratio, torsion), surface, rtol=1e-9)


@given(
    st.floats(1e-4, 1e-2),
    st.floats(0.0, 0.005),
    st.floats(0.0, 0.6),
    st.floats(-0.5, 0.5),
    st.floats(0.0, 0.7),
    st.floats(0.0, 2.0 * np.pi),
)
def test_the_tails_never_widen_a_region_nor_take_more_than_the_surface_has(
    spread: float, offset: float, tilt: float, torsion: float, lean: float, angle: float
) -> None:
    ratio = (lean * np.cos(angle), lean * np.sin(angle))
    measured = spread**2 * np.array([[1.0, 0.3], [0.3, 0.5]])
    plain = covariance(measured, SurfaceError(offset, tilt, 1.0), ratio, torsion)
    found = covariance(measured, SurfaceError(offset, tilt, LONG_TAILS), ratio, torsion)
    factor = found[0, 0] / plain[0, 0]
    np.testing.assert_allclose(found, factor * plain, rtol=1e-9)
    assert LONG_TAILS**-2 * (1.0 - 1e-9) <= factor <= 1.0
    # Trace of V^-1 S, half of which is the surface's share.
    share = 0.5 * np.trace(np.linalg.solve(plain, plain - measured))
    assert factor == pytest.approx(1.0 - share * (1.0 - LONG_TAILS**-2), rel=1e-6)


def test_only_cells_have_measured_tails() -> None:
    constants = build_constants(Scene(robot="ur3e"))
    prior, cells = constants.prior, constants.deviations
    assert surface_error_in_cell(prior, cells, -1).tails == 1.0
    assert surface_error_in_cell(prior, cells, -1).offset == prior.surface_deviation
    found = surface_error_in_cell(prior, cells, 3)
    assert found.offset == pytest.approx(prior.surface_deviation * cells.ratio[3])
    assert (found.tilt, found.tails) == (cells.tilt[3], LONG_TAILS)
