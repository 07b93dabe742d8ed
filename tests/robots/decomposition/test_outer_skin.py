"""Which part of a mesh a finger can reach, and which way its normals point."""

import numpy as np
import pytest
import trimesh

from contactsense.robots.decomposition.neighbour_poses import neighbour_poses
from contactsense.robots.decomposition.outer_skin import outer_skin, sample
from tests.robots.shapes import two_links, two_meshes


def test_samples_are_uniform_by_area() -> None:
    box = trimesh.creation.box((1.0, 2.0, 4.0))
    points, normals = sample(box, 40000, np.random.default_rng(0))
    assert np.abs(points).max(axis=0) == pytest.approx([0.5, 1.0, 2.0])
    share = [np.mean(np.abs(normals[:, axis]) > 0.5) for axis in range(3)]
    assert share == pytest.approx([8 / 14, 4 / 14, 2 / 14], abs=0.01)
    assert np.mean(points[:, 2] > 1.0) == pytest.approx((2 + 6) / 28, abs=0.01)


def test_inner_parts_are_left_out_and_normals_point_out() -> None:
    for mesh in two_meshes().values():
        skin = outer_skin(mesh, count=4000)
        x, y, z = skin.points.T
        if mesh is not None and mesh.bounds[0, 2] > -1e-9:
            assert np.all(np.linalg.norm(skin.points - [0, 0, 0.05], axis=1) > 0.045)
            side = np.abs(skin.normals[:, 2]) < 0.5
            assert np.all(np.einsum("ij,ij->i", skin.points[side, :2], skin.normals[side, :2]) > 0.0)
        else:
            # Nothing of the bar inside the disc, nothing of the disc inside the bar.
            in_disc = (np.hypot(x, y) < 0.0499) & (np.abs(z) < 0.0349)
            assert not in_disc.any()
            far = np.abs(x) > 0.06
            off_axis = np.stack((np.zeros(far.sum()), y[far], z[far]), axis=1)
            assert np.mean(np.einsum("ij,ij->i", off_axis, skin.normals[far]) >= -1e-3) > 0.99


def test_what_neighbours_and_the_mounting_always_cover_is_not_exposed() -> None:
    robot, meshes = two_links(), two_meshes()
    skin = outer_skin(meshes["base"], neighbour_poses(robot, meshes, 0), count=4000)
    bottom = skin.normals[:, 2] < -0.5
    side = np.abs(skin.normals[:, 2]) < 0.5
    assert skin.exposure[bottom].max() == 0.0
    assert skin.exposure[side & (skin.points[:, 2] < 0.05)].mean() > 0.9
    # The disc turns 5 mm above the top.
    middle = (skin.normals[:, 2] > 0.5) & (np.hypot(*skin.points[:, :2].T) < 0.02)
    assert skin.exposure[middle].max() == 0.0


def test_a_mesh_without_surface_is_refused() -> None:
    flat = trimesh.Trimesh(vertices=[[0, 0, 0], [1, 0, 0], [2, 0, 0]], faces=[[0, 1, 2]], process=False)
    with pytest.raises(ValueError, match="no surface"):
        outer_skin(flat)
