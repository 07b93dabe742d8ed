"""Blocks of primitives: each lane as if it were alone, and the comparison of lanes."""

import math

import numpy as np
import pytest

from contactsense.kinematics.linalg.ldl import ldl_solve
from contactsense.kinematics.wrench_information import to_body_frame
from contactsense.robots.jit.flat_buffers import zeros
from contactsense.robots.jit.lanes import LANES
from contactsense.robots.primitives import Box, Capsule, Cylinder, Ellipsoid, Primitive, Sphere
from contactsense.robots.rotations import rotation_from_vector
from contactsense.robots.surface.convex_primitives import body, bounding_radius, curvature
from contactsense.solvers.posterior.contact_prior import Contact, Prior, SearchBuffers, pushing_force
from contactsense.solvers.posterior.energy import inflate_by_surface_deviation, linearize
from contactsense.solvers.posterior.line_of_action import enter_surfaces
from contactsense.solvers.posterior.mode import (
    ENERGY_CUTOFF,
    ENERGY_TOLERANCE,
    IDLE,
    Mode,
    begin_search,
    find_posterior_modes,
    mode_of,
    resume_searches,
)
from contactsense.solvers.wrench import wrench_of
from tests.contactsense.solvers.one_lane import enter_surface, posterior_mode

from contactsense.solvers.posterior.block import (  # isort: skip
    DECREASE, ENERGY, F00, F12, LENGTH, M22, S0, SEARCH, W0, W5, D00,
)  # fmt: skip
from contactsense.solvers.posterior.simd import (  # isort: skip
    contact_of, gauss_newton_steps, load_frame, load_primitive, load_prior, load_wrench, shape_operators,
    wrenches_to_body_frames,
)  # fmt: skip

SHAPES: tuple[Primitive, ...] = (
    Sphere(center=(0, 0, 0), radius=0.05),
    Capsule(a=(0, 0, -0.2), b=(0, 0, 0.2), radius=0.05),
    Cylinder(a=(0, 0, -0.1), b=(0, 0, 0.1), radius_a=0.06, radius_b=0.05, rounding=0.01),
    Ellipsoid(center=(0, 0, 0), radii=(0.1, 0.06, 0.05)),
    Box(center=(0, 0, 0), half=(0.1, 0.06, 0.05), rounding=0.02),
    Capsule(a=(0, 0, -0.1), b=(0, 0, 0.1), radius=0.08),
)
KIND = np.array([body(shape)[0] for shape in SHAPES])
SIZE = np.zeros((len(SHAPES), 8))
for row, shape in zip(SIZE, SHAPES, strict=True):
    row[: len(body(shape)[3])] = body(shape)[3]
ROWS = np.arange(len(SHAPES))
PRIOR = Prior(0.25, 0.0025, 0.001, 20.0, 0.005, 1.0, np.zeros(1))
NOISE = np.array([0.25] * 3 + [0.05] * 3)


def _loaded(seed: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """A block with a noisy wrench in each lane; the wrenches and their information matrix."""
    rng = np.random.default_rng(seed)
    block, information = zeros(SearchBuffers).block, np.diag(NOISE**-2.0)
    wrenches = np.empty((len(SHAPES), 6))
    for j in ROWS:
        place, force = rng.uniform(-0.05, 0.05, 3), rng.standard_normal(3) * 15.0
        wrenches[j] = np.concatenate((force, np.cross(place, force))) + NOISE * rng.standard_normal(6)
        load_primitive(j, KIND[j], SIZE[j], bounding_radius(KIND[j], SIZE[j]), block)
        load_wrench(j, wrenches[j], information, block)
        load_prior(j, PRIOR, block)
    enter_surfaces(KIND, SIZE, ROWS, block)
    return block, wrenches, information


def _begin(block: np.ndarray, wrenches: np.ndarray, other: np.ndarray) -> None:
    for j in ROWS:
        entry = contact_of(j, block)
        force = pushing_force(tuple(wrenches[j, :3].tolist()), entry.normal)
        begin_search(j, Contact(entry.point, entry.normal, force, 0.0), other[j], -math.inf, PRIOR, block)


def _alone(block: np.ndarray, wrenches: np.ndarray, information: np.ndarray) -> list[Mode]:
    """The mode of each lane, searched in a block of its own."""
    modes = []
    for j in ROWS:
        measured = wrench_of(wrenches[j, :3], wrenches[j, 3:])
        _, point, normal = enter_surface(KIND[j], SIZE[j], measured)
        found = contact_of(j, block)
        np.testing.assert_allclose(found.point, point, atol=1e-12)
        np.testing.assert_allclose(found.normal, normal, atol=1e-9)
        start = Contact(point, normal, pushing_force(measured.force, normal), 0.0)
        modes.append(posterior_mode(KIND[j], SIZE[j], wrenches[j], information, PRIOR, start))
    return modes


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(20))
def test_each_lane_is_as_if_it_were_alone(seed: int) -> None:
    block, wrenches, information = _loaded(seed)
    # One lane searches while the others wait.
    for j, expected in enumerate(_alone(block, wrenches, information)):
        _begin(block, wrenches, np.zeros(len(SHAPES)))
        block[SEARCH + np.delete(ROWS, j)] = IDLE
        find_posterior_modes(KIND, SIZE, ROWS, PRIOR, math.inf, ENERGY_TOLERANCE, block)
        mode = mode_of(j, PRIOR, block)
        assert mode.energy == pytest.approx(expected.energy, rel=1e-9)
        assert mode.log_evidence == pytest.approx(expected.log_evidence, rel=1e-9)
        enter_surfaces(KIND, SIZE, ROWS, block)


def test_lanes_that_are_as_low_as_the_others_are_as_accurate_as_alone() -> None:
    """All but a few: on the way a lane may be so much worse that less accuracy is wanted."""
    excess = []
    for seed in range(100):
        block, wrenches, information = _loaded(seed)
        alone = np.array([mode.energy for mode in _alone(block, wrenches, information)])
        _begin(block, wrenches, alone.max() - alone)
        find_posterior_modes(KIND, SIZE, ROWS, PRIOR, math.inf, ENERGY_TOLERANCE, block)
        excess += [mode_of(j, PRIOR, block).energy - alone[j] for j in ROWS]
    assert np.quantile(np.abs(excess), 0.99) < ENERGY_TOLERANCE


def test_lanes_that_are_hopeless_beside_others_are_given_up_and_resumed() -> None:
    block, wrenches, _ = _loaded(3)
    other = np.zeros(len(SHAPES))
    other[0] = -1e3
    _begin(block, wrenches, other)
    lowest = find_posterior_modes(KIND, SIZE, ROWS, PRIOR, math.inf, ENERGY_TOLERANCE, block)
    # The lowest energy is that before the last step, which is shorter than the tolerance.
    assert lowest == pytest.approx(mode_of(0, PRIOR, block).energy - 1e3, abs=ENERGY_TOLERANCE)
    assert all(mode_of(j, PRIOR, block).log_evidence == -math.inf for j in ROWS[1:])
    # Nothing has changed, so there is nothing to resume.
    assert not resume_searches(len(ROWS), lowest, block)
    # The first one turns out to be covered.
    assert resume_searches(len(ROWS), lowest + 1e3, block)
    find_posterior_modes(KIND, SIZE, ROWS, PRIOR, lowest + 1e3, ENERGY_TOLERANCE, block)
    energies = [mode_of(j, PRIOR, block).energy for j in ROWS]
    fresh, _, _ = _loaded(3)
    _begin(fresh, wrenches, np.zeros(len(SHAPES)))
    find_posterior_modes(KIND, SIZE, ROWS, PRIOR, lowest + 1e3, ENERGY_TOLERANCE, fresh)
    for j in ROWS:
        expected = mode_of(j, PRIOR, fresh).energy
        if expected < lowest + 1e3 + ENERGY_CUTOFF - 1.0:
            assert energies[j] == pytest.approx(expected, abs=0.05)


def test_steps_are_those_of_one_contact() -> None:
    block, wrenches, information = _loaded(5)
    _begin(block, wrenches, np.zeros(len(SHAPES)))
    revolved = ROWS[KIND[0] == KIND]
    shape_operators(len(ROWS), block)
    gauss_newton_steps(PRIOR.torsion_lever, len(ROWS), block)
    for j in revolved:
        contact, buffers = contact_of(j, block), zeros(SearchBuffers)
        W = curvature(KIND[j], SIZE[j], *contact.point, *contact.normal)
        inflation = inflate_by_surface_deviation(information, PRIOR, contact)
        energy = linearize(wrenches[j], information, PRIOR, inflation, W, contact, buffers)
        _, decrease, *_ = ldl_solve(buffers.normal_equations, buffers.gradient)
        assert block[ENERGY + j] == pytest.approx(energy, rel=1e-9)
        assert block[DECREASE + j] == pytest.approx(decrease, rel=1e-6)
        step = block[S0 + j : S0 + j + 6 * LANES : LANES]
        np.testing.assert_allclose(step, buffers.gradient, rtol=1e-5, atol=1e-9)


def test_wrenches_are_transformed_as_one_by_one() -> None:
    rng = np.random.default_rng(7)
    block = np.zeros(LENGTH)
    expected = []
    for j in range(LANES):
        root, w = rng.standard_normal((6, 6)), rng.standard_normal(6)
        R, o, L = rotation_from_vector(rng.standard_normal(3)), rng.standard_normal(3), root @ root.T
        load_wrench(j, w, L, block)
        load_frame(j, R, o, block)
        v, B = np.empty(6), np.empty((6, 6))
        to_body_frame(w, L, R, o, v, B)
        expected.append((v, B))
    wrenches_to_body_frames(block)
    rows = block.reshape(-1, LANES)
    first = {
        name: value // LANES for name, value in (("W", W0), ("F", F00), ("D", D00), ("M", M22 - 5 * LANES))
    }
    upper = np.triu_indices(3)
    assert (W5 - W0) // LANES == 5
    assert (F12 - F00) // LANES == 4
    for j, (v, B) in enumerate(expected):
        np.testing.assert_allclose(rows[first["W"] : first["W"] + 6, j], v, rtol=1e-12)
        np.testing.assert_allclose(
            rows[first["F"] : first["F"] + 6, j], B[:3, :3][upper], rtol=1e-9, atol=1e-12
        )
        np.testing.assert_allclose(
            rows[first["D"] : first["D"] + 9, j], B[3:, :3].ravel(), rtol=1e-9, atol=1e-12
        )
        np.testing.assert_allclose(
            rows[first["M"] : first["M"] + 6, j], B[3:, 3:][upper], rtol=1e-9, atol=1e-12
        )
