"""A fork of a palm and two fingers: its parts are found, and fitted part by part."""

import numpy as np
import pytest
import trimesh

from contactsense.robots.decomposition.decompose import Options
from contactsense.robots.decomposition.separate_parts import fit_part, joined_fit, separate_parts
from tests.robots.shapes import block, fork

QUICK = Options(guesses=20, most=2, tolerance=0.0015, samples=6000)


def test_each_part_is_found_and_a_pin_belongs_to_the_nearest() -> None:
    parts = separate_parts(fork())
    assert sorted(len(part.faces) for part in parts) == [12, 12, 24]
    (with_pin,) = [part for part in parts if len(part.faces) == 24]
    assert with_pin.bounds[0, 0] > 0.0


def test_facets_that_share_places_are_one_part() -> None:
    """A file in STL repeats the vertices of each facet."""
    soup = fork()
    soup.unmerge_vertices()
    assert len(separate_parts(soup)) == 3


@pytest.mark.parametrize("count", [1, 60])
def test_one_part_and_loose_facets_are_fitted_as_a_whole(count: int) -> None:
    mesh = trimesh.util.concatenate([block((0.03, 0.03, 0.03), (0.1 * i, 0.0, 0.0)) for i in range(count)])
    assert separate_parts(mesh) == [mesh]


def test_a_part_that_cannot_be_touched_has_no_fit() -> None:
    parts = [block((0.1, 0.1, 0.1), (0.0, 0.0, 0.0)), block((0.03, 0.03, 0.03), (0.0, 0.0, 0.0))]
    assert fit_part(parts, 1, QUICK) == ()


@pytest.mark.long
def test_the_union_of_the_parts_leaves_the_air_between_them_free() -> None:
    mesh = fork()
    parts = separate_parts(mesh)
    fits = [fit_part(parts, number, QUICK) for number in range(len(parts))]
    joined = joined_fit(mesh, [found[0] for found in fits], QUICK)
    assert len(joined.bodies.kind) == 3
    assert joined.p95 < 0.005
    assert np.percentile(joined.errors.primitive, 99.0) < 0.01
    assert len(joined.deviation) >= 3
