"""Distance between a union of primitives and the skin that it approximates, in both directions."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from contactsense.robots.decomposition.distance_samples import Shape
from contactsense.robots.decomposition.least_squares_fit import Bodies
from contactsense.robots.decomposition.outer_skin import Skin, Surroundings
from contactsense.robots.primitives import Primitive
from contactsense.robots.surface.convex_primitives import (
    BOX,
    REVOLVED,
    Surfaces,
    body,
    bounding_radius,
)
from contactsense.robots.surface.union import distances

ROOM = 0.003
"""A point on a primitive counts as exposed if there is free space above it for this distance [m]."""


@dataclass(frozen=True, slots=True)
class Errors:
    """Distances between touchable skin and primitives, one entry per sample."""

    skin: np.ndarray
    """From the skin to the primitives, signed: positive where they are below it, shape (N,) [m]."""
    primitive: np.ndarray
    """From exposed surface of the primitives to the skin, not negative, shape (M,) [m]."""
    angle: np.ndarray
    """Between the normals of skin and primitives, shape (N,) [rad]."""
    area: float
    """Area of the skin that can be touched [m^2]."""


def packed(bodies: Bodies) -> Surfaces:
    """Bodies as the surfaces of one link."""
    count = len(bodies.kind)
    return Surfaces(
        kind=bodies.kind,
        link=np.zeros(count, dtype=np.int64),
        rotation=bodies.rotation,
        origin=bodies.origin,
        size=bodies.size,
        radius=np.array([bounding_radius(*body) for body in zip(bodies.kind, bodies.size, strict=True)]),
        start=np.array([0, count], dtype=np.int64),
    )


def bodies_of(shapes: Sequence[Primitive]) -> Bodies:
    """Primitives as bodies."""
    places = [body(shape) for shape in shapes]
    size = np.zeros((len(places), 8))
    for row_, place in zip(size, places, strict=True):
        row_[: len(place[3])] = place[3]
    return Bodies(
        kind=np.array([place[0] for place in places], dtype=np.int64),
        rotation=np.array([place[1] for place in places]),
        origin=np.array([place[2] for place in places]),
        size=size,
    )


def errors(bodies: Bodies, skin: Skin, shape: Shape, around: Surroundings, seed: int = 0) -> Errors:
    """Compare primitives with the skin, on both sides only where a finger can reach.

    Args:
        bodies: Primitives of the link.
        skin: Its skin.
        shape: Signed distance to the skin.
        around: The link's mesh and its neighbours.
        seed: Of the samples on the primitives.
    """
    rng = np.random.default_rng(seed)
    surfaces = packed(bodies)
    open_ = skin.exposure > 0.0
    distance, _, normal = distances(surfaces, skin.points[open_])
    cosine = np.einsum("ij,ij->i", normal, skin.normals[open_])
    points = exposed_surface(bodies, 5000, rng)
    outward = distances(surfaces, points)[2]
    points = points[around.exposure_of_model(points, outward, rng) > 0.0]
    return Errors(
        skin=distance,
        primitive=np.abs(shape.distance(points)),
        angle=np.arccos(np.clip(cosine, -1.0, 1.0)),
        area=skin.area * float(open_.mean()),
    )


def exposed_surface(bodies: Bodies, count: int, rng: np.random.Generator) -> np.ndarray:
    """About `count` points, uniform by area, on the surface of the union, shape (N, 3) [m]."""
    parts, areas = [], []
    for kind, rotation, origin, size in zip(*bodies, strict=True):
        local, area = surface_points(int(kind), size, count, rng)
        parts.append(local @ rotation.T + origin)
        areas.append(area)
    total = sum(areas)
    points = np.concatenate(
        [part[: max(1, int(2 * count * area / total))] for part, area in zip(parts, areas, strict=True)]
    )
    return on_union(packed(bodies), points)[0]


def on_union(surfaces: Surfaces, points: np.ndarray, link: int = 0) -> tuple[np.ndarray, np.ndarray]:
    """Those of the points on a link's primitives that are on the surface of their union, and the outward
    normals there, shapes (N, 3)."""
    distance, _, normal = distances(surfaces, points, link)
    points, normal = points[distance > -1e-6], normal[distance > -1e-6]
    # The walls of a slit between two bodies are also surface, but cannot be reached.
    free = distances(surfaces, points + ROOM * normal, link)[0] > ROOM / 3.0
    return points[free], normal[free]


def surface_points(
    kind: int, size: np.ndarray, count: int, rng: np.random.Generator
) -> tuple[np.ndarray, float]:
    """Points uniform by area on one primitive, body frame, shape (count * 2, 3), and its area."""
    lead = 2 * count
    if kind == REVOLVED:
        h, R0, R1, r = size[:4]
        taper = np.arctan2(R0 - R1, 2.0 * h) if h > 0.0 or R0 != R1 else 0.0
        # Profile from the lower pole to the upper: cap, rim, side, rim, cap, as polyline in (z, rho).
        low = np.linspace(-np.pi / 2, taper, 40)
        high = np.linspace(taper, np.pi / 2, 40)
        z = np.concatenate(([-h - r], -h + r * np.sin(low), h + r * np.sin(high), [h + r]))
        rho = np.concatenate(([0.0], R0 + r * np.cos(low), R1 + r * np.cos(high), [0.0]))
        length = np.hypot(np.diff(z), np.diff(rho))
        rings = np.pi * (rho[1:] + rho[:-1]) * length
        at = rng.choice(len(rings), size=lead, p=rings / rings.sum())
        # Within a ring the density grows with the radius.
        a, b, u = rho[at], rho[at + 1], rng.random(lead)
        t = np.where(
            np.abs(b - a) > 1e-9, (np.sqrt(a * a + u * (b * b - a * a)) - a) / np.where(b == a, 1, b - a), u
        )
        angle = rng.uniform(0.0, 2.0 * np.pi, lead)
        radius, height = a + t * (b - a), z[at] + t * (z[at + 1] - z[at])
        # On the rims, from the chord to the arc.
        for first, turn, core, end in ((1, low, R0, -h), (len(low) + 1, high, R1, h)):
            rim = (at >= first) & (at < first + len(turn) - 1)
            phi = turn[0] + (at[rim] - first + t[rim]) * (turn[1] - turn[0])
            radius[rim], height[rim] = core + r * np.cos(phi), end + r * np.sin(phi)
        return np.stack((radius * np.cos(angle), radius * np.sin(angle), height), axis=1), float(rings.sum())
    directions = rng.normal(size=(lead, 3))
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    if kind == BOX:
        core, r = size[:3], size[3]
        faces = 4.0 * np.array([core[1] * core[2], core[2] * core[0], core[0] * core[1]])
        edges = np.pi * r * core * 4.0
        areas = np.concatenate((2.0 * faces, edges, [4.0 * np.pi * r * r]))
        at = rng.choice(7, size=lead, p=areas / areas.sum())
        place = rng.uniform(-1.0, 1.0, size=(lead, 3)) * core
        normal = directions.copy()
        for axis in range(3):
            face, edge = at == axis, at == 3 + axis
            normal[face] = 0.0
            normal[face, axis] = np.sign(directions[face, axis])
            normal[edge, axis] = 0.0
        normal /= np.linalg.norm(normal, axis=1, keepdims=True)
        across = np.abs(normal) > 0.0
        return np.where(across, np.sign(normal) * core, place) + r * normal, float(areas.sum())
    a, b, c = size[:3]
    # K. Thomsen's approximation, within 1.1 %.
    area = 4.0 * np.pi * (((a * b) ** 1.6 + (a * c) ** 1.6 + (b * c) ** 1.6) / 3.0) ** (1.0 / 1.6)
    return _on_ellipsoid(size[:3], lead, rng), float(area)


def _on_ellipsoid(radii: np.ndarray, count: int, rng: np.random.Generator) -> np.ndarray:
    """Points uniform by area on an ellipsoid, shape (count, 3): those of the unit sphere, each kept with the
    probability of what stretching does to the area there, relative to the most that it does anywhere."""
    points = np.zeros((0, 3))
    while len(points) < count:
        u = rng.normal(size=(count, 3))
        u /= np.linalg.norm(u, axis=1, keepdims=True)
        kept = rng.random(count) < radii.min() * np.linalg.norm(u / radii, axis=1)
        points = np.concatenate((points, u[kept] * radii))
    return points[:count]


HEADINGS = (
    "skin to primitives p50/p95/max, mm",
    "primitives to skin p50/p95/max, mm",
    "normals p50/p95, deg",
)
"""Columns of `row`."""


def row(found: Errors) -> tuple[str, str, str]:
    """Errors as text, in the columns of `HEADINGS`; a dash where there are no samples."""

    def percentiles(values: np.ndarray, of: Sequence[float], digits: int) -> str:
        if not len(values):
            return "-"
        return "/".join(f"{value:.{digits}f}" for value in np.percentile(values, of))

    skin, primitive = (
        percentiles(np.abs(values) * 1e3, (50.0, 95.0, 100.0), 2) for values in (found.skin, found.primitive)
    )
    return skin, primitive, percentiles(np.degrees(found.angle), (50.0, 95.0), 1)


def together(parts: Sequence[Errors]) -> Errors:
    """Errors of several links combined as one surface, each with a number of samples proportional to its
    area. Links whose primitives are not exposed have no samples on these."""
    density = min(len(part.skin) / part.area for part in parts)
    exposed = [len(part.primitive) / part.area for part in parts if len(part.primitive)]
    back = min(exposed, default=0.0)
    rng = np.random.default_rng(0)
    skin, primitive, angle = [], [], []
    for part in parts:
        some = rng.choice(len(part.skin), size=int(density * part.area), replace=False)
        skin.append(part.skin[some])
        angle.append(part.angle[some])
        count = int(back * part.area) if len(part.primitive) else 0
        primitive.append(rng.choice(part.primitive, size=count, replace=False))
    return Errors(
        np.concatenate(skin),
        np.concatenate(primitive),
        np.concatenate(angle),
        sum(part.area for part in parts),
    )
