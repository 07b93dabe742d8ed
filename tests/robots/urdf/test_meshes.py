"""Meshes from files."""

from pathlib import Path

import numpy as np
import pytest
import trimesh

from contactsense.robots.urdf.meshes import read_mesh


@pytest.mark.parametrize(
    ("asset", "metres"),
    [
        ('<unit name="millimeter" meter="0.001"/><up_axis>Z_UP</up_axis>', 0.001),
        ('<unit name="inch" meter="0.0254"/><up_axis>Y_UP</up_axis>', 0.0254),
        ("", 1.0),
    ],
)
def test_the_unit_of_a_collada_file_is_taken_into_account_and_its_axes_stay(
    tmp_path: Path, asset: str, metres: float
) -> None:
    """As in RViz, which applies the unit and leaves the axes (rviz_rendering, mesh_loader.cpp)."""
    box = trimesh.creation.box((1.0, 2.0, 3.0))
    text = trimesh.exchange.dae.export_collada(box).decode()
    file = tmp_path / "box.dae"
    file.write_text(text.replace("<up_axis>Y_UP</up_axis>", asset), encoding="utf-8")
    np.testing.assert_allclose(read_mesh(file, 2.0).extents, 2.0 * metres * np.array([1.0, 2.0, 3.0]))
