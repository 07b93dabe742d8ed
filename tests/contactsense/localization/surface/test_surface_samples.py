"""The cells of the samples add up to the area of the surface, and no sample lies inside."""

import numpy as np
import pytest

from contactsense.localization.surface import surface_samples
from contactsense.localization.surface.surface_samples import sample_surface
from contactsense.robots import Inertia, Link, load
from contactsense.robots.primitives import Box, Capsule, Cylinder, Primitive, Sphere
from contactsense.robots.surface.convex_primitives import pack
from contactsense.robots.surface.union import distances

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
    samples, subsamples, total = sample_surface(pack([_link(body)]))
    assert total == pytest.approx(area, rel=0.03)
    assert np.exp(samples.log_share).sum() == pytest.approx(1.0)
    assert np.exp(subsamples.log_share).sum() == pytest.approx(1.0)


def test_only_the_surface_of_the_union_is_sampled() -> None:
    one = Sphere(center=(0, 0, 1), radius=0.1)
    other = Sphere(center=(0, 0, 1.1), radius=0.1)
    surfaces = pack([_link(one, other)])
    samples, _, area = sample_surface(surfaces)
    # Two spheres without the caps that face each other: each keeps 3/4 of its height.
    assert area == pytest.approx(2 * 0.75 * 4 * np.pi * 0.01, rel=0.03)
    assert distances(surfaces, samples.point)[0].min() > -0.004


def test_samples_of_an_arm_are_even_and_sorted() -> None:
    surfaces = pack(load("ur5e").links)
    samples, _, area = sample_surface(surfaces)
    assert 0.4 < area < 0.8
    assert samples.start[0] == 0
    assert samples.start[-1] == len(samples.spread)
    assert (np.diff(samples.start) >= 0).all()
    share = np.exp(samples.log_share)
    assert share.max() < 4.0 * share.mean()
    for link in range(7):
        first, last = samples.start[surfaces.start[link]], samples.start[surfaces.start[link + 1]]
        assert np.abs(distances(surfaces, samples.point[first:last], link)[0]).max() < 0.004
    base = samples.point[: samples.start[surfaces.start[1]]]
    facing = samples.normal[: len(base), 2]
    assert not ((base[:, 2] < 0.002) & (facing < -0.5)).any()


def test_subsamples_cover_their_cells() -> None:
    surfaces = pack(load("ur5e").links)
    samples, subsamples, _ = sample_surface(surfaces)
    assert subsamples.start[0] == 0
    assert subsamples.start[-1] == len(subsamples.spread)
    cell = np.repeat(np.arange(len(samples.spread)), np.diff(subsamples.start))
    assert np.bincount(cell, np.exp(subsamples.log_share)) == pytest.approx(np.exp(samples.log_share))
    primitive = np.repeat(np.arange(len(surfaces.kind)), np.diff(samples.start))
    assert (surfaces.link[subsamples.primitive] == surfaces.link[primitive[cell]]).all()
    # The spread of a cell is consistent with the position and spread of its subsamples.
    squared_distance = ((subsamples.point - samples.point[cell]) ** 2).sum(axis=1)
    assert (squared_distance < (6.0 * samples.spread[cell]) ** 2).all()
    assert np.median(subsamples.spread) < 0.6 * np.median(samples.spread)
    for subsample in range(0, len(cell), 17):
        link = surfaces.link[subsamples.primitive[subsample]]
        distance, which, normal = distances(surfaces, subsamples.point[subsample][None], link)
        assert abs(distance[0]) < 1e-3
        if which[0] == subsamples.primitive[subsample]:
            assert normal[0] @ subsamples.normal[subsample] > 0.9


def test_a_cell_of_few_patches_has_a_spread() -> None:
    """The subcells of a single small body hold a patch or two, which may lie exactly above one another."""
    forearm = Capsule(a=(-0.05, 0, 0), b=(-0.34, 0, 0), radius=0.04)
    for cells in sample_surface(pack([_link(forearm)]))[:2]:
        assert (cells.spread > 0.0).all()


def test_a_link_without_surface_has_no_samples() -> None:
    samples, subsamples, _ = sample_surface(pack([_link()]))
    assert len(samples.spread) == len(subsamples.spread) == 0


@pytest.mark.parametrize("robot", ["ur3e", "ur10e"])
def test_blocks_that_are_left_out_have_no_surface(robot: str, monkeypatch: pytest.MonkeyPatch) -> None:
    surfaces = pack(load(robot).links)
    found = sample_surface(surfaces)
    monkeypatch.setattr(surface_samples, "BLOCK", 1)
    surface_samples._sampled.cache_clear()  # else it would be the same samples again
    searched = sample_surface(surfaces)
    for values, whole in zip([*found[0], *found[1]], [*searched[0], *searched[1]], strict=True):
        np.testing.assert_array_equal(values, whole)
    assert found[2] == searched[2]
