"""Scene and reports that several files of tests use."""

from pathlib import Path

import pytest
import yaml
from click.testing import CliRunner

from contactsense.service.cli.analyze import analyze
from tests.service.analysis.recordings import demo, write_motion


@pytest.fixture(scope="module")
def scene(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("scene") / "scene.yaml"
    path.write_text("robot: ur5e\n")
    return path


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Recording, scene, limits, and the results of the command in `out`."""
    folder = tmp_path_factory.mktemp("report")
    write_motion(demo(), folder / "demo.parquet", last=4500)
    (folder / "scene.yaml").write_text("robot: ur5e\n")
    (folder / "limits.yaml").write_text(
        yaml.safe_dump(
            {
                "provenance": "measured <by> us",
                "regions": [{"name": "hand", "quasi_static": 22.0, "transient": 900.0}],
            }
        )
    )
    result = CliRunner().invoke(
        analyze,
        [
            str(folder / "demo.parquet"), "--scene", str(folder / "scene.yaml"), "--out", str(folder / "out"),
            "--limits", str(folder / "limits.yaml"), "--estimates", "--json",
        ],
    )  # fmt: skip
    assert result.exit_code == 0, result.output
    (folder / "result.json").write_text(result.stdout)
    return folder
