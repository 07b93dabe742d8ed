"""The scenes of a dataset's robots: whose they are, and what happens where one has none."""

import json
import re
from pathlib import Path

import pyarrow.parquet as pa_parquet
import pytest
from click.testing import CliRunner

from contactsense.scene import Scene, SceneError
from contactsense.service.analysis.fleet.report import write_fleet_report
from contactsense.service.analysis.fleet.run import analyze_fleet
from contactsense.service.analysis.fleet.scenes import robot_scenes
from contactsense.service.analysis.fleet.segments import find_recordings
from contactsense.service.analysis.fleet.summary import settings_of
from contactsense.service.cli.analyze import analyze
from tests.service.analysis.datasets import carrying, dataset
from tests.service.analysis.recordings import demo, write_motion


def test_each_robot_may_have_its_own_scene(tmp_path: Path, scene: Path) -> None:
    data = dataset(tmp_path / "data")
    files = find_recordings((data,))
    assert robot_scenes(scene, files, tmp_path).paths == {"a": scene.resolve(), "b": scene.resolve()}
    with pytest.raises(
        SceneError, match=r"robot a: expected a scene file .*robot=a/scene.yaml, .* carries no scene"
    ):
        robot_scenes(None, files, tmp_path)
    for robot in "ab":
        (data / f"robot={robot}" / "scene.yaml").write_text("robot: ur5e\n")
    assert robot_scenes(None, files, tmp_path).paths["b"] == data / "robot=b" / "scene.yaml"
    folder = tmp_path / "scenes"
    folder.mkdir()
    (folder / "a.yaml").write_text("robot: ur5e\n")
    found = robot_scenes(folder, files, tmp_path)
    assert found.paths == {"a": (folder / "a.yaml").resolve()}
    assert re.match(r"robot b: expected a scene file .*b.yaml", found.missing["b"])


@pytest.mark.slow
def test_results_of_an_arm_whose_own_files_have_changed_are_made_again(tmp_path: Path) -> None:
    """The scene names the arm's file, which names that of the surface: its text does not change."""
    library = Path(str(Scene(robot="ur5e").robot.file)).parent
    arm, surface, scene = (tmp_path / name for name in ("my.yaml", "my.surface.yaml", "scene.yaml"))
    arm.write_text((library / "ur5e.yaml").read_text().replace("name: ur5e", "name: my", 1))
    surface.write_text((library / "ur5e.surface.yaml").read_text())
    scene.write_text("robot: my.yaml\n")
    path = write_motion(demo(), tmp_path / "one.parquet", last=500)

    def parts() -> int:
        analyze_fleet((path,), scene, tmp_path / "out")
        return len(list((tmp_path / "out" / "parts").iterdir()))

    assert [parts(), parts()] == [1, 1]
    arm.write_text(re.sub("mass: [0-9.]+", "mass: 5.5", arm.read_text(), count=1))
    assert parts() == 2
    surface.write_text(re.sub("radius_a: [0-9.]+", "radius_a: 0.05", surface.read_text(), count=1))
    assert parts() == 3


def test_a_folder_of_meshes_belongs_to_the_settings(tmp_path: Path) -> None:
    scene = Scene(robot="ur5e", meshes=tmp_path)
    before = settings_of(scene)
    assert settings_of(scene) == before
    (tmp_path / "forearm.ply").write_text("ply")
    assert settings_of(scene) != before


def test_one_broken_file_or_one_robot_without_a_scene_does_not_end_the_analysis(tmp_path: Path) -> None:
    data, out = tmp_path / "data", tmp_path / "out"
    carrying(data, "a", None, Scene(robot="ur5e", clear=0.9))
    carrying(data, "b", None, None)
    (data / "robot=c").mkdir()
    write_motion(demo(), data / "robot=c" / "0.parquet", last=2300)
    (data / "robot=c" / "scene.yaml").write_text("robot: ur5f\n")
    result = CliRunner().invoke(analyze, [str(data), "--out", str(out), "--json"])
    assert result.exit_code == 1
    found = json.loads(result.stdout)
    assert found["contacts"] == 1
    assert next(robot["recordings"] for robot in found["robots"] if robot["robot"] == "a") == 1
    assert "recordings that were skipped: 4" in result.stderr
    without, wrong, broken = found["problems"]
    assert without.startswith("robot b: expected a scene file")
    assert without.endswith("2 recordings were skipped")
    assert wrong.startswith("robot c: ")
    assert "ur5f" in wrong
    assert broken.startswith("robot=a/0.parquet: cannot read the recording")
    assert {row["robot"]: row["has_scene"] for row in found["robots"]} == {"a": True, "b": False, "c": False}
    written = pa_parquet.read_table(out / "robots.parquet")
    assert written["robot"].to_pylist() == ["a", "b", "c"]
    assert written["recordings"].to_pylist() == [1, 0, 0]
    assert written["contacts_per_hour"].to_pylist()[1:] == [None, None]
    shown = (out / "fleet.md").read_text()
    assert "3 robots, 1 recording" in shown
    rows = [[cell.strip() for cell in line.split("|")[1:-1]] for line in shown.splitlines()]
    rows = [row for row in rows if row and row[0] in ("a", "b", "c")]
    assert [row[0] for row in rows] == ["a", "b", "c"]
    assert [row[-1] == "no scene" for row in rows] == [False, True, True]
    assert rows[1][1:5] == ["0", "0.00", "0", "unknown"]
    assert (out / "fleet.html").read_text().count('<span class="bad">no scene</span>') == 2


def test_robots_whose_sensors_determine_no_force_are_named(tmp_path: Path) -> None:
    data, out = tmp_path / "data", tmp_path / "out"
    carrying(data, "a", Scene(robot="ur5e"))
    carrying(data, "b", Scene(robot="ur5e", base_wrench=None))
    result = CliRunner().invoke(analyze, [str(data), "--out", str(out)])
    assert result.exit_code == 0, result.output
    for text in (result.stdout, (out / "fleet.html").read_text()):
        assert text.count("joint torques alone do not determine a force") == 1
        assert "b: No force/torque sensor measures pushes" in text


def test_recordings_that_carry_other_scenes_than_the_one_that_is_used_are_named(tmp_path: Path) -> None:
    """As of two arms in one folder, or of an arm before and after its calibration."""
    data, scene = tmp_path / "data", tmp_path / "scene.yaml"
    right, other = Scene(robot="ur5e"), Scene(robot="ur5e", clear=0.9)
    carrying(data, "a", None, right, right, other)
    carrying(data, "b", other)
    scene.write_text("robot: ur5e\n")
    named = [text for text in analyze_fleet((data,), None, tmp_path / "out").problems if "--scene" in text]
    assert len(named) == 1
    assert named[0].startswith(
        "robot a: robot=a/3.parquet: analysed with the scene that robot=a/1.parquet carries"
    )
    # Who names a scene means it for all.
    assert not any("--scene" in text for text in analyze_fleet((data,), scene, tmp_path / "out").problems)


def test_a_folder_of_scenes_may_lack_one(tmp_path: Path) -> None:
    data, scenes = tmp_path / "data", tmp_path / "scenes"
    for robot in "ab":
        carrying(data, robot, Scene(robot="ur5e"))
    scenes.mkdir()
    (scenes / "b.yaml").write_text("robot: ur5e\n")
    arguments = [str(data), "--scene", str(scenes), "--out", str(tmp_path / "out")]
    result = CliRunner().invoke(analyze, arguments)
    assert result.exit_code == 1
    assert "robot a: expected a scene file" in result.stderr
    assert "recordings that were skipped: 1" in result.stderr
    assert "| b | 1 |" in result.stdout


@pytest.mark.long
def test_the_scene_of_a_robot_is_used_for_its_recordings_only(tmp_path: Path) -> None:
    data = dataset(tmp_path / "data")
    (data / "robot=a" / "scene.yaml").write_text("robot: ur5e\n")
    (data / "robot=b" / "scene.yaml").write_text("robot: ur10e\nfalse_alarms_per_hour: 1\n")
    found = analyze_fleet((data,), None, tmp_path / "out")
    assert [robot.scene.robot.name for robot in found.robots] == ["ur5e", "ur10e"]
    # The other arm's masses: everything looks like a contact.
    assert found.robots[0].contacts == 16
    assert found.robots[1].touched > 0.5 * found.robots[1].samples
    write_fleet_report(found, tmp_path / "out")
    text = (tmp_path / "out" / "fleet.html").read_text()
    assert text.count('<canvas class="arm" ') == 2
    assert "<h3>ur10e: b</h3>" in text
    (data / "robot=b" / "scene.yaml").write_text("robot: ur5e\n")
    parts = {path.stat().st_mtime_ns for path in (tmp_path / "out" / "parts").rglob("*.json")}
    again = analyze_fleet((data,), None, tmp_path / "out")
    assert [robot.contacts for robot in again.robots] == [16, 8]
    kept = [p for p in (tmp_path / "out" / "parts").rglob("*.json") if p.stat().st_mtime_ns in parts]
    assert len(kept) == len(parts)
