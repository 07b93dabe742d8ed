"""Postures that benchmarks draw are within the limits of the joints, wherever the zeros of these lie."""

from dataclasses import replace

import numpy as np
import pytest

from contactsense import Scene
from contactsense.benchmarks.accuracy.surface_map import random_postures
from contactsense.benchmarks.peers.touches import Toucher
from tests.plain_arm import plain_ur5e

BEYOND = (3.5, 5.0)
"""Limits of the last joint beyond half a turn [rad]."""


@pytest.fixture(scope="module")
def scene() -> Scene:
    arm = plain_ur5e()
    last = replace(arm.joints[-1], position_limits=BEYOND)
    return Scene(robot=replace(arm, joints=(*arm.joints[:-1], last)))


def _are_spread(angles: np.ndarray) -> None:
    assert (angles >= BEYOND[0]).all()
    assert (angles <= BEYOND[1]).all()
    assert np.ptp(angles) > 0.5 * (BEYOND[1] - BEYOND[0])


def test_postures_of_the_surface_map(scene: Scene) -> None:
    q = np.array(list(random_postures(scene, 50, np.random.default_rng(0))))
    _are_spread(q[:, -1])
    assert np.abs(q[:, 0]).max() < np.pi


@pytest.mark.slow
def test_postures_of_simulated_touches(scene: Scene) -> None:
    _are_spread(Toucher(scene, seed=1).draw(10).q[:, -1])
