"""`contactsense map`, as a user calls it."""

import json
import re
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner, Result
from matplotlib import pyplot as plt

from contactsense.service.cli.main import cli

POSTURE = ("--posture", "0,-75,90,-110,-90,0")


def call(*arguments: str) -> Result:
    return CliRunner().invoke(cli, ["map", *arguments])


@pytest.fixture
def scenes(tmp_path: Path) -> tuple[str, str]:
    """A scene with a base sensor, and the same arm without."""
    base, torques = tmp_path / "base.yaml", tmp_path / "torques.yaml"
    arm = "robot: ur5e\ndetail: coarse\ntouchable: [base, shoulder, forearm, wrist_1]\n"
    base.write_text(f"{arm}mounting: ceiling\n")
    torques.write_text(f"{arm}base_wrench: null\n")
    return str(base), str(torques)


@pytest.mark.slow
def test_a_table_by_link(scenes: tuple[str, str]) -> None:
    result = call(scenes[1], *POSTURE)
    assert result.exit_code == 0, result.output
    lines = result.stdout.splitlines()
    assert max(len(line) for line in lines) <= 80
    rows = {line.split()[0]: line.split() for line in lines if line.strip()}
    # No joint is below the base: nothing is measured there.
    assert rows["base"][3:] == ["-", "-", "-", "-", "-", "-"]
    assert float(rows["wrist_1"][3]) < float(rows["forearm"][3])
    assert rows["force:"][1] == "smallest"


@pytest.mark.slow
def test_the_errors_of_the_torque_model_are_told_beside_the_noise(tmp_path: Path) -> None:
    scene = tmp_path / "scene.yaml"
    sensor = "{noise: [1, 1, 1, 1, 1, 0.5], model_error: [3, 3, 3, 3, 3, 1], friction: {rest_error: 4}}"
    scene.write_text(f"robot: ur5e\nbase_wrench: null\njoint_torque: {sensor}\n")
    result = call(str(scene), *POSTURE)
    assert (
        result.stdout.splitlines()[0] == "ur5e: joint torques 0.5 to 1 Nm with model errors of 4.12 to 5 Nm"
    )


def test_a_sensor_that_the_weight_of_the_arm_saturates_is_told(scenes: tuple[str, str]) -> None:
    """It would not be used, and the map of whoever chooses it be wrong."""
    small, right = Path(scenes[0]).with_name("small.yaml"), scenes[0]
    small.write_text(Path(right).read_text() + "base_wrench: {range: [100, 500]}\n")
    told = call(str(small), "--compare", right, *POSTURE).stderr
    assert f"warning: {small}: base_wrench.range: expected more than 213 N in fz" in told
    assert f"warning: {right}" not in told


def test_each_scene_has_its_own_false_alarms(scenes: tuple[str, str]) -> None:
    strict, loose = map(Path, scenes)
    loose.write_text(strict.read_text() + "false_alarms_per_hour: 5\n")
    text = call(str(strict), "--compare", str(loose), *POSTURE).stdout
    assert "of the arm at rest, at 0.01 (A) and 5 (B) false alarms per hour" in text


@pytest.mark.slow
def test_two_scenes_side_by_side(scenes: tuple[str, str]) -> None:
    result = call(scenes[0], "--compare", scenes[1], *POSTURE)
    assert result.exit_code == 0, result.output
    lines = result.stdout.splitlines()
    rows = {line.split()[0]: line.split() for line in lines if line.strip()}
    assert max(len(line) for line in lines if not line.startswith(("A:", "B:"))) <= 80
    with_base, without = rows["forearm"][1:3]
    assert float(with_base) < 0.2 * float(without)


@pytest.mark.slow
def test_the_table_of_the_page(tmp_path: Path) -> None:
    """It changes with the surface of the arm. Other processors may round the last digit otherwise."""
    page = (Path(__file__).parents[2] / "docs" / "map.md").read_text(encoding="utf-8")
    with_base, torques_only = tmp_path / "with_base.yaml", tmp_path / "torques_only.yaml"
    with_base.write_text("robot: ur10e\n")
    torques_only.write_text("robot: ur10e\nbase_wrench: null\n")
    result = call(str(with_base), "--compare", str(torques_only), *POSTURE)
    assert result.exit_code == 0, result.output
    stated, found = ({row[0]: row[1:] for row in _rows(text)} for text in (page, result.stdout))
    assert len(found) == 7
    assert stated.keys() == found.keys()
    for link, row in found.items():
        for mine, theirs in zip(row, stated[link], strict=True):
            assert (mine == "-") == (theirs == "-")
            if mine != "-":
                digit = 10.0 ** -len(mine.partition(".")[2])
                assert float(theirs) == pytest.approx(float(mine), abs=1.5 * digit)


def _rows(text: str) -> list[list[str]]:
    """Rows of the table of two scenes: a link and six numbers."""
    rows = [line.split() for line in text.splitlines()]
    return [row for row in rows if len(row) == 7 and re.fullmatch(r"-|[\d.]+", row[1])]


@pytest.mark.long
def test_a_picture_of_two_scenes(scenes: tuple[str, str], tmp_path: Path) -> None:
    picture = tmp_path / "map.png"
    result = call(scenes[0], "--compare", scenes[1], *POSTURE, "--picture", str(picture))
    assert result.exit_code == 0, result.output
    image = plt.imread(picture)[..., :3]
    # Grey where nothing is measured, colours elsewhere.
    colourful = np.ptp(image, axis=2) > 0.2
    upper, lower = np.array_split(colourful, 2)
    assert upper.sum() > 1.2 * lower.sum() > 0


@pytest.mark.slow
def test_a_picture_where_nothing_can_be_felt(tmp_path: Path) -> None:
    """Joint torques alone measure nothing on the base."""
    scene, picture = tmp_path / "base.yaml", tmp_path / "map.png"
    scene.write_text("robot: ur5e\ndetail: coarse\ntouchable: [base]\nbase_wrench: null\n")
    result = call(str(scene), *POSTURE, "--picture", str(picture))
    assert result.exit_code == 0, result.output
    # The arm is grey, and there is no scale of colours.
    assert np.ptp(plt.imread(picture)[..., :3], axis=2).max() < 0.1


def test_json_has_every_place(scenes: tuple[str, str]) -> None:
    result = call(scenes[1], *POSTURE, "--json", "--force", "50", "--detection", "0.5")
    (found,) = json.loads(result.stdout)["maps"]
    assert (found["force"], found["detection"], found["friction"]) == (50.0, 0.5, 0.0)
    places = found["places"]
    assert sum(places["share"]) == pytest.approx(1.0)
    assert {len(values) for values in places.values()} == {len(places["link"])}
    # Where nothing is measured, null.
    assert places["smallest_force"][places["link"].index("base")] is None
    assert [link["link"] for link in found["links"]][:2] == ["base", "shoulder"]


@pytest.mark.parametrize(
    ("arguments", "status", "message"),
    [
        (("none.yaml", *POSTURE), 1, "none.yaml: cannot read the scene: No such file"),
        (("SCENE",), 2, "Missing option '--posture'"),
        (
            ("SCENE", "--posture", "0,1"),
            2,
            "--posture: expected 6 angles in degrees, separated by commas, got '0,1'",
        ),
        (
            ("SCENE", "--posture", "0,a"),
            2,
            "--posture: expected 6 angles in degrees, separated by commas, got '0,a'",
        ),
        (("SCENE", "--posture", "0,0,400,0,0,0"), 2, "elbow_joint: expected -180 to 180 degrees, got 400"),
        (("SCENE", *POSTURE, "--force", "-1"), 2, "'--force': -1.0 is not in the range 0.0<x<=5000.0"),
        (("SCENE", *POSTURE, "--detection", "1.5"), 2, "'--detection': 1.5 is not in the range 0.0<x<1.0"),
        (("SCENE", *POSTURE, "--picture", "map.jpg"), 2, "'--picture': expected a name that ends in .png"),
        (("SCENE", *POSTURE, "--picture", "no/such/folder.png"), 1, "no/such/folder.png: cannot write"),
    ],
)
def test_wrong_use_is_told(
    scenes: tuple[str, str], arguments: tuple[str, ...], status: int, message: str
) -> None:
    result = call(*(scenes[0] if argument == "SCENE" else argument for argument in arguments))
    assert result.exit_code == status
    assert message in result.output


def test_arms_with_other_joints_cannot_be_compared(scenes: tuple[str, str], tmp_path: Path) -> None:
    link = "{mass: 1, com: [0, 0, 0], tensor: [1, 0, 0, 1, 0, 1], name: "
    (tmp_path / "one.yaml").write_text(
        f"name: one\nlinks: [{link}a}}, {link}b}}]\njoints: [{{name: j, xyz: [0, 0, 1], rpy: [0, 0, 0], "
        "velocity_limit: 90, torque_limit: 10}]\n"
    )
    sphere = "[{kind: sphere, center: [0, 0, 0.1], radius: 0.1}]"
    (tmp_path / "one.surface.yaml").write_text(
        f"robot: one\nlinks: {{b: {{fine: {sphere}, coarse: {sphere}}}}}\n"
    )
    other = tmp_path / "other.yaml"
    other.write_text(f"robot: {tmp_path / 'one.yaml'}\n")
    result = call(scenes[0], "--compare", str(other), *POSTURE)
    assert result.exit_code == 1
    assert "--compare: expected an arm with 6 joints" in result.output
