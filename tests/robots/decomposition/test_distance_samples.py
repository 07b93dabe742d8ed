"""What the fit is asked for where links join."""

import numpy as np
import pytest
import trimesh

from contactsense.robots.decomposition.distance_samples import make_target
from contactsense.robots.decomposition.least_squares_fit import Bodies, cost
from contactsense.robots.decomposition.outer_skin import Surroundings, outer_skin
from contactsense.robots.primitives import Cylinder
from contactsense.robots.surface.convex_primitives import body

# A shell of 100 mm whose end is recessed by 14 mm, and a hub that fills the recess.
SHELL = [(0.0, 0.0), (0.05, 0.0), (0.05, 0.1), (0.047, 0.1), (0.047, 0.086), (0.0, 0.086)]
HUB = [(0.0, 0.087), (0.046, 0.087), (0.046, 0.101), (0.05, 0.101), (0.05, 0.15), (0.0, 0.15)]


def cylinder(end: float) -> Bodies:
    shape = Cylinder(a=(0, 0, 0), b=(0, 0, end), radius_a=0.05, radius_b=0.05, rounding=0.001)
    kind, rotation, origin, size = body(shape)
    full = np.zeros((1, 8))
    full[0, : len(size)] = size
    return Bodies(np.array([kind]), rotation[None], origin[None], full)


@pytest.mark.slow
@pytest.mark.parametrize("mounted", [True, False])
def test_a_recess_that_the_next_link_fills_is_inside(mounted: bool) -> None:
    """The primitive then reaches the end of the shell; an open recess it leaves free."""
    shell, hub = (trimesh.creation.revolve(np.array(outline), sections=64) for outline in (SHELL, HUB))
    poses = [[hub]] if mounted else [[]]
    around = Surroundings(shell, poses)
    target = make_target(outer_skin(shell, poses, 6000), around, 2000, np.random.default_rng(0))
    filled, short = (cost(cylinder(end), target, 0.001, 0.04) for end in (0.1, 0.094))
    assert (filled < short) == mounted
