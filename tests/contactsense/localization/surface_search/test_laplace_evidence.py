"""The evidence of a cell is an integral over force, torsion and place; checked against Monte Carlo
integration."""

import numpy as np
import pytest
from scipy.special import logsumexp

from contactsense.kinematics.wrench_information import to_body_frame
from contactsense.localization.surface_search.laplace_evidence import find_modes
from contactsense.localization.surface_search.surface_evidence import SUBDIVIDE_WITHIN
from contactsense.robots.jit.lanes import LANES
from contactsense.solvers.posterior.contact_prior import STUDENT_DOF, Prior
from contactsense.solvers.posterior.mode import ENERGY_CUTOFF

from contactsense.localization.surface.simd_layout import (  # isort: skip
    A00, A55, ENERGY, FX, FY, FZ, LENGTH, LOG_EVIDENCE, NX, PX, PY, PZ, SPREAD, T1X, T2X, TILT, V11, V12,
    V22, W0, W5, X,
)  # fmt: skip

PRIOR = Prior(
    friction_ratio=0.25,
    torsion_lever=0.0025,
    surface_deviation=0.002,
    force=20.0,
    clearance=0.005,
    area=1.0,
    log_link_density=np.zeros(1),
)
PLACE = np.array([0.1, -0.05, 0.3])
NORMAL = np.array([0.48, 0.6, 0.64])
WIDTH = 0.01


def _draw_from_prior(rng: np.random.Generator, count: int) -> tuple[np.ndarray, np.ndarray]:
    """Wrenches of contacts drawn from the prior, and their points."""
    t1 = np.cross(NORMAL, [0.0, 0.0, 1.0])
    t1 /= np.linalg.norm(t1)
    t2 = np.cross(NORMAL, t1)
    normal_force = PRIOR.force * np.exp(rng.standard_normal(count))
    t_scale = np.sqrt(rng.chisquare(STUDENT_DOF, count) / STUDENT_DOF)
    a, b = PRIOR.friction_ratio * rng.standard_normal((2, count)) / t_scale
    force = normal_force[:, None] * (-NORMAL + a[:, None] * t1 + b[:, None] * t2)
    v = WIDTH * rng.standard_normal((2, count))
    point = PLACE + v[0][:, None] * t1 + v[1][:, None] * t2
    xi = normal_force * PRIOR.torsion_lever * rng.standard_normal(count)
    return np.hstack((force, np.cross(point, force) + xi[:, None] * NORMAL)), point


Cell = tuple[float, ...]
"""Centre, normal and spread."""


def _fill_block(cells: list[Cell]) -> np.ndarray:
    block = np.zeros(LENGTH)
    for j, cell in enumerate(cells):
        block[[quantity + j for quantity in range(X, SPREAD + 1, LANES)]] = cell
    return block


def _read_block(block: np.ndarray, first: int, last: int, j: int) -> np.ndarray:
    """Quantities `first` to `last` of cell j."""
    return block[first + j : last + j + 1 : LANES]


def _evaluate_block(
    w: np.ndarray, L: np.ndarray, cells: list[Cell], force_deviation: float
) -> list[tuple[float, ...]]:
    block = _fill_block(cells)
    find_modes(len(cells), w, L, PRIOR, force_deviation, np.inf, block)
    results = (ENERGY, LOG_EVIDENCE, PX, PY, PZ, V11, V12, V22, FX, FY, FZ)
    return [tuple(block[quantity + j] for quantity in results) for j in range(len(cells))]


def _evaluate(w: np.ndarray, L: np.ndarray, force_deviation: float = 0.0) -> tuple[float, ...]:
    """Energy, log evidence, point (3), covariance along the tangents (v11, v12, v22) and force (3)."""
    return _evaluate_block(w, L, [(*PLACE, *NORMAL, WIDTH)], force_deviation)[0]


@pytest.fixture(scope="module")
def draws() -> np.ndarray:
    return _draw_from_prior(np.random.default_rng(0), 1_000_000)[0]


@pytest.mark.slow
@pytest.mark.parametrize("noise", [(3.0, 1.0), (6.0, 2.0)])
def test_the_evidence_agrees_with_monte_carlo_integration(
    draws: np.ndarray, noise: tuple[float, float]
) -> None:
    rng = np.random.default_rng(1)
    sigma = np.repeat(noise, 3)
    L = np.diag(sigma**-2.0)
    for truth in _draw_from_prior(rng, 6)[0]:
        w = truth + sigma * rng.standard_normal(6)
        monte_carlo = logsumexp(-0.5 * (((draws - w) / sigma) ** 2).sum(axis=1)) - np.log(len(draws))
        # Laplace's approximation with a heavy tail and variable forces: within a factor of 1.6.
        assert _evaluate(w, L)[1] == pytest.approx(monte_carlo, abs=0.5)


def test_an_uninformative_measurement_returns_the_prior() -> None:
    energy, log_z, *mode = _evaluate(np.zeros(6), 1e-14 * np.eye(6), force_deviation=np.inf)
    assert energy == pytest.approx(0.0, abs=1e-9)
    assert log_z == pytest.approx(
        -np.log((STUDENT_DOF + 2.0) / STUDENT_DOF), abs=1e-6
    )  # the curvature of Student's peak
    np.testing.assert_allclose(mode[:3], PLACE, atol=1e-9)
    np.testing.assert_allclose(mode[3:6], [WIDTH**2, 0.0, WIDTH**2], rtol=1e-6, atol=1e-12)


def test_the_covariance_is_that_of_the_direction_in_which_the_place_is_measured() -> None:
    """A known push along the normal; of its moment, only the part about one axis of the surface is known, so
    that the place is known along the other."""
    force, noise = 20.0, 0.02
    block = _fill_block([(*PLACE, *NORMAL, WIDTH)])
    find_modes(1, np.zeros(6), np.eye(6), PRIOR, 0.0, np.inf, block)
    T = np.array([_read_block(block, T1X, T2X - 1, 0), _read_block(block, T2X, W0 - 1, 0)])
    for angle in (0.0, 0.4, np.pi / 2):
        along = np.array([np.cos(angle), np.sin(angle)])
        lever = np.cross(NORMAL, along @ T)
        row = np.concatenate((np.cross(lever, PLACE), lever))  # of the wrench: its moment about the lever
        L = np.outer(row, row) / noise**2
        L[:3, :3] += 1e6 * np.eye(3)
        w = np.concatenate((-force * NORMAL, np.cross(PLACE, -force * NORMAL)))
        found = _evaluate(w, L)[5:8]
        known = 1.0 / (1.0 / WIDTH**2 + (force / noise) ** 2)
        expected = WIDTH**2 * np.eye(2) + (known - WIDTH**2) * np.outer(along, along)
        np.testing.assert_allclose(found, expected[np.triu_indices(2)], rtol=0.02, atol=2e-6)


def test_the_initial_force_does_not_matter() -> None:
    rng = np.random.default_rng(2)
    L = np.diag(np.repeat([1.0, 0.2], 3) ** -2.0)
    for w in _draw_from_prior(rng, 10)[0]:
        values = [_evaluate(w, L, force_deviation)[1] for force_deviation in (np.inf, 5.0, 0.0)]
        assert max(values) - min(values) < 0.2


@pytest.mark.parametrize(
    "w", [np.zeros(6), np.full(6, 1e12), np.full(6, 1e-300), np.array([0, 0, 0, 0, 0, 1e6])]
)
@pytest.mark.parametrize("scale", [1e-12, 1.0, 1e8])
def test_hard_cases_give_numbers(w: np.ndarray, scale: float) -> None:
    result = _evaluate(w, scale * np.eye(6))
    assert not np.isnan(result).any()


def test_the_tilt_of_the_real_surface_counts_as_friction() -> None:
    rng = np.random.default_rng(7)
    root = rng.standard_normal((6, 6))
    L, w = root @ root.T, _draw_from_prior(rng, 1)[0][0]
    found = []
    for friction_ratio, tilt in ((0.3, 0.4), (0.5, 0.0)):
        block = _fill_block([(*PLACE, *NORMAL, WIDTH)])
        block[TILT] = tilt
        find_modes(1, w, L, PRIOR._replace(friction_ratio=friction_ratio), 0.0, np.inf, block)
        found.append([block[quantity] for quantity in (ENERGY, LOG_EVIDENCE, PX, PY, PZ, FX, FY, FZ)])
    np.testing.assert_allclose(*found, rtol=1e-9)


def test_the_result_of_a_cell_is_independent_of_its_lane() -> None:
    rng = np.random.default_rng(4)
    root = rng.standard_normal((6, 6))
    L, w = root @ root.T, _draw_from_prior(rng, 1)[0][0]
    cells: list[Cell] = []
    for _ in range(LANES):
        normal = rng.standard_normal(3)
        point = 0.2 * rng.standard_normal(3)
        cells.append((*point, *(normal / np.linalg.norm(normal)), rng.uniform(0.005, 0.02)))
    together = _evaluate_block(w, L, cells, force_deviation=0.0)
    for j, cell in enumerate(cells):
        np.testing.assert_allclose(
            _evaluate_block(w, L, [cell], force_deviation=0.0)[0], together[j], rtol=1e-9
        )
    reversed_order = _evaluate_block(w, L, cells[::-1], force_deviation=0.0)
    np.testing.assert_allclose(reversed_order[::-1], together, rtol=1e-9)


def test_the_wrench_is_transformed_to_the_axes_of_each_cell() -> None:
    rng = np.random.default_rng(5)
    root = rng.standard_normal((6, 6))
    L, w = root @ root.T, rng.standard_normal(6)
    cells = [(*(k * PLACE), *(sign * NORMAL), WIDTH) for k in (1.0, -2.0) for sign in (1.0, -1.0)]
    block = _fill_block(cells)
    find_modes(len(cells), w, L, PRIOR, 0.0, np.inf, block)
    for j in range(len(cells)):
        T = np.stack(
            [
                _read_block(block, NX, SPREAD - 1, j),
                _read_block(block, T1X, T2X - 1, j),
                _read_block(block, T2X, W0 - 1, j),
            ]
        )
        np.testing.assert_allclose(T @ T.T, np.eye(3), atol=1e-12)
        transformed, information = np.empty(6), np.empty((6, 6))
        to_body_frame(w, L, T.T.copy(), _read_block(block, X, NX - 1, j).copy(), transformed, information)
        np.testing.assert_allclose(_read_block(block, W0, W5, j), transformed, atol=1e-12)
        upper = information[np.triu_indices(6)]
        np.testing.assert_allclose(_read_block(block, A00, A55, j), upper, rtol=1e-9, atol=1e-12)


@pytest.mark.parametrize("rows", [4, 6])
def test_a_limit_rejects_only_cells_whose_modes_are_above_it(rows: int) -> None:
    """With four rows, as of four joint torques, the force is not measured, and the search starts far from the
    mode."""
    rng = np.random.default_rng(6)
    lost, total = 0.0, 0.0
    for truth in _draw_from_prior(rng, 100)[0]:
        J = rng.standard_normal((rows, 6)) * ([1.0] * 3 + [5.0] * 3)
        L = J.T @ J / 0.3**2 + 1e-6 * np.eye(6)
        P = np.linalg.inv(L)
        w = P @ (J.T @ (J @ truth + 0.3 * rng.standard_normal(rows))) / 0.3**2
        deviation = float(np.sqrt(np.trace(P[:3, :3])))
        cells: list[Cell] = []
        for _ in range(LANES):
            normal = NORMAL + 0.5 * rng.standard_normal(3)
            place = PLACE + 0.05 * rng.standard_normal(3)
            cells.append((*place, *(normal / np.linalg.norm(normal)), WIDTH))
        energy = np.array([cell[0] for cell in _evaluate_block(w, L, cells, deviation)])
        limit = energy.min() + ENERGY_CUTOFF
        block = _fill_block(cells)
        find_modes(LANES, w, L, PRIOR, deviation, limit, block)
        found = block[ENERGY : ENERGY + LANES]
        weight = np.exp(energy.min() - energy)
        lost, total = lost + weight[np.isinf(found)].sum(), total + weight.sum()
        assert (found[found < np.inf] <= limit).all()
        assert (found < np.inf)[energy < energy.min() + SUBDIVIDE_WITHIN].all()
    assert lost < 1e-3 * total
