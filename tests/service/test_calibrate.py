"""`contactsense calibrate` as its users run it."""

import json
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner

from contactsense import JointTorqueSensor, Scene
from contactsense.benchmarks.calibration.simulate import simulate
from contactsense.calibration.fourier_trajectory import FourierTrajectory
from contactsense.sensors.settings import Friction
from contactsense.service.cli.calibrate import calibrate
from contactsense.service.recordings.export import write_columns

TRUTH = Scene(
    robot="ur5e",
    base_wrench=None,
    joint_torque=JointTorqueSensor(
        friction=Friction(coulomb=(5.0,) * 6, viscous=(4.0,) * 6, velocity=0.05),
        rotor_inertia=(1.0,) * 6,
        noise=0.3,
    ),
)


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    made = tmp_path_factory.mktemp("calibrate")
    center = np.array([0.0, -1.3, 1.5, -1.0, 0.8, 0.0])
    motion = FourierTrajectory.draw(np.random.default_rng(4), center, np.full(6, 0.7), 6, 8.0)
    stretch = simulate(TRUTH, motion, 1, 125.0)
    assert stretch.torque is not None
    columns = {"timestamp": stretch.t}
    groups = (("actual_q", stretch.q), ("actual_qd", stretch.qd), ("joint_torque", stretch.torque))
    for name, array in groups:
        columns |= {f"{name}_{i}": array[:, i] for i in range(6)}
    write_columns(made / "free.csv", columns)
    (made / "scene.yaml").write_text("robot: ur5e\nbase_wrench: null\ndetail: coarse\n")
    return made


def test_a_scene_is_calibrated_and_written(folder: Path) -> None:
    files = [str(folder / "free.csv"), "--scene", str(folder / "scene.yaml")]
    where = ["--out", str(folder / "new.yaml"), "--report", str(folder / "report")]
    result = CliRunner().invoke(calibrate, [*files, *where, "--json"])
    assert result.exit_code == 0, result.output
    said = json.loads(result.stdout)
    before, after = said["residuals"]["before"]["rms"], said["residuals"]["after"]["rms"]
    assert all(b < 0.3 * a for a, b in zip(before[:6], after[:6], strict=True))
    assert before[6:] == after[6:] == [None] * 6
    scene = Scene.load(folder / "new.yaml")
    assert scene.detail == "coarse"
    assert scene.base_wrench is None
    assert scene.joint_torque is not None
    np.testing.assert_allclose(scene.joint_torque.friction.coulomb, 5.0, atol=0.6)
    assert (folder / "scene.yaml").read_text().endswith("detail: coarse\n")
    assert "residuals_0.png" in (folder / "report" / "report.md").read_text()
    assert (folder / "report" / "residuals_0.png").stat().st_size > 10_000


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["absent.csv", "--scene", "scene.yaml"], "absent.csv: cannot read the recording"),
        (["free.csv", "--scene", "absent.yaml"], "absent.yaml: cannot read the scene"),
    ],
)
def test_what_is_wrong_is_said(folder: Path, arguments: list[str], message: str) -> None:
    places = [str(folder / a) if "." in a else a for a in arguments]
    result = CliRunner().invoke(calibrate, places)
    assert result.exit_code == 1
    assert message in result.output
