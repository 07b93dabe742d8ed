"""Contacts that are known because they were constructed, on every surface that has a solver."""

from collections.abc import Callable
from typing import TypeAlias, TypeVar

import numpy as np

from contactsense.benchmarks.solvers.sampling import Contacts, points_on_packed, press, unit
from contactsense.solvers import (
    Box,
    Capsule,
    Cone,
    Cylinder,
    Ellipsoid,
    Fingertip,
    Paraboloid,
    Plane,
    Polytope,
    Revolved,
    Sphere,
    Superquadric,
    Surface,
    TaperedCapsule,
)
from contactsense.solvers.general_convex.implicit_surfaces import evaluate

Sampler: TypeAlias = Callable[..., tuple[np.ndarray, np.ndarray]]
F = TypeVar("F", bound=Sampler)

POINTS: dict[type, Sampler] = {Revolved: points_on_packed, Box: points_on_packed}
"""Type of a surface -> function (surface, rng, count) that draws surface points and their normals."""


def draw(surface: Surface, rng: np.random.Generator, count: int, torsion: float = 0.5) -> Contacts:
    """Random pushing contacts on a surface, forces of some newtons from all sides.

    `torsion` is the size of the moment about the normal relative to force times the surface's size.
    """
    return press(rng, *POINTS[type(surface)](surface, rng, count), torsion)


def points_on(*kinds: type) -> Callable[[F], F]:
    """Register a sampler of surface points."""

    def register(function: F) -> F:
        POINTS.update(dict.fromkeys(kinds, function))
        return function

    return register


@points_on(Sphere)
def _sphere(surface: Sphere, rng: np.random.Generator, count: int) -> tuple[np.ndarray, np.ndarray]:
    n = unit(rng.normal(size=(count, 3)))
    return surface.radius * n, n


@points_on(Ellipsoid)
def _ellipsoid(surface: Ellipsoid, rng: np.random.Generator, count: int) -> tuple[np.ndarray, np.ndarray]:
    axes = np.array((surface.a, surface.b, surface.c))
    x = unit(rng.normal(size=(count, 3)))
    return x * axes, unit(x / axes)


def _around(rng: np.random.Generator, count: int) -> np.ndarray:
    angle = rng.uniform(0.0, 2.0 * np.pi, count)
    return np.column_stack((np.cos(angle), np.sin(angle), np.zeros(count)))


@points_on(Cylinder)
def _cylinder(surface: Cylinder, rng: np.random.Generator, count: int) -> tuple[np.ndarray, np.ndarray]:
    e = _around(rng, count)
    return surface.radius * e + rng.normal(size=(count, 1)) * (0.0, 0.0, 1.0), e


@points_on(Plane)
def _plane(surface: Plane, rng: np.random.Generator, count: int) -> tuple[np.ndarray, np.ndarray]:
    n = unit(np.array(surface.normal, dtype=float))
    c = rng.normal(size=(count, 3))
    return c - np.outer(c @ n - surface.offset, n), np.tile(n, (count, 1))


@points_on(Capsule, TaperedCapsule)
def _capsule(
    surface: Capsule | TaperedCapsule, rng: np.random.Generator, count: int
) -> tuple[np.ndarray, np.ndarray]:
    half = surface.half
    a, b = (
        (surface.radius, surface.radius)
        if isinstance(surface, Capsule)
        else (surface.radius_a, surface.radius_b)
    )
    lower, upper = np.array((0.0, 0.0, -half)), np.array((0.0, 0.0, half))
    sin_beta = (a - b) / (2.0 * half)
    n = unit(rng.normal(size=(count, 3)))
    c = np.where(n[:, 2:] > sin_beta, upper + b * n, lower + a * n)
    side = _around(rng, count) * np.sqrt(1.0 - sin_beta**2) + (0.0, 0.0, sin_beta)
    share = rng.uniform(size=(count, 1))
    on_side = rng.uniform(size=(count, 1)) < 0.5
    c = np.where(on_side, (1.0 - share) * (lower + a * side) + share * (upper + b * side), c)
    return c, np.where(on_side, side, n)


@points_on(Cone)
def _cone(surface: Cone, rng: np.random.Generator, count: int) -> tuple[np.ndarray, np.ndarray]:
    e = _around(rng, count)
    apex = surface.radius / surface.taper
    z = apex * (1.0 - rng.lognormal(size=(count, 1)))
    n = unit(e + np.array((0.0, 0.0, surface.taper)))
    return (surface.radius - surface.taper * z) * e + z * (0.0, 0.0, 1.0), n


@points_on(Fingertip)
def _fingertip(surface: Fingertip, rng: np.random.Generator, count: int) -> tuple[np.ndarray, np.ndarray]:
    n = unit(rng.normal(size=(count, 3)))
    n[n[:, 2] < 0.0, 2] = 0.0
    n = unit(n)
    c = surface.radius * n
    c[n[:, 2] == 0.0, 2] = -4.0 * surface.radius * rng.uniform(size=np.count_nonzero(n[:, 2] == 0.0))
    return c, n


@points_on(Superquadric)
def _superquadric(
    surface: Superquadric, rng: np.random.Generator, count: int
) -> tuple[np.ndarray, np.ndarray]:
    size = surface.problem()[1][0].size
    c = rng.normal(size=(count, 3)) * (surface.a, surface.b, surface.c)
    for _ in range(3):
        c /= 1.0 + np.array([evaluate(size, *row)[0] for row in c])[:, None]
    return c, unit(np.array([evaluate(size, *row)[1:4] for row in c]))


@points_on(Paraboloid)
def _paraboloid(surface: Paraboloid, rng: np.random.Generator, count: int) -> tuple[np.ndarray, np.ndarray]:
    x, y = rng.uniform(-1.0, 1.0, size=(2, count)) * np.sqrt(surface.depth / surface.k1)
    z = -0.5 * (surface.k1 * x**2 + surface.k2 * y**2)
    n = np.column_stack((surface.k1 * x, surface.k2 * y, np.ones(count)))
    return np.column_stack((x, y, z)), unit(n)


@points_on(Polytope)
def _polytope(surface: Polytope, rng: np.random.Generator, count: int) -> tuple[np.ndarray, np.ndarray]:
    """A third each on faces, edges and vertices."""
    hull = surface.hull
    core, normal = np.empty((count, 3)), np.empty((count, 3))
    for row in range(count):
        if row % 3 == 0:
            face = rng.integers(len(hull.offset))
            faces = np.array([face])
        elif row % 3 == 1:
            line = hull.edge[rng.integers(len(hull.length))]
            middle = line[0] + 1e-3 * hull.length.min() * line[1]
            faces = np.flatnonzero(np.abs(hull.normal @ middle - hull.offset) < 1e-10)
        else:
            corner = hull.vertex[rng.integers(len(hull.vertex))]
            faces = np.flatnonzero(np.abs(hull.normal @ corner - hull.offset) < 1e-10)
        on = np.all(np.abs(hull.vertex @ hull.normal[faces].T - hull.offset[faces]) < 1e-10, axis=1)
        core[row] = rng.dirichlet(np.ones(np.count_nonzero(on))) @ hull.vertex[on]
        normal[row] = unit(rng.dirichlet(np.ones(len(faces))) @ hull.normal[faces])
    return (core + hull.middle) * hull.unit + surface.rounding * normal, normal
