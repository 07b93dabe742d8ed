"""The joint optimization of several contacts: its gradient, its optimum against SciPy, and its
covariances."""

import numpy as np
import pytest
from scipy.optimize import least_squares

from contactsense.benchmarks.multi_contact.trials import Trials
from contactsense.multi_contact.joint import joint_energy, joint_optimization
from contactsense.multi_contact.joint.contact_step import save_iterate, take_step, vector_of
from contactsense.multi_contact.joint.joint_covariance import covariance_of, fill_covariances
from contactsense.multi_contact.joint.known_rows import KnownRows
from contactsense.multi_contact.memory.buffers import (
    UNKNOWNS,
    JointState,
)
from contactsense.multi_contact.memory.joint_layout import (
    ACTIVE,
    ENERGY,
    FORCE_PRIOR,
    FRICTION_RATIO,
    FX,
    JACOBIAN,
    LOG_EVIDENCE,
    MOMENT_PRIOR,
    MOVING,
    OFFSET,
    OFFSET_STEP,
    PX,
    TORSION,
    TRIAL,
)
from contactsense.robots.jit.lanes import LANES
from contactsense.robots.surface.convex_primitives import project
from contactsense.solvers.posterior.contact_prior import STUDENT_DOF
from tests.contactsense.multi_contact.smooth_arm import NOTHING_KNOWN, SCENE, SHAPES, Case, empty_case, take

pytestmark = pytest.mark.slow  # its kernels compile for long


@pytest.fixture(scope="module")
def case() -> Case:
    return empty_case()


def _optimize(case: Case, m: int, count: int, lanes: int = LANES, known: KnownRows = NOTHING_KNOWN) -> None:
    problem = case.problem(m, count, known)
    case.steps.find_joint_modes(problem, lanes)


def _state_deviations(case: Case, count: int) -> None:
    """Give each contact other deviations of its surface, as the cells of a rough one do."""
    prior = case.constants.prior
    for i, block in enumerate(case.buffers.joint.contact[:count]):
        block[OFFSET_STEP : OFFSET_STEP + LANES] = (i + 2.0) * prior.surface_deviation
        block[FRICTION_RATIO : FRICTION_RATIO + LANES] = (1.0 + 0.5 * i) * prior.friction_ratio


def _in_lane(values: np.ndarray, lane: int, size: int) -> np.ndarray:
    """The first unknowns of a vector, or of the rows of a matrix, in a lane."""
    return np.asarray(values.reshape(*values.shape[:-1], -1, LANES)[..., :size, lane].copy())


def _state_rows(joint: JointState, i: int, rows: np.ndarray) -> None:
    """Rows of what is known of contact i, shape (R, 8), in all lanes."""
    joint.known_rows[i, : rows.size * LANES] = np.repeat(rows.reshape(-1), LANES)


@pytest.mark.parametrize("count", [1, 2, 3])
def test_the_gradients_are_those_of_the_energies(case: Case, count: int) -> None:
    trial = case.trials.draw(count, 20.0, "different")
    m = take(case, trial, 0.01, count)
    _state_deviations(case, count)
    constants, joint = case.constants, case.buffers.joint
    size, known = count * UNKNOWNS, KnownRows(min(count, 2), 9)
    rng = np.random.default_rng(count)
    scale = np.array([100.0] * 3 + [1.0] * 3 + [10.0, 500.0])
    for i, block in enumerate(joint.contact[:count]):
        block.reshape(-1, LANES)[[TORSION // LANES, OFFSET // LANES]] = [[0.02], [0.001]]
        if i < known.contacts:
            block.reshape(-1, LANES)[[FORCE_PRIOR // LANES, MOMENT_PRIOR // LANES]] = [[0.3], [0.4]]
            mean = np.array([*vector_of(block, PX, 0), *vector_of(block, FX, 0), 0.01, 0.0])
            joint.known_mean[i] = np.repeat(mean + rng.standard_normal(8) / scale, LANES)
            _state_rows(joint, i, scale * rng.standard_normal((known.rows, 8)))
    joint.lane[ACTIVE], joint.lane[MOVING] = 1.0, 1.0
    problem = case.problem(m, count, known)
    case.steps.linearize(problem)
    save_iterate(count, joint)
    gradient, length = joint.step[: size * LANES].reshape(size, LANES).copy(), np.ones(LANES)
    for a in range(size):
        values = []
        for change in (1e-6, -1e-6):
            step = np.zeros((size, LANES))
            step[a] = -change
            take_step(constants.surfaces, constants.prior, count, length, step.reshape(-1), joint)
            joint_energy.fill_energies(problem, joint, TRIAL)
            values.append(joint.lane[TRIAL].copy())
        np.testing.assert_allclose((values[0] - values[1]) / 2e-6, gradient[a], rtol=2e-4, atol=2e-3)


def _cross(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """NumPy's takes several times as long for one pair, and SciPy asks for thousands."""
    return np.array((a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]))


def _residuals(case: Case, m: int, primitives: list[int], x: np.ndarray) -> np.ndarray:
    """Independent implementation of the energy: rows, then the priors of each contact."""
    prior, rows = case.constants.prior, case.buffers.rows
    residual = rows.value[:m].copy()
    priors = []
    contacts = ((contact[:3], contact[3:6], contact[6:]) for contact in x.reshape(-1, 8))
    for p, block, (c, f, (xi, h)) in zip(primitives, case.buffers.joint.contact[:2], contacts, strict=True):
        R, o = case.state.frames.rotation[p], case.state.frames.origin[p]
        projected = project(
            case.constants.surfaces.kind[p], case.constants.surfaces.size[p], *(R.T @ (c - o))
        )
        point, normal = R @ np.array(projected[1:4]) + o, R @ np.array(projected[4:7])
        normal_force = max(-float(f @ normal), 1e-6)
        squared_ratio = (f @ f - normal_force**2) / (block[FRICTION_RATIO] * normal_force) ** 2
        wrench = np.concatenate((f, _cross(point + h * normal, f) + xi * normal))
        link = case.constants.surfaces.link[p]
        residual -= rows.matrix[link, :m] @ wrench
        tail = np.sqrt((STUDENT_DOF + 2.0) * np.log1p(max(squared_ratio, 0.0) / STUDENT_DOF))
        # Last, the distance to the surface, so that SciPy's problem is regular.
        priors.append(
            [
                xi / (prior.torsion_lever * normal_force),
                np.log(normal_force / prior.force),
                h / block[OFFSET_STEP],
                tail,
                projected[0],
            ]
        )
    return np.concatenate((residual, *priors))


@pytest.mark.parametrize("seed", range(6))
def test_the_optimum_agrees_with_scipy(case: Case, seed: int) -> None:
    trials = Trials(SCENE, seed=40 + seed)
    trial = trials.draw(2, 20.0, "different")
    m = take(case, trial, 0.01, seed)
    _state_deviations(case, 2)
    joint = case.buffers.joint
    primitives = [int(p) for p in joint.primitive[:2, 0]]
    start = _solution(joint, 0)
    _optimize(case, m, 2)
    oracle = least_squares(
        lambda x: _residuals(case, m, primitives, x),
        start,
        x_scale="jac",
        ftol=1e-12,
        xtol=1e-12,
        max_nfev=500,
    )
    assert np.isfinite(joint.lane[LOG_EVIDENCE]).all()
    # The search ends if the predicted decrease is below `ENERGY_TOLERANCE`; SciPy may go a little further.
    assert joint.lane[ENERGY, 0] <= oracle.cost + 0.05
    for lane in range(LANES):
        residuals = _residuals(case, m, primitives, _solution(joint, lane))
        assert 0.5 * np.sum(residuals**2) == pytest.approx(joint.lane[ENERGY, lane], rel=1e-6)


def _solution(joint: JointState, lane: int) -> np.ndarray:
    """Point, force, torsion and offset of two contacts."""
    return np.concatenate(
        [
            (
                *vector_of(block, PX, lane),
                *vector_of(block, FX, lane),
                block[TORSION + lane],
                block[OFFSET + lane],
            )
            for block in joint.contact[:2]
        ]
    )


def test_lanes_do_not_depend_on_each_other(case: Case) -> None:
    trial = case.trials.draw(2, 20.0, "different")
    m = take(case, trial, 0.02, 7)
    joint = case.buffers.joint
    contact, primitive = joint.contact.copy(), joint.primitive.copy()
    _optimize(case, m, 2)
    together = joint.lane[ENERGY].copy(), [_solution(joint, lane) for lane in range(LANES)]
    for lane in range(LANES):
        for own, source in zip(joint.contact, contact, strict=True):
            own[:] = np.nan
            own.reshape(-1, LANES)[:, 0] = source.reshape(-1, LANES)[:, lane]
        joint.primitive[:, 0] = primitive[:, lane]
        _optimize(case, m, 2, 1)
        assert joint.lane[ENERGY, 0] == pytest.approx(together[0][lane], abs=1e-9)
        np.testing.assert_allclose(_solution(joint, 0), together[1][lane], atol=1e-9)
    joint.contact[:] = 0.0


def test_covariances_are_those_of_the_inverse_matrix(case: Case) -> None:
    trial = case.trials.draw(3, 20.0, "different")
    m = take(case, trial, 0.0, 9)
    joint, size = case.buffers.joint, 3 * UNKNOWNS
    joint.lane[ACTIVE] = 1.0
    case.steps.linearize(case.problem(m, 3))
    matrices = [_in_lane(joint.matrix[:size], lane, size) for lane in range(LANES)]
    joint_optimization._solve(3, joint)
    fill_covariances(3, joint)
    for lane, lower in enumerate(matrices):
        inverse = np.linalg.inv(np.tril(lower) + np.tril(lower, -1).T)
        for i in range(3):
            chosen = i * UNKNOWNS + np.array([4, 5])
            for a in range(2):
                for b in range(2):
                    found = covariance_of(joint, 2 * i + a, 2 * i + b, lane)
                    assert found == pytest.approx(inverse[chosen[a], chosen[b]], rel=1e-6, abs=1e-9)
        wrench = np.hstack(
            [
                block[JACOBIAN : JACOBIAN + 42 * LANES].reshape(7, 6, LANES)[..., lane].T
                for block in joint.contact
            ]
        )
        expected = wrench @ inverse @ wrench.T
        stated = [[covariance_of(joint, 6 + a, 6 + b, lane) for b in range(6)] for a in range(6)]
        np.testing.assert_allclose(stated, expected, rtol=1e-6, atol=1e-9 * np.abs(expected).max())


def test_a_known_point_stays_and_its_covariance_shrinks(case: Case) -> None:
    trial = case.trials.draw(1, 20.0, "different")
    m = take(case, trial, 0.0, 2)
    joint, information = case.buffers.joint, 1.0 / 0.001**2
    block = joint.contact[0]
    before = np.array(vector_of(block, PX, 0))
    joint.known_mean[0, : 3 * LANES] = np.repeat(before, LANES)
    _state_rows(joint, 0, np.sqrt(information) * np.eye(3, 8))
    _optimize(case, m, 1, 1, KnownRows(1, 3))
    assert np.linalg.norm(np.array(vector_of(block, PX, 0)) - before) < 0.003
    fill_covariances(1, joint)
    assert covariance_of(joint, 0, 0, 0) < 1.0 / information
    assert covariance_of(joint, 1, 1, 0) < 1.0 / information


def test_contacts_above_the_limit_are_rejected(case: Case) -> None:
    trial = case.trials.draw(2, 20.0, "different")
    m = take(case, trial, 0.01, 5)
    joint = case.buffers.joint
    case.steps.find_joint_modes(case.problem(m, 2), LANES, limit=-1.0)
    assert np.isposinf(joint.lane[ENERGY]).all()
    assert np.isneginf(joint.lane[LOG_EVIDENCE]).all()


def test_the_prior_over_links_adds_to_the_evidence_once_per_contact(case: Case) -> None:
    density = np.linspace(-1.0, 2.0, len(SHAPES))
    found, links = [], np.zeros(2, dtype=np.int64)
    for log_link_density in (np.zeros(len(SHAPES)), density):
        trial = Trials(SCENE, seed=3).draw(2, 20.0, "different")
        m = take(case, trial, 0.01, 3)
        prior, joint = case.constants.prior._replace(log_link_density=log_link_density), case.buffers.joint
        surfaces = case.constants.surfaces
        problem = case.problem(m, 2)._replace(prior=prior)
        case.steps.find_joint_modes(problem, 1)
        found.append(joint.lane[[ENERGY, LOG_EVIDENCE], 0])
        links = surfaces.link[joint.primitive[:2, 0]]
    assert links[0] != links[1]
    assert found[1][0] == found[0][0]
    assert found[1][1] - found[0][1] == pytest.approx(density[links].sum(), abs=1e-9)
