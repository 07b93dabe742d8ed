"""Time per solve of every surface and method, as a ratio to the wrench axis on a sphere, as in the paper's
table 2."""

import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass

import numpy as np

from contactsense.benchmarks.solvers import iterations
from contactsense.benchmarks.solvers.accuracy import points_on as points_on_patch
from contactsense.benchmarks.solvers.sampling import press, unit
from contactsense.solvers import (
    Box,
    Capsule,
    Compound,
    Cone,
    Cylinder,
    Ellipsoid,
    Fingertip,
    Method,
    Paraboloid,
    Plane,
    Polytope,
    Revolved,
    Sphere,
    Superquadric,
    Surface,
    TaperedCapsule,
)
from contactsense.solvers.bodies.surface import Problem
from contactsense.solvers.general_convex.gradient_descent import descend
from contactsense.solvers.solve_wrench import problem_of
from contactsense.solvers.solver_batch import compiled_rows
from contactsense.solvers.wrench import Wrench, wrench_of

_ROUNDS = 12
_PARTS = 20


@dataclass(frozen=True)
class Row:
    """One surface and method."""

    surface: str
    method: Method
    patches: int
    nanoseconds: float
    """Time per solve, inside compiled code."""
    ratio: float
    """Ratio to the wrench axis on a sphere."""


_STONE = unit(np.random.default_rng(1).normal(size=(30, 3))) * (0.1, 0.05, 0.07)

SURFACES: dict[str, tuple[Surface, int]] = {
    "sphere": (Sphere(0.05), 1),
    "ellipsoid": (Ellipsoid(0.05, 0.07, 0.1), 1),
    "cylinder": (Cylinder(0.05), 1),
    "cone": (Cone(0.1, 0.2), 1),
    "plane": (Plane((0.0, 0.0, 1.0), 0.1), 1),
    "fingertip": (Fingertip(0.05), 2),
    "capsule": (Capsule(0.2, 0.06), 3),
    "tapered capsule": (TaperedCapsule(0.2, 0.06, 0.05), 3),
    "rounded cylinder": (Revolved(0.1, 0.05, 0.05, 0.01), 5),
    "rounded cone": (Revolved(0.1, 0.05, 0.03, 0.01), 5),
    "rounded box": (Box(0.1, 0.04, 0.07, 0.01), 26),
    "rounded polytope, 30 vertices": (Polytope(_STONE, 0.005), 30 + 56 + 84),
    "compound cylinder, sharp rims": (
        Compound.common([Cylinder(0.05), *(Plane((0.0, 0.0, side), 0.08) for side in (1.0, -1.0))], 0.1),
        3,
    ),
    "superquadric, exponent 4": (Superquadric(0.05, 0.07, 0.1), 1),
    "paraboloid": (Paraboloid(20.0, 10.0, 0.1), 1),
}


def _wrenches(surface: Surface, count: int) -> np.ndarray:
    rng = np.random.default_rng(2)
    stand_in: dict[type, Surface] = {
        Fingertip: Sphere(0.05),
        Capsule: Revolved(0.2, 0.0, 0.0, 0.06),
        TaperedCapsule: Revolved(0.2, 0.0, 0.0, 0.055),
        Polytope: Ellipsoid(0.1, 0.05, 0.07),
        Compound: Revolved(0.079, 0.049, 0.049, 0.001),
    }
    there = stand_in.get(type(surface), surface)
    smooth = isinstance(there, Superquadric | Paraboloid)
    c, n = (iterations.points_on if smooth else points_on_patch)(there, rng, count)
    contacts = press(rng, c, n, 0.02, 1.0)
    return np.hstack((contacts.force, contacts.moment))


Job = tuple[Problem, np.ndarray]
"""Timed solvers and their wrenches."""


def times_of(*jobs: Job) -> list[float]:
    """Times per solve [ns].

    The jobs run alternately in small parts, and for each part the shortest time of several rounds counts, so
    that other work on the machine does not affect the result.
    """
    best = np.full((len(jobs), _PARTS), np.inf)
    for _ in range(_ROUNDS):
        for part in range(_PARTS):
            for i, ((kernel, size), wrenches) in enumerate(jobs):
                solve = compiled_rows(kernel)
                some = wrenches[part::_PARTS].copy()
                status = np.empty(len(some), dtype=np.int64)
                out = np.empty((len(some), 9))
                start = time.perf_counter()
                solve(some, size, status, out)
                best[i, part] = min(best[i, part], 1e9 * (time.perf_counter() - start) / len(some))
    return [float(mean) for mean in best.mean(axis=1)]


def base(count: int) -> Job:
    """Reference time: the wrench axis on a sphere."""
    sphere = Sphere(0.05)
    return sphere.line_problem(), _wrenches(sphere, count)


def rows(count: int, tick: Callable[[str], None]) -> Iterator[Row]:
    """Measure all surfaces and methods on `count` wrenches: contacts with friction up to 1 and a little
    torsion."""
    compared = base(count)
    methods: tuple[Method, ...] = ("wrench_axis", "exact", "newton", "descent")
    for name, (surface, patches) in SURFACES.items():
        tick(name)
        wrenches = _wrenches(surface, count)
        for method in methods:
            try:
                problem = problem_of(surface, method)
            except ValueError:
                continue
            if method == "newton" and problem[0] is surface.problem()[0]:
                continue
            some = wrenches[: max(count // 100, 1)] if method == "descent" else wrenches
            taken, unit_of_time = times_of((problem, some), compared)
            yield Row(name, method, patches, taken, taken / unit_of_time)


def table_2(count: int) -> tuple[float, float, float]:
    """Our counterpart of the paper's table 2.

    Returns:
        Time of the ellipsoid's closed form over the wrench axis', of one step of gradient descent over the
        closed form's, and the median number of steps to one part in 10^6 while the contact moves slowly over
        a sphere.
    """
    sphere = Sphere(0.05)
    ball = Ellipsoid(0.05, 0.05, 0.05)
    wrenches = _wrenches(sphere, count)
    axis, exact = times_of(base(count), (ball.problem(), wrenches))
    steps: list[int] = []
    start, k = (0.0, 0.0, 1.0), 0.0
    for i in range(2000):
        # In units of the radius and of the force: a contact that moves by a hundredth of the radius.
        n = unit(np.array((np.sin(0.01 * i), 0.3 * np.sin(0.007 * i), np.cos(0.01 * i))))
        f = unit(-n + 0.3 * unit(np.cross(n, (0.3, 1.0, 0.2))))
        m = np.cross(n, f) + 0.05 * np.sin(0.01 * i) * n
        taken, start, k, _ = descend(wrench_of(f, m), (1.0, 1.0, 1.0), start, k, 1000, 1e-6)
        steps.append(taken)
    # Many steps in one call: on a long ellipsoid the iteration does not end early.
    step = float("inf")
    wrench = Wrench((0.3, -0.5, -0.8), (0.1, 0.2, -0.3))
    for _ in range(_ROUNDS):
        begin = time.perf_counter()
        taken, *_ = descend(wrench, (0.1, 0.3, 1.0), (0.0, 0.2, 0.6), 0.1, 20000, 0.0)
        step = min(step, (time.perf_counter() - begin) / taken)
    return exact / axis, 1e9 * step / exact, float(np.median(steps))
