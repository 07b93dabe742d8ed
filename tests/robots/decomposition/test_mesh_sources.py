"""Meshes are compared with the primitives that were fitted to them."""

from pathlib import Path

import pytest
import trimesh

from contactsense.robots import RobotError
from contactsense.robots.decomposition.mesh_sources import skin_meshes
from contactsense.robots.robot import NO_MASS, Link, LocalDeviation, Robot


@pytest.mark.slow
def test_a_large_link_with_many_faces_inside_is_compared_as_finely_as_a_small_one(tmp_path: Path) -> None:
    outside = trimesh.creation.box((1.6, 0.6, 0.6))
    inside = [trimesh.creation.box((1.5, 0.5 - 0.02 * i, 0.5)) for i in range(6)]
    trimesh.util.concatenate([outside, *inside]).export(tmp_path / "beam.stl")
    places, _ = trimesh.sample.sample_surface(outside, 500, seed=1)
    deviation = tuple(LocalDeviation(0, tuple(place), 0.0005, 0.01) for place in places)
    robot = Robot("beam", (Link("beam", NO_MASS, deviation=deviation),), ())
    assert set(skin_meshes(robot, tmp_path)) == {"beam"}
    outside.apply_translation((0.0, 0.0, 0.03)).export(tmp_path / "beam.stl")
    with pytest.raises(RobotError, match="is it that of another arm"):
        skin_meshes(robot, tmp_path)
