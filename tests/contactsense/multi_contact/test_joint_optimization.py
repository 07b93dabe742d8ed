"""The joint optimization of several contacts: its gradient, and its optimum against SciPy."""

from typing import NamedTuple

import numpy as np
import pytest
from scipy.optimize import least_squares

from contactsense import Localizer, Scene, robots
from contactsense.benchmarks.multi_contact.trials import Trial, Trials
from contactsense.kinematics.linalg.cholesky import invert_factored, solve_in_place
from contactsense.localization.ranking import place_primitives
from contactsense.multi_contact import joint_energy, joint_optimization
from contactsense.multi_contact.buffers import (
    UNKNOWNS,
    MultiContactBuffers,
    PrimitiveFrames,
    empty_multi_contact_buffers,
)
from contactsense.multi_contact.measurement_rows import Variances, fill_measurement_rows
from contactsense.robots.primitives import Capsule, Ellipsoid, Primitive, Sphere
from contactsense.robots.surface.convex_primitives import project
from contactsense.runtime.constants import Constants
from contactsense.runtime.state import State
from contactsense.solvers.posterior import STUDENT_DOF
from tests.plain_arm import plain_ur5e

SHAPES: tuple[Primitive, ...] = (
    Sphere(center=(0, 0, 0.05), radius=0.09),
    Sphere(center=(0, 0, 0), radius=0.08),
    Capsule(a=(0.05, 0, 0.138), b=(-0.45, 0, 0.138), radius=0.06),
    Capsule(a=(0.05, 0, 0.007), b=(-0.4, 0, 0.007), radius=0.05),
    Capsule(a=(0, -0.02, 0), b=(0, 0.05, 0), radius=0.045),
    Capsule(a=(0, -0.05, 0), b=(0, 0.02, 0), radius=0.045),
    Ellipsoid(center=(0, 0, -0.02), radii=(0.04, 0.045, 0.05)),
)
"""One smooth body per link: at edges the curvature is discontinuous and solvers differ."""


def _smooth() -> robots.Robot:
    constants = plain_ur5e()
    links = tuple(
        robots.Link(link.name, link.inertia, (shape,))
        for link, shape in zip(constants.links, SHAPES, strict=True)
    )
    return robots.Robot(
        constants.name, links, constants.joints, constants.flange_rotation, constants.flange_translation
    )


SCENE = Scene(robot=_smooth())


class Case(NamedTuple):
    localizer: Localizer
    constants: Constants
    state: State
    buffers: MultiContactBuffers
    trials: Trials

    @property
    def frames(self) -> PrimitiveFrames:
        return PrimitiveFrames(self.state.candidates.rotation, self.state.candidates.origin)


@pytest.fixture(scope="module")
def case() -> Case:
    localizer = Localizer(SCENE)
    constants, state = localizer._buffers.constants, localizer._buffers.state
    return Case(localizer, constants, state, empty_multi_contact_buffers(constants), Trials(SCENE, seed=4))


def _take(case: Case, trial: Trial, shift: float, seed: int) -> int:
    """Noisy measurement of a trial; its contacts, displaced by about `shift` metres, as initial values.
    Number of rows."""
    rng = np.random.default_rng(seed)
    base, torque = trial.measure(trial.pushes)
    base = base + rng.standard_normal(6) * np.repeat((0.25, 0.05), 3)
    torque = torque + rng.standard_normal(6)
    case.localizer.locate(trial.q, base_wrench=base, joint_torque=torque, detect=False)
    surfaces, frames, optimizer = case.constants.surfaces, case.frames, case.buffers.optimizer
    place_primitives(surfaces, case.constants.sensors.depth, case.state.motion, case.state.candidates)
    optimizer.prior_point_information[:] = 0.0
    optimizer.prior_force_information[:] = 0.0
    for i, push in enumerate(trial.pushes):
        indices = range(surfaces.start[push.link], surfaces.start[push.link + 1])
        p = min(indices, key=lambda p: abs(_distance(case, p, push.point)))
        start = push.point + shift * rng.standard_normal(3)
        joint_optimization.set_contact(surfaces, frames, optimizer, i, p, tuple(start), tuple(push.force))
    state = case.state
    external = (state.base_wrench, state.torque, state.link_wrench)
    return int(
        fill_measurement_rows(
            case.constants.sensors, state.motion, external,
            Variances(
                case.constants.sensors.base_information, 1.0, case.constants.sensors.torque_variance,
                state.link_variance, state.link_origin,
            ),
            (True, True, 0), 0.0, case.buffers.rows,
        )
    )  # fmt: skip


def _distance(case: Case, p: int, point: np.ndarray) -> float:
    local = case.state.candidates.rotation[p].T @ (point - case.state.candidates.origin[p])
    return float(project(case.constants.surfaces.kind[p], case.constants.surfaces.size[p], *local)[0])


@pytest.mark.parametrize("count", [1, 2, 3])
def test_the_gradient_is_that_of_the_energy(case: Case, count: int) -> None:
    trial = case.trials.draw(count, 20.0, "different", "cone")
    m = _take(case, trial, 0.01, count)
    constants, frames, rows, optimizer = (
        case.constants,
        case.frames,
        case.buffers.rows,
        case.buffers.optimizer,
    )
    size = count * UNKNOWNS
    for i in range(count):
        optimizer.torsion[i], optimizer.offset[i] = 0.02, 0.001
        optimizer.prior_point[i] = optimizer.point[i] + 0.002
        optimizer.prior_point_information[i] = 1e4 * np.eye(3)
        optimizer.prior_force[i] = optimizer.force[i] + 1.0
        optimizer.prior_force_information[i] = 0.5
    joint_energy.linearize(constants.surfaces, frames, rows, m, constants.prior, count, optimizer)
    joint_optimization._save_iterate(count, optimizer, True)
    gradient = optimizer.step[:size].copy()
    for a in range(size):
        values = []
        for step in (1e-6, -1e-6):
            optimizer.step[:size] = 0.0
            optimizer.step[a] = -step
            joint_optimization._step(constants.surfaces, frames, constants.prior, count, 1.0, optimizer)
            values.append(
                joint_energy.energy_of(constants.surfaces.link, rows, m, constants.prior, count, optimizer)
            )
        slope = (values[0] - values[1]) / 2e-6
        assert slope == pytest.approx(gradient[a], rel=2e-4, abs=2e-3)


def _cross(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """NumPy's takes several times as long for one pair, and SciPy asks for thousands."""
    return np.array((a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]))


def _residuals(case: Case, m: int, primitives: list[int], x: np.ndarray) -> np.ndarray:
    """Independent implementation of the energy: rows, then the priors of each contact."""
    prior, rows = case.constants.prior, case.buffers.rows
    residual = rows.value[:m].copy()
    priors = []
    for p, (c, f, (xi, h)) in zip(
        primitives, ((contact[:3], contact[3:6], contact[6:]) for contact in x.reshape(-1, 8)), strict=True
    ):
        R, o = case.state.candidates.rotation[p], case.state.candidates.origin[p]
        projected = project(
            case.constants.surfaces.kind[p], case.constants.surfaces.size[p], *(R.T @ (c - o))
        )
        point, normal = R @ np.array(projected[1:4]) + o, R @ np.array(projected[4:7])
        normal_force = max(-float(f @ normal), 1e-6)
        squared_ratio = (f @ f - normal_force**2) / (prior.friction_ratio * normal_force) ** 2
        wrench = np.concatenate((f, _cross(point + h * normal, f) + xi * normal))
        link = case.constants.surfaces.link[p]
        residual -= rows.matrix[link, :m] @ wrench
        tail = np.sqrt((STUDENT_DOF + 2.0) * np.log1p(max(squared_ratio, 0.0) / STUDENT_DOF))
        # Last, the distance to the surface, so that SciPy's problem is regular.
        priors.append(
            [
                xi / (prior.torsion_lever * normal_force),
                np.log(normal_force / prior.force),
                h / prior.surface_deviation,
                tail,
                projected[0],
            ]
        )
    return np.concatenate((residual, *priors))


@pytest.mark.parametrize("seed", range(6))
def test_the_optimum_agrees_with_scipy(case: Case, seed: int) -> None:
    trials = Trials(SCENE, seed=40 + seed)
    trial = trials.draw(2, 20.0, "different", "cone")
    m = _take(case, trial, 0.01, seed)
    constants, optimizer = case.constants, case.buffers.optimizer
    primitives = [int(p) for p in optimizer.primitive[:2]]
    start = np.concatenate(
        [np.concatenate((optimizer.point[i], optimizer.force[i], [0.0, 0.0])) for i in range(2)]
    )
    energy, log_z = joint_optimization.find_joint_mode(
        constants.surfaces, case.frames, case.buffers.rows, m, constants.prior, 2, np.inf, optimizer
    )
    assert np.isfinite(log_z)
    oracle = least_squares(
        lambda x: _residuals(case, m, primitives, x),
        start,
        x_scale="jac",
        ftol=1e-12,
        xtol=1e-12,
        max_nfev=500,
    )
    # The search ends if the predicted decrease is below `ENERGY_TOLERANCE`; SciPy may go a little further.
    assert energy <= oracle.cost + 0.05
    solution = np.concatenate(
        [
            np.concatenate(
                (optimizer.point[i], optimizer.force[i], [optimizer.torsion[i], optimizer.offset[i]])
            )
            for i in range(2)
        ]
    )
    assert 0.5 * np.sum(_residuals(case, m, primitives, solution) ** 2) == pytest.approx(energy, rel=1e-6)


def test_the_inverse_is_that_of_the_matrix(case: Case) -> None:
    trial = case.trials.draw(3, 20.0, "different", "cone")
    m = _take(case, trial, 0.0, 9)
    constants, optimizer = case.constants, case.buffers.optimizer
    joint_energy.linearize(
        constants.surfaces, case.frames, case.buffers.rows, m, constants.prior, 3, optimizer
    )
    size = 3 * UNKNOWNS
    lower = np.tril(optimizer.matrix[:size, :size])
    matrix = lower + lower.T - np.diag(np.diag(lower))
    log_det, _ = solve_in_place(optimizer.matrix, optimizer.step, size)
    assert log_det == pytest.approx(np.linalg.slogdet(matrix)[1])
    invert_factored(optimizer, size)
    np.testing.assert_allclose(optimizer.inverse[:size, :size] @ matrix, np.eye(size), atol=1e-6)


def test_a_known_point_stays_and_its_covariance_shrinks(case: Case) -> None:
    trial = case.trials.draw(1, 20.0, "different", "cone")
    m = _take(case, trial, 0.0, 2)
    constants, optimizer = case.constants, case.buffers.optimizer
    information = 1.0 / 0.001**2
    optimizer.prior_point[0] = optimizer.point[0]
    optimizer.prior_point_information[0] = information * np.eye(3)
    joint_optimization.find_joint_mode(
        constants.surfaces, case.frames, case.buffers.rows, m, constants.prior, 1, np.inf, optimizer
    )
    assert np.linalg.norm(optimizer.point[0] - optimizer.prior_point[0]) < 0.003
    invert_factored(optimizer, UNKNOWNS)
    assert optimizer.inverse[4, 4] < 1.0 / information
    assert optimizer.inverse[5, 5] < 1.0 / information


def test_the_prior_over_links_adds_to_the_evidence_once_per_contact(case: Case) -> None:
    density = np.linspace(-1.0, 2.0, len(SHAPES))
    found, links = [], np.zeros(2, dtype=np.int64)
    for log_link_density in (np.zeros(len(SHAPES)), density):
        trial = Trials(SCENE, seed=3).draw(2, 20.0, "different", "cone")
        m = _take(case, trial, 0.01, 3)
        prior, optimizer = (
            case.constants.prior._replace(log_link_density=log_link_density),
            case.buffers.optimizer,
        )
        surfaces = case.constants.surfaces
        found.append(
            joint_optimization.find_joint_mode(
                surfaces, case.frames, case.buffers.rows, m, prior, 2, np.inf, optimizer
            )
        )
        links = surfaces.link[optimizer.primitive[:2]]
    assert links[0] != links[1]
    assert found[1][0] == found[0][0]
    assert found[1][1] - found[0][1] == pytest.approx(density[links].sum(), abs=1e-9)
