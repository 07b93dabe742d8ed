"""Newton's method on smooth bodies: number of steps and failures."""

from collections.abc import Callable, Iterator
from dataclasses import dataclass

import numpy as np
from numba import njit

from contactsense.benchmarks.solvers.sampling import Contacts, press, unit
from contactsense.robots.vectors import vector
from contactsense.solvers import Paraboloid, Superquadric, Surface
from contactsense.solvers.bodies.surface import Problem
from contactsense.solvers.general_convex.general import solve_smooth_counted
from contactsense.solvers.general_convex.implicit_surfaces import Size, evaluate
from contactsense.solvers.general_convex.level_set import SmoothBody
from contactsense.solvers.wrench import Wrench


@dataclass(frozen=True)
class Row:
    """One body under one kind of wrench."""

    surface: str
    wrenches: str
    count: int
    failures: int
    median: float
    p99: float
    most: int
    """Steps of Newton's method."""
    residual: float
    """Largest relative residual."""


BODIES: dict[str, Surface] = {
    "superquadric, exponents 2.5, 3": Superquadric(0.05, 0.07, 0.1, 2.5, 3.0),
    "superquadric, exponents 4, 2": Superquadric(0.05, 0.07, 0.1, 4.0, 2.0),
    "superquadric, exponent 4": Superquadric(0.05, 0.07, 0.1, 4.0, 4.0),
    "superquadric, exponent 8": Superquadric(0.05, 0.07, 0.1, 8.0, 8.0),
    "superquadric, exponents 2, 8": Superquadric(0.05, 0.07, 0.1, 2.0, 8.0),
    "superquadric, exponent 16": Superquadric(0.05, 0.07, 0.1, 16.0, 16.0),
    "paraboloid": Paraboloid(20.0, 10.0, 0.1),
}

HARDEST = ("superquadric, exponents 2, 8", "superquadric, exponent 16")
"""Approximately a cylinder and a box, with sharp edges: these need more steps."""


def smooth_body(surface: Surface) -> SmoothBody:
    """A body as `solve_smooth` takes it."""
    found: Problem = getattr(surface, "newton_problem", surface.problem)()
    body: SmoothBody = found[1][0]
    return body


def points_on(surface: Surface, rng: np.random.Generator, count: int) -> tuple[np.ndarray, np.ndarray]:
    """Random surface points and normals of a smooth body, shapes (N, 3)."""
    size, _, extent, gauge = smooth_body(surface)
    points = rng.normal(size=(count, 3)) * extent
    out = np.empty((count, 6))
    if gauge:
        _onto(size, points, out)
    else:
        x, y = rng.uniform(-1.0, 1.0, size=(2, count)) * np.array(extent[:2])[:, None]
        _, k1, k2, *_ = size
        out[:, :3] = np.column_stack((x, y, -0.5 * (k1 * x**2 + k2 * y**2)))
        out[:, 3:] = unit(np.column_stack((k1 * x, k2 * y, np.ones(count))))
    return out[:, :3].copy(), out[:, 3:].copy()


@njit(error_model="numpy")
def _onto(size: Size, points: np.ndarray, out: np.ndarray) -> None:
    for i in range(points.shape[0]):
        x, y, z = points[i]
        for _ in range(3):
            level = evaluate(size, x, y, z)
            scale = 1.0 + level[0]
            x, y, z = x / scale, y / scale, z / scale
        slope = np.sqrt(level[1] ** 2 + level[2] ** 2 + level[3] ** 2)
        out[i, 0], out[i, 1], out[i, 2] = x, y, z
        out[i, 3], out[i, 4], out[i, 5] = level[1] / slope, level[2] / slope, level[3] / slope


@njit(error_model="numpy")
def _count(
    force: np.ndarray,
    moment: np.ndarray,
    body: SmoothBody,
    status: np.ndarray,
    steps: np.ndarray,
    residual: np.ndarray,
) -> None:
    for i in range(force.shape[0]):
        answer, steps[i] = solve_smooth_counted(Wrench(vector(force[i]), vector(moment[i])), body)
        status[i], residual[i] = answer.status, answer.residual


def _wrenches(surface: Surface, rng: np.random.Generator, count: int) -> Iterator[tuple[str, Contacts]]:
    c, n = points_on(surface, rng, count)
    yield "contacts, friction up to 1, torsion 0.05", press(rng, c, n, 0.05, 1.0)
    yield "any pushing force, torsion 0.05", press(rng, c, n, 0.05)
    yield "any pushing force, torsion 1", press(rng, c, n, 1.0)


def rows(count: int, tick: Callable[[str], None]) -> Iterator[Row]:
    """Measure all bodies on `count` wrenches of each kind."""
    for name, surface in BODIES.items():
        tick(name)
        for kind, contacts in _wrenches(surface, np.random.default_rng(5), count):
            force, moment = contacts.force, contacts.moment
            status = np.empty(len(force), dtype=np.int64)
            steps = np.empty(len(force), dtype=np.int64)
            residual = np.empty(len(force))
            _count(force, moment, smooth_body(surface), status, steps, residual)
            median, p99 = np.quantile(steps, (0.5, 0.99))
            failures = int(np.count_nonzero(status))
            worst = float(residual[status == 0].max())
            yield Row(name, kind, len(force), failures, float(median), float(p99), int(steps.max()), worst)
