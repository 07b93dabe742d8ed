"""The search with stacked contacts: its gradient, and its optimum against SciPy's."""

from typing import NamedTuple

import numpy as np
import pytest
from scipy.optimize import least_squares

import robots
from contactsense import Scene
from contactsense.arm import Arm, build_arm
from contactsense.energy import TAIL
from contactsense.locate import place_primitives
from contactsense.memory import Memory, empty_memory
from contactsense.pipeline import rest
from contactsense.several import stack as kernels
from contactsense.several.cholesky import invert, solve_in_place
from contactsense.several.memory import UNKNOWNS, Several, empty_several
from contactsense.several.rows import fill_rows
from robots.primitives import Capsule, Ellipsoid, Primitive, Sphere
from robots.surface import project
from service.bench.several.trials import Trial, Trials
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
"""One smooth body a link: on edges an optimum may be a kink, where solvers that know nothing of it differ."""


def _smooth() -> robots.Robot:
    arm = plain_ur5e()
    links = tuple(
        robots.Link(link.name, link.inertia, (shape,)) for link, shape in zip(arm.links, SHAPES, strict=True)
    )
    return robots.Robot(arm.name, links, arm.joints, arm.flange_rotation, arm.flange_translation)


SCENE = Scene(robot=_smooth())


class Case(NamedTuple):
    arm: Arm
    memory: Memory
    several: Several
    trials: Trials


@pytest.fixture(scope="module")
def case() -> Case:
    arm = build_arm(SCENE)
    return Case(arm, empty_memory(arm), empty_several(arm), Trials(SCENE, seed=4))


def _take(case: Case, trial: Trial, shift: float, seed: int) -> int:
    """A noisy measurement of a trial, its contacts, `shift` metres away, as a first guess; how many rows."""
    chance = np.random.default_rng(seed)
    base, torque = trial.measure(trial.pushes)
    base = base + chance.standard_normal(6) * np.repeat((0.25, 0.05), 3)
    rest(case.arm, case.memory, trial.q, torque + chance.standard_normal(6), base, np.zeros(6), True)
    surfaces, found, stack = case.arm.surfaces, case.memory.found, case.several.stack
    place_primitives(surfaces, case.arm.sensors.depth, case.memory.motion, found)
    stack.prior_sharpness[:] = 0.0
    stack.prior_stiffness[:] = 0.0
    for i, push in enumerate(trial.pushes):
        own = range(surfaces.start[push.link], surfaces.start[push.link + 1])
        p = min(own, key=lambda p: abs(_distance(case, p, push.point)))
        start = push.point + shift * chance.standard_normal(3)
        kernels.put(surfaces, found, stack, i, p, *start, *push.force)
    memory = case.memory
    parts = (memory.base_wrench, memory.torque, memory.wrist_wrench)
    return int(
        fill_rows(
            case.arm.sensors, memory.motion, parts, case.arm.sensors.base_information,
            case.arm.sensors.torque_variance, memory.wrist_origin, (True, True, False), 1.0, 0.0,
            case.several.rows,
        )
    )  # fmt: skip


def _distance(case: Case, p: int, point: np.ndarray) -> float:
    local = case.memory.found.rotation[p].T @ (point - case.memory.found.origin[p])
    return float(project(case.arm.surfaces.kind[p], case.arm.surfaces.size[p], *local)[0])


@pytest.mark.parametrize("count", [1, 2, 3])
def test_the_gradient_is_that_of_the_energy(case: Case, count: int) -> None:
    trial = case.trials.draw(count, 20.0, "different", "cone")
    m = _take(case, trial, 0.01, count)
    arm, found, rows, stack = case.arm, case.memory.found, case.several.rows, case.several.stack
    size = count * UNKNOWNS
    for i in range(count):
        stack.torsion[i], stack.offset[i] = 0.02, 0.001
        stack.prior_point[i] = stack.point[i] + 0.002
        stack.prior_sharpness[i] = 1e4 * np.eye(3)
        stack.prior_force[i] = stack.force[i] + 1.0
        stack.prior_stiffness[i] = 0.5
    kernels._linearize(arm.surfaces, found, rows, m, arm.prior, count, stack)
    kernels._keep(count, stack, True)
    gradient = stack.step[:size].copy()
    for a in range(size):
        values = []
        for step in (1e-6, -1e-6):
            stack.step[:size] = 0.0
            stack.step[a] = -step
            kernels._step(arm.surfaces, found, arm.prior, count, 1.0, stack)
            values.append(kernels._energy(arm.surfaces.link, rows, m, arm.prior, count, stack))
        slope = (values[0] - values[1]) / 2e-6
        assert slope == pytest.approx(gradient[a], rel=2e-4, abs=2e-3)


def _residuals(case: Case, m: int, primitives: list[int], x: np.ndarray) -> np.ndarray:
    """The same energy written out anew: rows, then the priors of each contact."""
    prior, rows = case.arm.prior, case.several.rows
    left = rows.value[:m].copy()
    parts = []
    for p, (c, f, (xi, h)) in zip(
        primitives, ((part[:3], part[3:6], part[6:]) for part in x.reshape(-1, 8)), strict=True
    ):
        R, o = case.memory.found.rotation[p], case.memory.found.origin[p]
        found = project(case.arm.surfaces.kind[p], case.arm.surfaces.size[p], *(R.T @ (c - o)))
        point, normal = R @ np.array(found[1:4]) + o, R @ np.array(found[4:7])
        push = max(-float(f @ normal), 1e-6)
        lean = (f @ f - push**2) / (prior.lean * push) ** 2
        wrench = np.concatenate((f, np.cross(point + h * normal, f) + xi * normal))
        link = case.arm.surfaces.link[p]
        left -= rows.matrix[link, :m] @ wrench
        heavy = np.sqrt((TAIL + 2.0) * np.log1p(max(lean, 0.0) / TAIL))
        # The last: the free coordinate along the normal, so that SciPy's problem is regular.
        parts.append(
            [xi / (prior.lever * push), np.log(push / prior.force), h / prior.offset, heavy, found[0]]
        )
    return np.concatenate((left, *parts))


@pytest.mark.parametrize("seed", range(6))
def test_the_optimum_is_that_of_a_general_solver(case: Case, seed: int) -> None:
    trials = Trials(SCENE, seed=40 + seed)
    trial = trials.draw(2, 20.0, "different", "cone")
    m = _take(case, trial, 0.01, seed)
    arm, stack = case.arm, case.several.stack
    primitives = [int(p) for p in stack.primitive[:2]]
    start = np.concatenate([np.concatenate((stack.point[i], stack.force[i], [0.0, 0.0])) for i in range(2)])
    energy, log_z = kernels.settle(
        arm.surfaces, case.memory.found, case.several.rows, m, arm.prior, 2, np.inf, stack
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
    # The search ends where a step promises less than `ENOUGH`; a valley may be followed a little further.
    assert energy <= oracle.cost + 0.05
    own = np.concatenate(
        [
            np.concatenate((stack.point[i], stack.force[i], [stack.torsion[i], stack.offset[i]]))
            for i in range(2)
        ]
    )
    assert 0.5 * np.sum(_residuals(case, m, primitives, own) ** 2) == pytest.approx(energy, rel=1e-6)


def test_the_inverse_is_that_of_the_matrix(case: Case) -> None:
    trial = case.trials.draw(3, 20.0, "different", "cone")
    m = _take(case, trial, 0.0, 9)
    arm, stack = case.arm, case.several.stack
    kernels._linearize(arm.surfaces, case.memory.found, case.several.rows, m, arm.prior, 3, stack)
    size = 3 * UNKNOWNS
    lower = np.tril(stack.matrix[:size, :size])
    matrix = lower + lower.T - np.diag(np.diag(lower))
    log_det, _ = solve_in_place(stack.matrix, stack.step, size)
    assert log_det == pytest.approx(np.linalg.slogdet(matrix)[1])
    invert(stack, size)
    np.testing.assert_allclose(stack.inverse[:size, :size] @ matrix, np.eye(size), atol=1e-6)


def test_a_known_place_holds_and_gets_sharper(case: Case) -> None:
    trial = case.trials.draw(1, 20.0, "different", "cone")
    m = _take(case, trial, 0.0, 2)
    arm, stack = case.arm, case.several.stack
    sharpness = 1.0 / 0.001**2
    stack.prior_point[0] = stack.point[0]
    stack.prior_sharpness[0] = sharpness * np.eye(3)
    kernels.settle(arm.surfaces, case.memory.found, case.several.rows, m, arm.prior, 1, np.inf, stack)
    assert np.linalg.norm(stack.point[0] - stack.prior_point[0]) < 0.003
    invert(stack, UNKNOWNS)
    assert stack.inverse[4, 4] < 1.0 / sharpness
    assert stack.inverse[5, 5] < 1.0 / sharpness
