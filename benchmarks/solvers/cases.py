"""Hard cases: contacts for which formulas fail. The exact result of each is known, from mpmath at 50 digits
or by its status."""

from collections.abc import Iterator
from dataclasses import dataclass, replace
from itertools import chain

import numpy as np

from contactsense.solvers import (
    Box,
    Capsule,
    Cone,
    Cylinder,
    Ellipsoid,
    Paraboloid,
    Placed,
    Plane,
    Polytope,
    Revolved,
    Sphere,
    Status,
    Superquadric,
    Surface,
)


@dataclass(frozen=True)
class Case:
    """A wrench on a surface, and the expected result."""

    group: str
    name: str
    surface: Surface
    force: tuple[float, float, float]
    moment: tuple[float, float, float]
    status: Status = Status.OK
    centroid: tuple[float, float, float] | None = None
    """Where the contact was constructed, for surfaces without a reference formula."""
    same: Surface | None = None
    """The same body with a reference, for a surface without one."""
    decided_by_rounding: bool = False
    """Whether the force is so nearly tangential that the rounding of its moment decides whether it enters,
    touches or misses."""


Vector = tuple[float, float, float]

_ROOT = 1e-7
"""Squares of cosines below this are negligible compared with one."""


def _vector(values: np.ndarray) -> Vector:
    return float(values[0]), float(values[1]), float(values[2])


def _contact(
    group: str, name: str, surface: Surface, c: Vector, n: Vector, f: Vector, xi: float = 0.0
) -> Case:
    moment = np.cross(c, f) + xi * np.array(n)
    direction = np.array(f) / np.abs(f).max()
    cosine = -float(np.dot(n, direction)) / float(np.linalg.norm(direction))
    return Case(
        group,
        name,
        surface,
        f,
        _vector(moment),
        centroid=c,
        decided_by_rounding=cosine < _ROOT,
    )


def _on_ellipsoid(axes: Vector, direction: Vector) -> tuple[Vector, Vector]:
    x = np.array(direction) / np.linalg.norm(direction)
    n = x / np.array(axes)
    return _vector(x * np.array(axes)), _vector(n / np.linalg.norm(n))


def _torsion() -> Iterator[Case]:
    sizes = (
        0.0,
        1e-320,
        1e-300,
        1e-200,
        1e-100,
        1e-30,
        1e-16,
        1e-8,
        1e-3,
        1.0,
        1e3,
        1e8,
        1e16,
        1e30,
        1e100,
        1e140,
    )
    for axes in ((0.05, 0.05, 0.05), (0.05, 0.1, 0.2)):
        c, n = _on_ellipsoid(axes, (0.5, -0.3, 0.8))
        body: Surface = Sphere(axes[0]) if axes[0] == axes[2] else Ellipsoid(*axes)
        for xi in sizes:
            # A pure force whose moment is exact in floating point, so that the torsion is exact too.
            yield Case(
                "torsion", f"{type(body).__name__} {xi:g}", body, (0.0, 0.0, -8.0), (0.25, 0.0, -xi / 8.0)
            )
            if 1e-8 <= xi <= 1e8:
                yield _contact(
                    "torsion", f"{type(body).__name__} oblique {xi:g}", body, c, n, (-3.0, 4.0, -5.0), xi
                )
    for xi in sizes:
        dish = Paraboloid(4.0, 16.0, 1.0)
        yield Case("torsion", f"Paraboloid {xi:g}", dish, (0.0, 0.0, -8.0), (0.25, 0.0, -xi / 8.0))
        if 1e-8 <= xi <= 1e8:
            c, n = (0.5, -0.25, -1.0), (2.0 / 21.0**0.5, -4.0 / 21.0**0.5, 1.0 / 21.0**0.5)
            yield _contact("torsion", f"Paraboloid oblique {xi:g}", dish, c, n, (-3.0, 4.0, 5.0), xi)


def _grazing() -> Iterator[Case]:
    for power in range(0, 13, 2):
        cosine = 10.0**-power
        along = float(np.sqrt(1.0 - cosine * cosine))
        # At the top of the body, where only that fraction of the force presses down.
        force = (7.0 * along, 0.0, -7.0 * cosine)
        for xi in (0.0, 1e-6, 0.1):
            label = f"cos 1e-{power}, torsion {xi:g}"
            yield _contact(
                "grazing", f"sphere {label}", Sphere(0.05), (0.0, 0.0, 0.05), (0.0, 0.0, 1.0), force, xi
            )
            body = Ellipsoid(0.05, 0.1, 0.2)
            yield _contact("grazing", f"ellipsoid {label}", body, (0.0, 0.0, 0.2), (0.0, 0.0, 1.0), force, xi)
            floor = Plane((0.0, 0.0, 1.0), 0.2)
            yield _contact("grazing", f"plane {label}", floor, (0.1, 0.0, 0.2), (0.0, 0.0, 1.0), force, xi)
            sideways = (-7.0 * cosine, 7.0 * along * 0.6, 7.0 * along * 0.8)
            pipe = Cylinder(0.05)
            yield _contact(
                "grazing", f"cylinder {label}", pipe, (0.05, 0.0, 0.1), (1.0, 0.0, 0.0), sideways, xi
            )
            dish = Placed(Paraboloid(4.0, 16.0, 1.0), np.array((0.0, 0.0, 0.25)), np.eye(3))
            yield _contact(
                "grazing", f"paraboloid {label}", dish, (0.0, 0.0, 0.25), (0.0, 0.0, 1.0), force, xi
            )


def _along_the_axis() -> Iterator[Case]:
    pipe = Cylinder(0.05)
    yield Case("axis", "force along the axis", pipe, (0.0, 0.0, 5.0), (0.1, 0.0, 0.0), Status.PARALLEL)
    for power in (3, 6, 9, 12, 15):
        tilt = 10.0**-power
        force = (-5.0 * tilt, 0.0, 5.0)
        yield _contact("axis", f"tilt 1e-{power}", pipe, (0.05, 0.0, 0.1), (1.0, 0.0, 0.0), force)
    floor = Plane((0.0, 0.0, 1.0), 0.1)
    yield Case("axis", "force in the plane", floor, (1.0, 2.0, 0.0), (0.1, 0.0, 0.3), Status.PARALLEL)


def _missing() -> Iterator[Case]:
    up = float(np.nextafter(0.5, 1.0))
    down = float(np.nextafter(0.5, 0.0))
    for body in (Sphere(0.5), Ellipsoid(0.5, 0.25, 2.0), Cylinder(0.5)):
        name = type(body).__name__
        for label, at, status in (
            ("one ulp inside", down, Status.OK),
            ("tangent", 0.5, Status.TANGENT),
            ("one ulp outside", up, Status.MISS),
            ("far outside", 50.0, Status.MISS),
        ):
            yield Case("missing", f"{name}, {label}", body, (0.0, 1.0, 0.0), (0.0, 0.0, at), status)
    for solid in (
        Capsule(0.2, 0.5),
        Box(0.3, 0.3, 0.3, 0.2),
        Revolved(0.3, 0.3, 0.3, 0.2),
        Superquadric(0.5, 0.5, 0.5),
    ):
        name = type(solid).__name__
        yield Case("missing", f"{name}, far outside", solid, (0.0, 1.0, 0.0), (0.0, 0.0, 50.0), Status.MISS)


def _thin() -> Iterator[Case]:
    for power in (1, 2, 3, 4, 5, 6):
        thin = 10.0**-power
        for label, axes in (("needle", (1.0, thin, thin)), ("disc", (1.0, 1.0, thin))):
            for direction in ((1.0, 0.0, 0.0), (0.0, 0.0, 1.0), (0.5, -0.3, 0.8), (1.0, 1e-4, 1e-4)):
                c, n = _on_ellipsoid(axes, direction)
                for xi in (0.0, 1e-9, 0.01):
                    force = _vector(-np.array(n) * 5.0 + np.array((0.4, -0.3, 0.2)))
                    name = f"{label} 1e-{power} towards {direction}, torsion {xi:g}"
                    yield _contact("thin", name, Ellipsoid(*axes), c, n, force, xi)


def _units() -> Iterator[Case]:
    c, n = _on_ellipsoid((0.05, 0.1, 0.2), (0.5, -0.3, 0.8))
    force = np.array((-3.0, 4.0, -5.0))
    for label, length, newton in (
        ("mm", 1e3, 1.0),
        ("nN", 1.0, 1e-9),
        ("MN", 1.0, 1e6),
        ("um and GN", 1e6, 1e9),
        ("light years and yN", 1e-16, 1e-24),
        ("1e-300 N", 1.0, 1e-300),
        ("1e300 N", 1.0, 1e300),
    ):
        body = Ellipsoid(0.05 * length, 0.1 * length, 0.2 * length)
        at = _vector(np.array(c) * length)
        yield _contact("units", label, body, at, n, _vector(force * newton), 0.05 * length * newton)


def _far() -> Iterator[Case]:
    force = np.array((-3.0, 4.0, -5.0))
    for power in (1, 3, 6, 9):
        origin = np.array((10.0**power, -0.5 * 10.0**power, 0.25 * 10.0**power))
        body = Placed(Sphere(0.05), origin, np.eye(3))
        # The reference uses the rounded moment; the condition number accounts for its rounding.
        at = origin + 0.05 * np.array((0.6, 0.0, 0.8))
        yield Case("far", f"sphere at 1e{power} m", body, _vector(force), _vector(np.cross(at, force)))


def _seams() -> Iterator[Case]:
    for nudge in (0.0, 1e-18, 1e-16, 1e-12, 1e-8):
        capsule = Capsule(0.2, 0.05)
        force = (-5.0, 1.0, -2.0)
        yield _contact(
            "seams",
            f"capsule below {nudge:g}",
            capsule,
            (0.05, 0.0, 0.2 - nudge),
            (1.0, 0.0, 0.0),
            force,
            0.01,
        )
        n = _vector(np.array((1.0, 0.0, nudge)) / np.hypot(1.0, nudge))
        above = (0.05 * n[0], 0.0, 0.2 + 0.05 * n[2])
        yield _contact("seams", f"capsule above {nudge:g}", capsule, above, n, force, 0.01)
        box = Box(0.1, 0.2, 0.3, 0.05)
        yield _contact(
            "seams", f"box face {nudge:g}", box, (0.15, 0.2 - nudge, 0.1), (1.0, 0.0, 0.0), force, 0.01
        )
        n = _vector(np.array((1.0, nudge, 0.0)) / np.hypot(1.0, nudge))
        edge = (0.1 + 0.05 * n[0], 0.2 + 0.05 * n[1], 0.1)
        yield _contact("seams", f"box edge {nudge:g}", box, edge, n, force, 0.01)
        drum = Revolved(0.1, 0.2, 0.2, 0.05)
        down = (-1.0, 1.0, -6.0)
        yield _contact(
            "seams", f"drum cap {nudge:g}", drum, (0.2 - nudge, 0.0, 0.15), (0.0, 0.0, 1.0), down, 0.01
        )
        n = _vector(np.array((nudge, 0.0, 1.0)) / np.hypot(1.0, nudge))
        rim = (0.2 + 0.05 * n[0], 0.0, 0.1 + 0.05 * n[2])
        yield _contact("seams", f"drum rim {nudge:g}", drum, rim, n, down, 0.01)


def _edges() -> Iterator[Case]:
    corners = [(x, y, z) for x in (-0.1, 0.1) for y in (-0.2, 0.2) for z in (-0.3, 0.3)]
    slant = np.array((1.0, 2.0, 2.0)) / 3.0
    for power in (2, 4, 6, 8, 10, 12):
        r = 10.0**-power
        at = _vector(np.array((0.1, 0.2, 0.3)) + r * slant)
        force = (-2.0, -3.0, -4.0)
        for body in (Box(0.1, 0.2, 0.3, r), Polytope(corners, r)):
            name = f"{type(body).__name__} corner, rounding 1e-{power}"
            case = _contact("edges", name, body, at, _vector(slant), force, 0.3 * r)
            yield replace(case, same=Box(0.1, 0.2, 0.3, r))
        n = np.array((0.6, 0.8, 0.0))
        edge = _vector(np.array((0.1, 0.2, 0.05)) + r * n)
        yield _contact(
            "edges", f"box edge, rounding 1e-{power}", Box(0.1, 0.2, 0.3, r), edge, _vector(n), force
        )
        rim = _vector(np.array((0.2, 0.0, 0.1)) + r * np.array((0.6, 0.0, 0.8)))
        drum = Revolved(0.1, 0.2, 0.2, r)
        yield _contact("edges", f"rim, rounding 1e-{power}", drum, rim, (0.6, 0.0, 0.8), force, 0.3 * r)
    sharp = Box(0.1, 0.2, 0.3, 0.0)
    yield _contact(
        "edges", "face of a sharp box", sharp, (0.05, 0.1, 0.3), (0.0, 0.0, 1.0), (1.0, -2.0, -3.0), 0.01
    )
    moment = np.cross((0.1, 0.2, 0.3), (-1.0, -2.0, -3.0)) + 0.001
    yield Case(
        "edges",
        "corner of a sharp box, with torsion",
        sharp,
        (-1.0, -2.0, -3.0),
        _vector(moment),
        Status.SHARP,
    )


def _bad() -> Iterator[Case]:
    bodies = (
        Sphere(0.05),
        Ellipsoid(0.05, 0.1, 0.2),
        Cylinder(0.05),
        Cone(0.05, 0.3),
        Plane((0.0, 0.0, 1.0), 0.1),
        Capsule(0.2, 0.05),
        Revolved(0.1, 0.04, 0.02, 0.01),
        Box(0.1, 0.2, 0.3, 0.05),
        Superquadric(0.05, 0.1, 0.2),
    )
    for body in bodies:
        name = type(body).__name__
        yield Case("bad input", f"{name}, NaN", body, (np.nan, 0.0, 1.0), (0.1, 0.0, 0.0), Status.NOT_FINITE)
        yield Case(
            "bad input", f"{name}, infinite", body, (0.0, 0.0, 1.0), (np.inf, 0.0, 0.0), Status.NOT_FINITE
        )
        yield Case("bad input", f"{name}, no force", body, (0.0, 0.0, 0.0), (0.1, 0.0, 0.0), Status.NO_FORCE)
    for tiny in (5e-324, 1e-310):
        yield Case(
            "bad input", f"sphere, subnormal force {tiny:g}", Sphere(0.5), (0.0, 0.0, -tiny), (0.0, 0.0, 0.0)
        )


def catalogue() -> list[Case]:
    """All hard cases, group by group."""
    groups = (_torsion, _grazing, _along_the_axis, _missing, _thin, _units, _far, _seams, _edges, _bad)
    return list(chain.from_iterable(group() for group in groups))
