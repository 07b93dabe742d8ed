"""Error of the closed forms on many random wrenches, in units of the error that rounding of the wrench alone
may cause."""

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np

from contactsense.benchmarks.solvers import formulas
from contactsense.benchmarks.solvers.sampling import points_on_packed, press, unit
from contactsense.solvers import (
    Box,
    Cone,
    Cylinder,
    Ellipsoid,
    Paraboloid,
    Plane,
    Revolved,
    Solutions,
    Sphere,
    Surface,
    solve_batch,
)

EPS = float(np.finfo(float).eps)
TORSIONS = (0.0, 1e-8, 0.1, 10.0)
"""Torsion relative to force times size; each value is used for an equal number of wrenches."""


GRAZING = 1e-7
"""Cosine between force and normal below which the rounding of the moment decides whether the force enters at
all."""


@dataclass(frozen=True)
class Row:
    """One surface: largest and 99.9 % error, ours and of the printed formula, in ulps times the condition
    number."""

    surface: str
    wrenches: int
    failures: int
    """Number of wrenches whose status is not `OK`, except grazing ones."""
    worst: float
    high: float
    printed: float | None
    """Median error of the printed formula; None if the paper has none."""
    printed_worst: float | None
    printed_failures: int | None
    """Number of NaN results of the printed formula."""


Reference = Callable[[Any, Any], Any]


def points_on(surface: Surface, rng: np.random.Generator, count: int) -> tuple[np.ndarray, np.ndarray]:
    """Random surface points and normals, shapes (N, 3)."""
    if isinstance(surface, Revolved | Box):
        return points_on_packed(surface, rng, count)
    if isinstance(surface, Sphere):
        n = unit(rng.normal(size=(count, 3)))
        return surface.radius * n, n
    if isinstance(surface, Ellipsoid):
        axes = np.array((surface.a, surface.b, surface.c))
        x = unit(rng.normal(size=(count, 3)))
        return x * axes, unit(x / axes)
    if isinstance(surface, Plane):
        c = rng.normal(size=(count, 3))
        c[:, 2] = surface.offset
        return c, np.tile((0.0, 0.0, 1.0), (count, 1))
    if isinstance(surface, Paraboloid):
        x, y = rng.uniform(-1.0, 1.0, size=(2, count)) * np.sqrt(2.0 * surface.depth / surface.k1)
        z = -0.5 * (surface.k1 * x**2 + surface.k2 * y**2)
        n = unit(np.column_stack((surface.k1 * x, surface.k2 * y, np.ones(count))))
        return np.column_stack((x, y, z)), n
    angle = rng.uniform(0.0, 2.0 * np.pi, count)
    e = np.column_stack((np.cos(angle), np.sin(angle), np.zeros(count)))
    # Only up to the apex of the cone.
    z = 0.1 * np.clip(rng.normal(size=(count, 1)), -4.0, 4.0) * (0.0, 0.0, 1.0)
    if isinstance(surface, Cone):
        return (surface.radius - surface.taper * z[:, 2:]) * e + z, unit(
            e + np.array((0.0, 0.0, surface.taper))
        )
    assert isinstance(surface, Cylinder)
    return surface.radius * e + z, e


def reference_of(surface: Surface, number: Callable[[float], Any]) -> Reference | None:
    """The closed form of a surface for numbers made by `number`; None if the body has several patches."""
    if isinstance(surface, Sphere):
        radius = number(surface.radius)
        return lambda f, m: formulas.ellipsoid(f, m, radius, radius, radius)
    if isinstance(surface, Ellipsoid):
        a, b, c = number(surface.a), number(surface.b), number(surface.c)
        return lambda f, m: formulas.ellipsoid(f, m, a, b, c)
    if isinstance(surface, Cylinder):
        radius = number(surface.radius)
        return lambda f, m: formulas.cone(f, m, radius, number(0.0))
    if isinstance(surface, Cone):
        radius, taper = number(surface.radius), number(surface.taper)
        return lambda f, m: formulas.cone(f, m, radius, taper)
    if isinstance(surface, Paraboloid):
        k1, k2 = number(surface.k1), number(surface.k2)
        return lambda f, m: formulas.paraboloid(f, m, k1, k2)
    if isinstance(surface, Plane):
        normal = np.array([[number(float(x))] for x in unit(np.array(surface.normal))])
        offset = number(surface.offset)
        return lambda f, m: formulas.plane(f, m, normal, offset)
    return None


def printed_of(surface: Surface) -> Reference | None:
    """The paper's formula for a surface, if it has one; for planes only if perpendicular to z."""
    if isinstance(surface, Sphere):
        return lambda f, m: formulas.printed_ellipsoid(f, m, *(surface.radius,) * 3)
    if isinstance(surface, Ellipsoid):
        return lambda f, m: formulas.printed_ellipsoid(f, m, surface.a, surface.b, surface.c)
    if isinstance(surface, Cylinder):
        return lambda f, m: formulas.printed_cylinder(f, m, surface.radius)
    if isinstance(surface, Plane):
        return lambda f, m: formulas.printed_plane(f, m, surface.offset)
    return None


SURFACES: dict[str, Surface] = {
    "sphere": Sphere(0.05),
    "ellipsoid 1 : 2 : 4": Ellipsoid(0.05, 0.1, 0.2),
    "needle 1 : 1e-6 : 1e-6": Ellipsoid(1.0, 1e-6, 1e-6),
    "disc 1 : 1 : 1e-6": Ellipsoid(1.0, 1.0, 1e-6),
    "cylinder": Cylinder(0.05),
    "plane": Plane((0.0, 0.0, 1.0), 0.1),
    "cone": Cone(0.1, 0.2),
    "paraboloid": Paraboloid(20.0, 10.0, 0.1),
    "capsule": Revolved(0.2, 0.0, 0.0, 0.06),
    "rounded cylinder": Revolved(0.1, 0.05, 0.05, 0.01),
    "rounded cone": Revolved(0.1, 0.05, 0.03, 0.01),
    "rounded box": Box(0.1, 0.04, 0.07, 0.01),
}


def rows(count: int, tick: Callable[[str], None]) -> Iterator[Row]:
    """Measure all surfaces on `count` wrenches each."""
    extended = np.longdouble
    for name, surface in SURFACES.items():
        tick(name)
        reference = reference_of(surface, extended)
        printed = printed_of(surface)
        errors, printed_errors = [], []
        failures = 0
        for seed, torsion in enumerate(TORSIONS):
            rng = np.random.default_rng(seed)
            share = count // len(TORSIONS)
            contacts = press(rng, *points_on(surface, rng, share), torsion)
            found = solve_batch(surface, contacts.force, contacts.moment)
            cosine = -np.sum(contacts.force * contacts.normal, axis=1)
            cosine /= np.linalg.norm(contacts.force, axis=1)
            failures += int(np.count_nonzero(~found.ok & (cosine > GRAZING)))
            f, m = contacts.force.T, contacts.moment.T
            true = contacts.centroid
            if reference is not None:
                true = reference(f.astype(extended), m.astype(extended)).T
            scale = EPS * _condition(found, contacts.force, contacts.moment, true)
            with np.errstate(all="ignore"):
                errors.append(_relative(found.centroid, true)[found.ok] / scale[found.ok])
                if printed is not None:
                    printed_errors.append(_relative(printed(f, m).T, true) / scale)
        ours = np.concatenate(errors)
        row = Row(name, count, failures, float(ours.max()), float(np.quantile(ours, 0.999)), None, None, None)
        if printed_errors:
            theirs = np.concatenate(printed_errors).astype(float)
            lost = np.isnan(theirs)
            row = Row(
                name,
                count,
                failures,
                row.worst,
                row.high,
                float(np.median(theirs[~lost])),
                float(theirs[~lost].max()),
                int(lost.sum()),
            )
        yield row


def _relative(found: np.ndarray, true: np.ndarray) -> np.ndarray:
    difference = (found - true).astype(float)
    return np.asarray(np.linalg.norm(difference, axis=1) / np.linalg.norm(true.astype(float), axis=1))


def _condition(found: Solutions, force: np.ndarray, moment: np.ndarray, true: np.ndarray) -> np.ndarray:
    lever = np.linalg.norm(moment, axis=1) / np.linalg.norm(force, axis=1)
    distance = np.linalg.norm(true.astype(float), axis=1)
    return np.asarray(1.0 + found.condition * (1.0 + lever / distance))
