"""The scenes of docs/sensors.md load, and the bench of what their sensors can tell counts right."""

import json
import shutil
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner

from contactsense import JointTorqueSensor, Scene, WrenchSensor
from contactsense.benchmarks import panda
from contactsense.benchmarks.accuracy.cells import cells, measure

FOLDER = Path(__file__).parents[3] / "examples" / "cells"
PAGE = (Path(__file__).parents[3] / "docs" / "sensors.md").read_text(encoding="utf-8")
SCENES = sorted(FOLDER.glob("*.yaml"))


@pytest.fixture
def beside_the_panda(tmp_path: Path) -> Path:
    """The scene of an arm with joint torque sensors, beside the Panda's URDF and its surface."""
    try:
        shutil.copy(panda.urdf(), tmp_path / "panda.urdf")
    except panda.NoPandaError as error:
        pytest.skip(str(error))
    shutil.copy(panda.SURFACE, tmp_path / "panda.surface.yaml")
    return Path(shutil.copy(FOLDER / "joint_torque_sensors.yaml", tmp_path))


@pytest.mark.parametrize("path", [path for path in SCENES if "panda" not in path.read_text()])
def test_the_scenes_of_the_page_load(path: Path) -> None:
    scene = Scene.load(path)
    assert scene.touchable is not None
    assert f"examples/cells/{path.name}" in PAGE


def test_the_scene_of_another_make_loads(beside_the_panda: Path) -> None:
    path = beside_the_panda
    scene = Scene.load(path)
    assert len(scene.robot.joints) == 7
    assert all(link.primitives for link in scene.robot.links)
    assert scene.joint_torque is not None
    assert scene.joint_torque.model_error == panda.DRIFT
    assert f"examples/cells/{path.name}" in PAGE


@pytest.mark.long
def test_exact_sensors_name_every_link_and_the_tool() -> None:
    scene = Scene.load(FOLDER / "base_sensor.yaml").model_copy(
        update={
            "base_wrench": WrenchSensor(force_noise=1e-3, moment_noise=1e-4, translation=(0.0, 0.0, -0.035)),
            "joint_torque": JointTorqueSensor(noise=1e-3),
            "wrist_wrench": WrenchSensor(force_noise=1e-3, moment_noise=1e-4),
        }
    )
    touches, answers = measure(scene, contacts=40, force=20.0, seed=0)
    assert answers.detected.all()
    assert answers.named.mean() >= 0.95
    assert np.median(answers.error) < 1e-3
    tool = touches.link[:, 0] == scene.link_names.index("gripper")
    assert tool.any()
    assert answers.named[tool].all()


@pytest.mark.long
def test_a_flange_sensor_feels_the_tool_only() -> None:
    """Joint torques so noisy that they do not feel 20 N."""
    scene = Scene.load(FOLDER / "e_series.yaml").model_copy(
        update={
            "joint_torque": JointTorqueSensor(noise=25.0),
            "wrist_wrench": WrenchSensor(force_noise=0.1, moment_noise=0.01),
        }
    )
    touches, answers = measure(scene, contacts=40, force=20.0, seed=0)
    tool = touches.link[:, 0] == scene.link_names.index("gripper")
    np.testing.assert_array_equal(answers.detected, tool)
    assert answers.named[tool].all()


@pytest.mark.long
def test_the_command_counts_by_link() -> None:
    path = str(FOLDER / "base_sensor.yaml")
    printed = CliRunner().invoke(cells, [path, "--contacts", "8", "--json"])
    assert printed.exit_code == 0
    rows = json.loads(printed.output)["base_sensor"]
    assert rows["all"]["contacts"] == 8
    assert sum(row["contacts"] for name, row in rows.items() if name != "all") == 8


def test_a_missing_scene_is_named(tmp_path: Path) -> None:
    result = CliRunner().invoke(cells, [str(tmp_path / "none.yaml")])
    assert result.exit_code == 1
    assert "none.yaml" in result.output
