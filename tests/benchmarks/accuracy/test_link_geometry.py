"""Why a link is beyond the limit, on distances that are given; and a folder without meshes."""

import json
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner

from contactsense.benchmarks.accuracy import geometry as bench
from contactsense.benchmarks.accuracy.geometry import geometry
from contactsense.benchmarks.accuracy.link_geometry import LIMIT, link_row, print_links, reason
from contactsense.robots.decomposition.surface_error import Errors
from tests.plain_arm import plain_ur5e

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


def test_a_link_without_exposed_primitives_has_no_distances_from_them() -> None:
    skin, none = np.full(100, 0.5 * LIMIT), np.empty(0)
    assert reason(skin, none, POINTS) == ""
    assert reason(10.0 * skin, none, POINTS).startswith("100 % of the skin is above the primitives")


def test_levels_without_exposed_primitives_are_printed(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """As of an arm whose primitives are all covered by neighbours."""
    (tmp_path / "ur5e").mkdir()
    found = Errors(np.full(100, 0.003), np.empty(0), np.zeros(100), 0.1)
    row = {"robot": "ur5e", "fit_seconds": 1.0, "level": "fine", "primitives": 3, "bytes": 552}
    monkeypatch.setattr(bench, "_measure", lambda *_: [row | bench._row(found)])
    done = CliRunner().invoke(geometry, [str(tmp_path), "--json"])
    assert done.exit_code == 0, done.output
    (level,) = json.loads(done.stdout)
    assert level["model_to_skin_mm"] is None
    assert level["skin_to_model_mm"]["p50"] == 3.0
    done = CliRunner().invoke(geometry, [str(tmp_path)])
    assert done.exit_code == 0, done.output
    assert "not exposed" in done.stdout


def test_links_without_exposed_primitives_are_printed(capsys: pytest.CaptureFixture[str]) -> None:
    found = Errors(np.full(100, 0.003), np.empty(0), np.zeros(100), 0.1)
    row = link_row(plain_ur5e().links[1], found, POINTS)
    assert row["model_to_skin_p95_mm"] is None
    assert row["skin_to_model_p95_mm"] == 3.0
    print_links([{"robot": "ur5e", "link": "shoulder"} | row])
    assert "not exposed" in " ".join(capsys.readouterr().out.split())


def test_a_folder_without_arms_of_the_library_is_told(tmp_path: Path) -> None:
    (tmp_path / "my_arm").mkdir()
    found = CliRunner().invoke(geometry, [str(tmp_path)])
    assert found.exit_code == 1
    assert "expected a folder named after an arm of the library, got none" in found.output
