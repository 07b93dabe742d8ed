"""Why a link is beyond the limit, on distances that are given; and a folder without meshes."""

from pathlib import Path

import numpy as np
from click.testing import CliRunner

from contactsense.benchmarks.accuracy.geometry import geometry
from contactsense.benchmarks.accuracy.link_geometry import LIMIT, reason

POINTS = np.tile([0.0, 0.0, 0.1], (100, 1))


def test_a_link_within_the_limit_needs_no_reason() -> None:
    skin = np.full(100, 0.5 * LIMIT)
    skin[:4] = 10.0 * LIMIT  # 4 % are beyond, but not the 95th percentile
    assert reason(skin, np.zeros(50), POINTS) == ""


def test_a_recess_is_told_with_its_depth_and_place() -> None:
    skin, points, primitive = np.zeros(100), POINTS.copy(), np.zeros(50)
    skin[:10], points[:10], primitive[:10] = -0.005, [0.01, 0.02, -0.007], 0.004
    assert reason(skin, primitive, points) == (
        "10 % of the skin is below the primitives, up to 5.0 mm, about (10, 20, -7) mm; "
        "20 % of the primitives' surface has no skin near"
    )


def test_missing_skin_is_told_as_such() -> None:
    skin = np.zeros(100)
    skin[:10] = 0.003
    found = reason(skin, np.zeros(50), POINTS)
    assert found == "10 % of the skin is above the primitives, up to 3.0 mm, about (0, 0, 100) mm"


def test_a_folder_without_arms_of_the_library_is_told(tmp_path: Path) -> None:
    (tmp_path / "my_arm").mkdir()
    found = CliRunner().invoke(geometry, [str(tmp_path)])
    assert found.exit_code == 1
    assert "expected a folder named after an arm of the library, got none" in found.output
