"""A cell is excluded if no force explains the moment about it or leans so far from its normal, or if it would
have to be pulled."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from contactsense.localization.surface.simd_layout import BOUND, ENERGY, LENGTH, NX, SPREAD, TILT, X
from contactsense.localization.surface_search.energy_bound import FORCE_SIGMAS, PULL_SHARE, exclude_cells
from contactsense.localization.surface_search.laplace_evidence import find_modes
from contactsense.robots.jit.lanes import LANES
from contactsense.solvers.posterior.contact_prior import Prior

LEVER = 0.003


def _block(point: np.ndarray, normal: np.ndarray, spread: np.ndarray) -> np.ndarray:
    block = np.zeros(LENGTH)
    for i in range(3):
        block[X + i * LANES : X + (i + 1) * LANES] = point[:, i]
        block[NX + i * LANES : NX + (i + 1) * LANES] = normal[:, i]
    block[SPREAD : SPREAD + LANES] = spread
    return block


def _excluded(block: np.ndarray) -> np.ndarray:
    return np.isinf(block[BOUND : BOUND + LANES])


@pytest.mark.parametrize("seed", range(20))
def test_cells_are_excluded_by_the_energy_of_the_moment(seed: int) -> None:
    rng = np.random.default_rng(seed)
    root = rng.normal(size=(6, 6))
    P, w, o = root @ root.T, rng.normal(size=6), rng.normal(size=3)
    R = Rotation.from_rotvec(rng.normal(size=3)).as_matrix()
    point, spread = rng.normal(size=(LANES, 3)), rng.uniform(0.01, 1.0, LANES)
    # Normals against the force: no cell is excluded as pulled.
    normal = np.tile(-R.T @ w[:3] / np.linalg.norm(w[:3]), (LANES, 1))
    squared_force, force_variance = float(w[:3] @ w[:3]), float(np.trace(P[:3, :3]))
    max_squared_force = (np.sqrt(squared_force) + FORCE_SIGMAS * np.sqrt(force_variance)) ** 2
    energy = np.empty(LANES)
    for j in range(LANES):
        x, y, z = R @ point[j] + o
        moment_map = np.hstack((-np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]]), np.eye(3)))
        C = moment_map @ P @ moment_map.T + max_squared_force * (spread[j] ** 2 + LEVER**2) * np.eye(3)
        energy[j] = 0.5 * moment_map @ w @ np.linalg.solve(C, moment_map @ w)
    for limit in energy:
        block = _block(point, normal, spread)
        exclude_cells(w, P, R, o, squared_force, force_variance, LEVER, limit * (1.0 + 1e-6), block)
        np.testing.assert_array_equal(_excluded(block), energy > limit * (1.0 + 1e-6))


def test_a_pulled_cell_is_excluded() -> None:
    w = np.array([0.0, 0.0, 2.0, 0.0, 0.0, 0.0])
    angle = np.linspace(0.0, 3.0, LANES)
    normal = np.column_stack((np.sin(angle), np.zeros(LANES), np.cos(angle)))
    block = _block(np.zeros((LANES, 3)), normal, np.full(LANES, 0.01))
    exclude_cells(w, 1e-4 * np.eye(6), np.eye(3), np.zeros(3), 4.0, 3e-4, LEVER, np.inf, block)
    np.testing.assert_array_equal(_excluded(block), np.cos(angle) > PULL_SHARE)


@pytest.mark.slow
@pytest.mark.parametrize("tilt", [0.0, 0.3])
def test_the_bound_is_below_the_energy_of_the_best_contact_in_a_cell(tilt: float) -> None:
    rng = np.random.default_rng(3)
    prior = Prior(0.25, LEVER, 0.001, 20.0, 0.005, 1.0, np.zeros(1))
    P, force = np.diag([0.04] * 3 + [0.0025] * 3), np.array([0.0, 0.0, -20.0])
    ratios = []
    for _ in range(50):
        point, angle = rng.normal(size=(LANES, 3)) * 0.02, rng.uniform(0.0, 1.3, LANES)
        normal = np.column_stack((np.sin(angle), np.zeros(LANES), np.cos(angle)))
        block = _block(point, normal, np.full(LANES, 0.01))
        block[TILT : TILT + LANES] = rng.uniform(0.0, tilt, LANES)
        w = np.hstack((force, rng.normal(size=3) * 0.1))
        exclude_cells(w, P, np.eye(3), np.zeros(3), 400.0, 0.12, LEVER, np.inf, block, prior.friction_ratio)
        bound = block[BOUND : BOUND + LANES].copy()
        find_modes(LANES, w, np.linalg.inv(P), prior, 0.0, np.inf, block)
        energy = block[ENERGY : ENERGY + LANES]
        # The energy itself is accurate to the tolerance of the iteration.
        assert np.all(bound < energy + 0.1)
        ratios.append(bound / energy)
    # It is not far below: friction alone explains most of the energy here.
    assert np.median(ratios) > 0.6


def test_the_tilt_of_the_real_surface_counts_as_friction() -> None:
    rng = np.random.default_rng(4)
    angle = rng.uniform(0.0, 1.3, LANES)
    normal = np.column_stack((np.sin(angle), np.zeros(LANES), np.cos(angle)))
    w, P = np.hstack(([0.0, 0.0, -20.0], 0.1 * rng.normal(size=3))), np.diag([0.04] * 3 + [0.0025] * 3)
    bounds = []
    for friction_ratio, tilt in ((0.3, 0.4), (0.5, 0.0)):
        block = _block(np.zeros((LANES, 3)), normal, np.full(LANES, 0.01))
        block[TILT : TILT + LANES] = tilt
        exclude_cells(w, P, np.eye(3), np.zeros(3), 400.0, 0.12, LEVER, np.inf, block, friction_ratio)
        bounds.append(block[BOUND : BOUND + LANES].copy())
    np.testing.assert_allclose(*bounds, rtol=1e-9)
