"""Wrenches near the seams between patches: exactly one contact each, no gap and no duplicate."""

from collections.abc import Callable, Iterator
from dataclasses import dataclass

import numpy as np

from contactsense.benchmarks.solvers.sampling import press, unit
from contactsense.solvers import (
    Box,
    Capsule,
    Compound,
    Cylinder,
    Fingertip,
    Part,
    Plane,
    Polytope,
    Revolved,
    Sphere,
    Surface,
    TaperedCapsule,
    solve_batch,
)


@dataclass(frozen=True)
class Row:
    """One body."""

    surface: str
    wrenches: int
    gaps: int
    """Number of wrenches whose status is not `OK`, except those that graze a sharp rim."""
    doubles: int
    """Number of results that differ from the constructed contact."""
    residual: float
    """Largest relative residual."""


def _nudges(rng: np.random.Generator, count: int) -> np.ndarray:
    """Distances from the seam: some exactly zero, the others from 1e-17 to 1e-3."""
    size = 10.0 ** rng.uniform(-17.0, -3.0, count)
    return np.where(rng.uniform(size=count) < 0.1, 0.0, size)


def _around(rng: np.random.Generator, count: int) -> np.ndarray:
    angle = rng.uniform(0.0, 2.0 * np.pi, count)
    return np.column_stack((np.cos(angle), np.sin(angle), np.zeros(count)))


def _turned(flat: np.ndarray, towards: np.ndarray, nudge: np.ndarray) -> np.ndarray:
    return unit(flat + nudge[:, None] * towards)


Points = tuple[np.ndarray, np.ndarray]


def _tapered(half: float, a: float, b: float) -> Callable[[np.random.Generator, int], Points]:
    def draw(rng: np.random.Generator, count: int) -> Points:
        sin_beta = (a - b) / (2.0 * half)
        cos_beta = np.sqrt(1.0 - sin_beta**2)
        e, nudge = _around(rng, count), _nudges(rng, count)
        z = np.array((0.0, 0.0, 1.0))
        side = cos_beta * e + sin_beta * z
        along = cos_beta * z - sin_beta * e
        n = np.where(rng.uniform(size=(count, 1)) < 0.5, side, _turned(side, along, nudge))
        on_side = np.all(n == side, axis=1)
        back = np.where(on_side, 0.5 * nudge * half, 0.0)[:, None]
        # From the upper seam down the side: the radius grows with the distance from the upper centre.
        return half * z + (b * n) - back * along, n

    return draw


def _drum(half: float, lower: float, upper: float, r: float) -> Callable[[np.random.Generator, int], Points]:
    def draw(rng: np.random.Generator, count: int) -> Points:
        length = np.hypot(2.0 * half, lower - upper)
        cos_beta, sin_beta = 2.0 * half / length, (lower - upper) / length
        e, nudge, z = _around(rng, count), _nudges(rng, count), np.array((0.0, 0.0, 1.0))
        side, along = cos_beta * e + sin_beta * z, cos_beta * z - sin_beta * e
        core = upper * e + half * z
        kind = rng.integers(0, 4, count)[:, None]
        n = np.select(
            (kind == 0, kind == 1, kind == 2),
            (side, _turned(side, along, nudge), _turned(np.tile(z, (count, 1)), e, nudge)),
            np.tile(z, (count, 1)),
        )
        inwards = 0.5 * nudge[:, None] * upper
        core = core - np.where(kind == 0, inwards * along, 0.0) - np.where(kind == 3, inwards * e, 0.0)
        return core + r * n, n

    return draw


def _block(bx: float, by: float, bz: float, r: float) -> Callable[[np.random.Generator, int], Points]:
    half = np.array((bx, by, bz))

    def draw(rng: np.random.Generator, count: int) -> Points:
        # The normal deviates slightly from that of a face or an edge; the point may lie slightly inside.
        signs = rng.choice((-1.0, 1.0), size=(count, 3))
        components = np.column_stack(
            [np.where(rng.uniform(size=count) < 0.5, 0.0, _nudges(rng, count)) for _ in range(3)]
        )
        components[np.arange(count), rng.integers(0, 3, count)] = 1.0
        n = unit(signs * components)
        inwards = np.where(components == 0.0, np.column_stack([_nudges(rng, count) for _ in range(3)]), 0.0)
        return signs * half * (1.0 - inwards) + r * n, n

    return draw


def _tip(radius: float) -> Callable[[np.random.Generator, int], Points]:
    def draw(rng: np.random.Generator, count: int) -> Points:
        e, nudge, z = _around(rng, count), _nudges(rng, count), np.array((0.0, 0.0, 1.0))
        below = (rng.uniform(size=count) < 0.5)[:, None]
        n = np.where(below, e, _turned(e, np.tile(z, (count, 1)), nudge))
        return radius * n - np.where(below, radius * nudge[:, None] * z, 0.0), n

    return draw


_OFF = 1e-9
"""Distance from a sharp rim, relative to the body's size, above which the two sides are distinguished."""


def _sharp(half: float, radius: float) -> Callable[[np.random.Generator, int], Points]:
    def draw(rng: np.random.Generator, count: int) -> Points:
        e, z = _around(rng, count), np.array((0.0, 0.0, 1.0))
        nudge = _OFF + _nudges(rng, count)[:, None]
        on_side = rng.uniform(size=(count, 1)) < 0.5
        c = np.where(on_side, radius * e + half * (1.0 - nudge) * z, radius * (1.0 - nudge) * e + half * z)
        return c, np.where(on_side, e, z)

    return draw


_CUBE = [(x, y, z) for x in (-0.1, 0.1) for y in (-0.04, 0.04) for z in (-0.07, 0.07)]

BODIES: dict[str, tuple[Surface, Callable[[np.random.Generator, int], Points]]] = {
    "capsule": (Capsule(0.2, 0.06), _tapered(0.2, 0.06, 0.06)),
    "tapered capsule": (TaperedCapsule(0.2, 0.08, 0.05), _tapered(0.2, 0.08, 0.05)),
    "fingertip": (Fingertip(0.03), _tip(0.03)),
    "rounded cylinder": (Revolved(0.1, 0.05, 0.05, 0.01), _drum(0.1, 0.05, 0.05, 0.01)),
    "rounded cone": (Revolved(0.1, 0.06, 0.04, 0.01), _drum(0.1, 0.06, 0.04, 0.01)),
    "rounded box": (Box(0.1, 0.04, 0.07, 0.01), _block(0.1, 0.04, 0.07, 0.01)),
    "rounded polytope": (Polytope(_CUBE, 0.01), _block(0.1, 0.04, 0.07, 0.01)),
    "compound fingertip": (
        Compound(
            [
                Part(Sphere(0.03), (Plane((0.0, 0.0, -1.0), 0.0),)),
                Part(Cylinder(0.03), (Plane((0.0, 0.0, 1.0), 0.0),)),
            ],
            0.1,
        ),
        _tip(0.03),
    ),
    "compound with sharp rims": (
        Compound.common([Cylinder(0.05), *(Plane((0.0, 0.0, side), 0.08) for side in (1.0, -1.0))], 0.1),
        _sharp(0.08, 0.05),
    ),
}


SHARP = ("compound with sharp rims",)


def rows(count: int, tick: Callable[[str], None]) -> Iterator[Row]:
    """Measure all bodies on `count` wrenches each."""
    for name, (surface, points) in BODIES.items():
        tick(name)
        rng = np.random.default_rng(3)
        contacts = press(rng, *points(rng, count), 0.3)
        found = solve_batch(surface, contacts.force, contacts.moment)
        error = np.linalg.norm(found.centroid - contacts.centroid, axis=1)
        # The curvature is discontinuous at a seam: use the larger condition number, of the flat patch.
        push = -np.sum(contacts.force * contacts.normal, axis=1)
        force = np.linalg.norm(contacts.force, axis=1)
        moment = np.linalg.norm(contacts.moment, axis=1)
        size = float(np.abs(contacts.centroid).max())
        steep = (1.0 + moment / (force * size)) * (force / push) * (1.0 + moment / (push * 0.03))
        rounding = 1e-13 * (10.0 + steep)
        doubles = found.ok & (error > rounding * size)
        # Near a sharp rim, rounding decides on which side a grazing force acts, or on none.
        gaps = ~found.ok & ~((rounding > _OFF) & (name in SHARP))
        yield Row(
            name,
            count,
            int(np.count_nonzero(gaps)),
            int(np.count_nonzero(doubles)),
            float(found.residual[found.ok].max()),
        )
