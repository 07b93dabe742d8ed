"""The arm is the one that its maker describes, in the frames of its maker."""

import numpy as np
import pytest
import trimesh
from scipy.spatial import cKDTree

from contactsense import robots
from contactsense.benchmarks.truth.arm import Arm, read
from contactsense.benchmarks.truth.universal_robots import LINKS
from tests.shared import shared


@pytest.fixture(scope="module")
def arm() -> Arm:
    return read("ur5e")


def test_an_unknown_arm_is_named() -> None:
    with pytest.raises(ValueError, match="ur9: no such arm; expected ur3e, ur5e, panda"):
        read("ur9")


def test_its_tensors_are_those_of_bodies(arm: Arm) -> None:
    """Positive, and no principal moment greater than the sum of the others."""
    assert arm.mass == pytest.approx(21.7)
    for link in arm.links:
        moments = np.linalg.eigvalsh(link.tensor)
        assert moments[0] > 0.0
        assert moments[2] <= moments[0] + moments[1]


@pytest.mark.parametrize("name", ["ur3e", "ur5e"])
def test_masses_frames_and_limits_are_those_of_the_library(name: str) -> None:
    """Both state what the maker publishes; neither file is read for the other."""
    arm, robot = read(name), robots.load(name)
    for link, known in zip(arm.links, robot.links, strict=True):
        assert link.mass == known.inertia.mass
        np.testing.assert_allclose(link.com, known.inertia.com, atol=1e-12)
        np.testing.assert_allclose(link.tensor, known.inertia.tensor, atol=5e-9)
    for link, joint in zip(arm.links[1:], robot.joints, strict=True):
        np.testing.assert_allclose(link.origin, joint.translation, atol=1e-12)
        np.testing.assert_allclose(link.rotation, joint.rotation, atol=1e-9)
    # The last joint of the UR3e turns without end; one turn to each side reaches all postures.
    limits = np.clip([joint.position_limits for joint in robot.joints], -2.0 * np.pi, 2.0 * np.pi).T
    np.testing.assert_allclose(arm.limits, limits, atol=1e-12)


@pytest.mark.parametrize("name", ["ur3e", "ur5e"])
def test_meshes_are_the_makers_in_its_frames(name: str) -> None:
    folder = shared(f"ur_visual/{name}")
    for link in read(name).links:
        known = trimesh.load(folder / f"{link.name}.ply", process=False)
        # The files state whole micrometres.
        far, _ = cKDTree(link.vertices).query(known.vertices)
        assert far.max() < 2e-6, link.name


def test_the_base_is_without_its_cable(arm: Arm) -> None:
    """It stands on the mounting plane and reaches neither below nor beyond its own cylinder."""
    assert [link.name for link in arm.links] == list(LINKS)
    low, high = arm.links[0].vertices.min(axis=0), arm.links[0].vertices.max(axis=0)
    assert low[2] == pytest.approx(0.0, abs=1e-6)
    np.testing.assert_allclose(high[:2], -low[:2], atol=1e-3)
