"""Patches of surfaces as level sets in mpmath: the references of the sweep.

Nothing here is shared with the solvers. Numbers are those of mpmath; the modules that need it import it when
they are used, because it is a test dependency.
"""

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import singledispatch
from importlib import import_module
from typing import Any

import numpy as np

from contactsense.solvers import (
    Box,
    Capsule,
    Cone,
    Cylinder,
    Ellipsoid,
    Fingertip,
    Paraboloid,
    Placed,
    Plane,
    Revolved,
    Sphere,
    Superquadric,
    Surface,
    TaperedCapsule,
)

DIGITS = 50
Number = Any
Vector = list[Number]
Level = tuple[Number, Vector, list[Vector]]
"""Value, gradient and Hessian of a function that is zero on the surface and positive outside."""


def numbers() -> Any:
    """mpmath at `DIGITS` digits.

    Raises:
        ModuleNotFoundError: mpmath is not installed.
    """
    mpmath = import_module("mpmath")
    mpmath.mp.dps = DIGITS
    return mpmath


def vector(values: Any) -> Vector:
    """The exact values of three floats, or of three numbers of mpmath."""
    mpf = numbers().mpf
    return [x if isinstance(x, mpf) else mpf(float(x)) for x in values]


@dataclass(frozen=True)
class Patch:
    """A smooth part of a surface."""

    name: str
    level: Callable[[Vector], Level]
    """The function at a point."""
    draw: Callable[[np.random.Generator], Vector]
    """A random point of the patch."""
    holds: Callable[[Vector, Vector], bool]
    """Whether a point of the complete level set, with its outward normal, belongs to the patch."""


def _everywhere(c: Vector, n: Vector) -> bool:
    return True


def _unit(rng: np.random.Generator, count: int) -> Vector:
    mp = numbers()
    x = [mp.mpf(float(value)) for value in rng.normal(size=count)]
    size = mp.sqrt(sum(value * value for value in x))
    return [value / size for value in x]


def _diagonal(values: Vector) -> list[Vector]:
    return [[values[i] if i == j else 0 for j in range(3)] for i in range(3)]


def _quadric(center: Vector, square: Vector, linear: Vector, constant: Number) -> Callable[[Vector], Level]:
    """(x . diag(square) x) / 2 + linear . x + constant, with x = c - center."""

    def level(c: Vector) -> Level:
        x = [c[i] - center[i] for i in range(3)]
        value = sum(square[i] * x[i] * x[i] / 2 + linear[i] * x[i] for i in range(3)) + constant
        return value, [square[i] * x[i] + linear[i] for i in range(3)], _diagonal(square)

    return level


def _ellipsoid(center: Vector, axes: Vector) -> Patch:
    half = numbers().mpf(1) / 2
    level = _quadric(center, [1 / (a * a) for a in axes], [0, 0, 0], -half)

    def draw(rng: np.random.Generator) -> Vector:
        x = _unit(rng, 3)
        return [center[i] + axes[i] * x[i] for i in range(3)]

    return Patch("surface", level, draw, _everywhere)


def _ball(name: str, at: Number, r: Number, low: Number, high: Number) -> Patch:
    """The ball about (0, 0, at), where the normal's z component is between two numbers."""
    mp = numbers()
    zero = mp.mpf(0)
    level = _quadric([zero, zero, at], [mp.mpf(1)] * 3, [0, 0, 0], -r * r / 2)

    def draw(rng: np.random.Generator) -> Vector:
        e = _unit(rng, 2)
        nz = low + (high - low) * mp.mpf(float(rng.uniform()))
        across = mp.sqrt(1 - nz * nz)
        return [r * across * e[0], r * across * e[1], at + r * nz]

    return Patch(name, level, draw, lambda c, n: bool(low <= n[2] <= high))


def _cone(name: str, radius: Number, taper: Number, low: Number, high: Number) -> Patch:
    """The cone of radius `radius` - `taper` z between two heights."""
    mp = numbers()

    def level(c: Vector) -> Level:
        rho = radius - taper * c[2]
        return (
            (c[0] ** 2 + c[1] ** 2 - rho**2) / 2,
            [c[0], c[1], taper * rho],
            _diagonal([mp.mpf(1), mp.mpf(1), -(taper**2)]),
        )

    def draw(rng: np.random.Generator) -> Vector:
        e = _unit(rng, 2)
        z = low + (high - low) * mp.mpf(float(rng.uniform()))
        rho = radius - taper * z
        return [rho * e[0], rho * e[1], z]

    return Patch(name, level, draw, lambda c, n: bool(low <= c[2] <= high and radius > taper * c[2]))


def _torus(name: str, at: Number, ring: Number, r: Number, low: Number, high: Number) -> Patch:
    """The outer half of a torus about z, where the normal's z component is between two numbers."""
    mp = numbers()

    def level(c: Vector) -> Level:
        x, y, z = c[0], c[1], c[2] - at
        rho = mp.sqrt(x * x + y * y)
        e = [x / rho, y / rho]
        # With s = rho - ring: (s^2 + z^2 - r^2) / 2.
        s = rho - ring
        hess = [[s / rho * ((i == j) - e[i] * e[j]) + e[i] * e[j] for j in range(2)] + [0] for i in range(2)]
        return (s * s + z * z - r * r) / 2, [s * e[0], s * e[1], z], [*hess, [0, 0, mp.mpf(1)]]

    def draw(rng: np.random.Generator) -> Vector:
        e = _unit(rng, 2)
        nz = low + (high - low) * mp.mpf(float(rng.uniform()))
        rho = ring + r * mp.sqrt(1 - nz * nz)
        return [rho * e[0], rho * e[1], at + r * nz]

    return Patch(
        name,
        level,
        draw,
        lambda c, n: bool(low <= n[2] <= high and n[0] * c[0] + n[1] * c[1] >= 0),
    )


def _superquadric(body: Superquadric) -> Patch:
    mp = numbers()
    axes, p, q = vector((body.a, body.b, body.c)), mp.mpf(body.p), mp.mpf(body.q)

    def level(c: Vector) -> Level:
        size = [abs(c[i]) / axes[i] for i in range(3)]
        sign = [(1 if c[i] >= 0 else -1) / axes[i] for i in range(3)]
        flat = size[0] ** p + size[1] ** p
        outer = q / p * flat ** (q / p - 1) if flat > 0 else mp.mpf(p == q)
        bend = q / p * (q / p - 1) * flat ** (q / p - 2) if flat > 0 and p != q else mp.mpf(0)
        slope = [p * size[i] ** (p - 1) * sign[i] for i in range(2)]
        hess = [[bend * slope[i] * slope[j] for j in range(2)] + [0] for i in range(2)]
        for i in range(2):
            hess[i][i] += outer * p * (p - 1) * size[i] ** (p - 2) / axes[i] ** 2
        last = q * (q - 1) * size[2] ** (q - 2) / axes[2] ** 2
        return (
            flat ** (q / p) + size[2] ** q - 1,
            [outer * slope[0], outer * slope[1], q * size[2] ** (q - 1) * sign[2]],
            [*hess, [0, 0, last]],
        )

    def draw(rng: np.random.Generator) -> Vector:
        x = _unit(rng, 3)
        size = ((abs(x[0]) ** p + abs(x[1]) ** p) ** (q / p) + abs(x[2]) ** q) ** (1 / q)
        return [axes[i] * x[i] / size for i in range(3)]

    return Patch("surface", level, draw, _everywhere)


def _paraboloid(body: Paraboloid) -> Patch:
    mp = numbers()
    k1, k2, depth = mp.mpf(body.k1), mp.mpf(body.k2), mp.mpf(body.depth)
    level = _quadric([mp.mpf(0)] * 3, [k1, k2, mp.mpf(0)], [0, 0, mp.mpf(1)], mp.mpf(0))

    def draw(rng: np.random.Generator) -> Vector:
        x, y = (mp.mpf(float(value)) * mp.sqrt(2 * depth) for value in rng.uniform(-1.0, 1.0, 2))
        x, y = x / mp.sqrt(k1), y / mp.sqrt(k2)
        return [x, y, -(k1 * x * x + k2 * y * y) / 2]

    return Patch("surface", level, draw, _everywhere)


def _plane(body: Plane) -> Patch:
    mp = numbers()
    n = vector(body.normal)
    size = mp.sqrt(sum(value * value for value in n))
    n = [value / size for value in n]
    offset = mp.mpf(float(body.offset))
    level = _quadric([mp.mpf(0)] * 3, [mp.mpf(0)] * 3, n, -offset)

    def draw(rng: np.random.Generator) -> Vector:
        c = vector(rng.normal(size=3))
        over = sum(c[i] * n[i] for i in range(3)) - offset
        return [c[i] - over * n[i] for i in range(3)]

    return Patch("surface", level, draw, _everywhere)


def _box(body: Box) -> Iterator[Patch]:
    """Faces, edges and corners: the normal has one, two or three components."""
    mp = numbers()
    half, r = vector((body.bx, body.by, body.bz)), mp.mpf(float(body.rounding))
    for k in range(27):
        sign = [k // 3**i % 3 - 1 for i in range(3)]
        curved = [i for i in range(3) if sign[i] != 0]
        if not curved or (body.rounding == 0.0 and len(curved) > 1):
            continue
        center = [sign[i] * half[i] for i in range(3)]
        if len(curved) == 1:
            linear = [mp.mpf(value) for value in sign]
            level = _quadric(center, [mp.mpf(0)] * 3, linear, -r)
        else:
            level = _quadric(center, [mp.mpf(value != 0) for value in sign], [0, 0, 0], -r * r / 2)

        def draw(
            rng: np.random.Generator, sign: list[int] = sign, curved: list[int] = curved, o: Vector = center
        ) -> Vector:
            n = _unit(rng, len(curved))
            c = [half[i] * mp.mpf(float(rng.uniform(-1.0, 1.0))) for i in range(3)]
            for i, component in zip(curved, n, strict=True):
                c[i] = o[i] + r * sign[i] * abs(component)
            return c

        def holds(c: Vector, n: Vector, sign: list[int] = sign) -> bool:
            return all(n[i] * sign[i] > 0 if sign[i] != 0 else abs(c[i]) <= half[i] for i in range(3))

        yield Patch(("face", "edge", "corner")[len(curved) - 1], level, draw, holds)


def _tapered(half: Number, a: Number, b: Number) -> Iterator[Patch]:
    """The convex hull of two balls on z."""
    mp = numbers()
    sin_beta = (a - b) / (2 * half)
    cos_beta = mp.sqrt(1 - sin_beta**2)
    yield _cone(
        "side", (a + b) / (2 * cos_beta), sin_beta / cos_beta, a * sin_beta - half, b * sin_beta + half
    )
    yield _ball("lower ball", -half, a, mp.mpf(-1), sin_beta)
    yield _ball("upper ball", half, b, sin_beta, mp.mpf(1))


def _revolved(body: Revolved) -> Iterator[Patch]:
    mp = numbers()
    half, lower, upper, r = (mp.mpf(float(x)) for x in (body.half, body.lower, body.upper, body.rounding))
    zero = mp.mpf(0)
    length = mp.sqrt(4 * half**2 + (lower - upper) ** 2)
    cos_beta, sin_beta = (2 * half / length, (lower - upper) / length) if length > 0 else (mp.mpf(1), zero)
    if half > 0:
        taper = sin_beta / cos_beta
        radius = (lower + upper) / 2 + r / cos_beta
        yield _cone("side", radius, taper, r * sin_beta - half, r * sin_beta + half)
    for sign, ring in ((1, upper), (-1, lower)):
        low, high = (sin_beta, mp.mpf(1)) if sign > 0 else (mp.mpf(-1), sin_beta)
        if ring > 0:
            yield _cap(sign, half + r, ring)
            yield _torus("rim", sign * half, ring, r, low, high)
        else:
            yield _ball("ball", sign * half, r, low, high)


def _cap(sign: int, height: Number, ring: Number) -> Patch:
    mp = numbers()
    level = _quadric([mp.mpf(0)] * 3, [mp.mpf(0)] * 3, [0, 0, mp.mpf(sign)], -height)

    def draw(rng: np.random.Generator) -> Vector:
        e = _unit(rng, 2)
        rho = ring * mp.sqrt(mp.mpf(float(rng.uniform())))
        return [rho * e[0], rho * e[1], sign * height]

    return Patch("cap", level, draw, lambda c, n: bool(c[0] ** 2 + c[1] ** 2 <= ring**2))


@singledispatch
def patches(surface: Surface) -> list[Patch]:
    """The patches of a surface; none for one that has no reference."""
    return []


@patches.register
def _(surface: Placed) -> list[Patch]:
    return patches(surface.surface)


@patches.register
def _(surface: Sphere) -> list[Patch]:
    mp = numbers()
    return [_ellipsoid([mp.mpf(0)] * 3, [mp.mpf(surface.radius)] * 3)]


@patches.register
def _(surface: Ellipsoid) -> list[Patch]:
    return [_ellipsoid([numbers().mpf(0)] * 3, vector((surface.a, surface.b, surface.c)))]


@patches.register
def _(surface: Cylinder) -> list[Patch]:
    mp = numbers()
    radius = mp.mpf(surface.radius)
    return [_cone("surface", radius, mp.mpf(0), -4 * radius, 4 * radius)]


@patches.register
def _(surface: Cone) -> list[Patch]:
    mp = numbers()
    radius, taper = mp.mpf(surface.radius), mp.mpf(surface.taper)
    apex = radius / taper
    return [_cone("surface", radius, taper, *sorted((apex, apex - 3 * abs(apex) * mp.sign(taper))))]


@patches.register
def _(surface: Plane) -> list[Patch]:
    return [_plane(surface)]


@patches.register
def _(surface: Paraboloid) -> list[Patch]:
    return [_paraboloid(surface)]


@patches.register
def _(surface: Superquadric) -> list[Patch]:
    return [_superquadric(surface)]


@patches.register
def _(surface: Capsule) -> list[Patch]:
    mp = numbers()
    return list(_tapered(mp.mpf(surface.half), mp.mpf(surface.radius), mp.mpf(surface.radius)))


@patches.register
def _(surface: TaperedCapsule) -> list[Patch]:
    mp = numbers()
    return list(_tapered(*(mp.mpf(x) for x in (surface.half, surface.radius_a, surface.radius_b))))


@patches.register
def _(surface: Fingertip) -> list[Patch]:
    mp = numbers()
    zero, radius = mp.mpf(0), mp.mpf(surface.radius)
    return [_cone("side", radius, zero, -4 * radius, zero), _ball("tip", zero, radius, zero, mp.mpf(1))]


@patches.register
def _(surface: Revolved) -> list[Patch]:
    return list(_revolved(surface))


@patches.register
def _(surface: Box) -> list[Patch]:
    return list(_box(surface))
