"""Places stand for the surface: their cells add up to its area, and none lies inside."""

import numpy as np
import pytest

from contactsense.places import find_places
from robots import Inertia, Link, load
from robots.primitives import Box, Capsule, Cylinder, Primitive, Sphere
from robots.surface import pack
from robots.union import distances

BODIES: dict[str, tuple[Primitive, float]] = {
    "sphere": (Sphere(center=(0, 0, 1), radius=0.04), 4 * np.pi * 0.04**2),
    "large sphere": (Sphere(center=(0, 0, 1), radius=0.3), 4 * np.pi * 0.3**2),
    "capsule": (
        Capsule(a=(0, 0, 1), b=(0, 0.2, 1), radius=0.05),
        4 * np.pi * 0.05**2 + 2 * np.pi * 0.05 * 0.2,
    ),
    "cylinder": (
        Cylinder(a=(0, 0, 1), b=(0.1, 0, 1), radius_a=0.06, radius_b=0.06, rounding=1e-3),
        2 * np.pi * 0.06**2 + 2 * np.pi * 0.06 * 0.1,
    ),
    "box": (Box(center=(0, 0, 1), half=(0.1, 0.08, 0.06), rounding=1e-3), 8 * (0.008 + 0.006 + 0.0048)),
}


def _link(*shapes: Primitive) -> Link:
    return Link("one", Inertia(1.0, np.zeros(3), np.eye(3)), shapes)


@pytest.mark.parametrize("name", BODIES)
def test_cells_add_up_to_the_area(name: str) -> None:
    body, area = BODIES[name]
    places, parts, found = find_places(pack([_link(body)]))
    assert found == pytest.approx(area, rel=0.03)
    assert np.exp(places.log_share).sum() == pytest.approx(1.0)
    assert np.exp(parts.log_share).sum() == pytest.approx(1.0)


def test_of_two_bodies_only_the_common_surface_counts() -> None:
    one = Sphere(center=(0, 0, 1), radius=0.1)
    other = Sphere(center=(0, 0, 1.1), radius=0.1)
    surfaces = pack([_link(one, other)])
    places, _, area = find_places(surfaces)
    # Two spheres without the caps that face each other: each keeps 3/4 of its height.
    assert area == pytest.approx(2 * 0.75 * 4 * np.pi * 0.01, rel=0.03)
    assert distances(surfaces, places.point)[0].min() > -0.004


def test_places_of_an_arm_are_spread_evenly_and_sorted() -> None:
    surfaces = pack(load("ur5e").links)
    places, _, area = find_places(surfaces)
    assert 0.4 < area < 0.8
    assert places.start[0] == 0
    assert places.start[-1] == len(places.spread)
    assert (np.diff(places.start) >= 0).all()
    share = np.exp(places.log_share)
    assert share.max() < 4.0 * share.mean()
    for link in range(7):
        first, last = places.start[surfaces.start[link]], places.start[surfaces.start[link + 1]]
        assert np.abs(distances(surfaces, places.point[first:last], link)[0]).max() < 0.004
    base = places.point[: places.start[surfaces.start[1]]]
    facing = places.normal[: len(base), 2]
    assert not ((base[:, 2] < 0.002) & (facing < -0.5)).any()


def test_parts_make_up_their_cells() -> None:
    surfaces = pack(load("ur5e").links)
    places, parts, _ = find_places(surfaces)
    assert parts.start[0] == 0
    assert parts.start[-1] == len(parts.spread)
    cell = np.repeat(np.arange(len(places.spread)), np.diff(parts.start))
    assert np.bincount(cell, np.exp(parts.log_share)) == pytest.approx(np.exp(places.log_share))
    primitive = np.repeat(np.arange(len(surfaces.kind)), np.diff(places.start))
    assert (surfaces.link[parts.primitive] == surfaces.link[primitive[cell]]).all()
    # A cell is as far spread as its parts and their middles are.
    away = ((parts.point - places.point[cell]) ** 2).sum(axis=1)
    assert (away < (6.0 * places.spread[cell]) ** 2).all()
    assert np.median(parts.spread) < 0.6 * np.median(places.spread)
    for part in range(0, len(cell), 17):
        link = surfaces.link[parts.primitive[part]]
        distance, which, normal = distances(surfaces, parts.point[part][None], link)
        assert abs(distance[0]) < 1e-3
        if which[0] == parts.primitive[part]:
            assert normal[0] @ parts.normal[part] > 0.9


def test_no_surface_is_no_place() -> None:
    places, parts, _ = find_places(pack([_link()]))
    assert len(places.spread) == len(parts.spread) == 0
