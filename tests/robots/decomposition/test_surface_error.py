"""Errors of primitives of which no part is exposed."""

import numpy as np
import pytest

from contactsense.robots.decomposition.distance_samples import Shape
from contactsense.robots.decomposition.outer_skin import Surroundings, outer_skin
from contactsense.robots.decomposition.surface_error import Errors, bodies_of, errors, row, together
from contactsense.robots.primitives import Sphere
from tests.robots.shapes import block

EXPOSED = Errors(np.full(40, 0.001), np.full(40, 0.002), np.full(40, np.radians(3.0)), 0.1)


@pytest.fixture(scope="module")
def hidden() -> Errors:
    """A ball deep inside a block."""
    mesh, ball = block((0.2, 0.2, 0.2), (0.0, 0.0, 0.0)), Sphere(center=(0.0, 0.0, 0.0), radius=0.02)
    skin = outer_skin(mesh, count=500)
    return errors(bodies_of([ball]), skin, Shape(skin), Surroundings(mesh))


def test_a_dash_stands_for_distances_from_primitives_that_are_hidden(hidden: Errors) -> None:
    assert len(hidden.primitive) == 0
    there, back, angles = row(hidden)
    assert back == "-"
    assert (len(there.split("/")), len(angles.split("/"))) == (3, 2)


def test_links_whose_primitives_are_hidden_do_not_count_in_distances_from_primitives(hidden: Errors) -> None:
    found = together([hidden, EXPOSED])
    assert found.area == hidden.area + EXPOSED.area
    np.testing.assert_array_equal(found.primitive, EXPOSED.primitive)
    assert row(found)[1] == row(EXPOSED)[1] == "2.00/2.00/2.00"
    assert row(together([hidden, hidden]))[1] == "-"
