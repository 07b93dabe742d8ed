"""`contactsense scene new` and `contactsense scene show`."""

import json
from pathlib import Path

import pytest
from click.testing import CliRunner, Result

from contactsense import Scene, WrenchSensor
from contactsense.sensors.settings import JointTorqueSensor
from contactsense.service.cli import scene_new, serve
from contactsense.service.cli.main import cli
from tests.service.seven_joints import seven_joints


def _run(*words: object, answers: str | None = None) -> Result:
    return CliRunner().invoke(cli, ["scene", *map(str, words)], input=answers)


def test_options_become_fields(tmp_path: Path) -> None:
    path = tmp_path / "cell.yaml"
    result = _run(
        "new", path, "--robot", "ur10e", "--mounting", "0,0.5236,0", "--tool-mass", 1.2,
        "--tool-com", "0,0,0.06", "--base-sign", "sensor_on_arm", "--base-noise", "0.3,0.05",
        "--base-range", "2000,400", "--torque-signal", "actual_current", "--torque-noise", "2",
        "--touchable", "forearm, wrist_3", "--link-prior", "equal",
    )  # fmt: skip
    assert result.exit_code == 0, result.output
    scene = Scene.load(path)
    assert scene.mounting == (0.0, 0.5236, 0.0)
    assert scene.tool is not None
    assert scene.tool.com == (0.0, 0.0, 0.06)
    assert scene.base_wrench is not None
    assert (scene.base_wrench.sign, scene.base_wrench.force_noise) == ("sensor_on_arm", 0.3)
    assert scene.base_wrench.limits.tolist() == [2000.0] * 3 + [400.0] * 3
    assert scene.joint_torque is not None
    assert scene.joint_torque.noise == 2.0
    assert scene.touchable == ("forearm", "wrist_3")
    assert scene.link_prior == "equal"


def test_a_tool_and_a_base_sensor_are_described(tmp_path: Path) -> None:
    path = tmp_path / "Zelle Süd" / "a.yaml"
    path.parent.mkdir()
    tool = ["--tool-name", "Greifer Ü 1", "--tool-mass", "0.5"]
    result = _run("new", path, "--robot", "ur5e", *tool, "--base-translation", "0,0,-0.05")
    assert result.exit_code == 0, result.output
    assert f"contactsense scene show '{path}'" in result.output  # to be copied into a shell
    assert "  name: Greifer Ü 1\n" in path.read_text(encoding="utf-8")
    scene = Scene.load(path)
    assert scene.tool is not None
    assert scene.tool.name == "Greifer Ü 1"
    assert scene.base_wrench == WrenchSensor(translation=(0.0, 0.0, -0.05))
    for option, sensor in (("--base-sensor", WrenchSensor()), ("--no-base-sensor", None)):
        assert _run("new", path, "--force", "--robot", "ur5e", option).exit_code == 0
        assert Scene.load(path).base_wrench == sensor


def test_joint_torques_are_described(tmp_path: Path) -> None:
    path = tmp_path / "a.yaml"
    robot = ["new", path, "--force", "--robot", "ur5e"]
    fields = ",".join(f" output_double_register_{i}" for i in range(24, 30))
    assert _run(*robot, "--torque-signal", "external_torque", "--torque-fields", fields).exit_code == 0
    assert Scene.load(path).joint_torque == JointTorqueSensor(
        signal="external_torque", fields=tuple(f"output_double_register_{i}" for i in range(24, 30))
    )
    currents = ["--torque-signal", "actual_current_minus_target"]
    assert _run(*robot, *currents, "--torque-constants", "11,11,11,8,8,8").exit_code == 0
    assert Scene.load(path).joint_torque == JointTorqueSensor(
        signal="actual_current_minus_target", torque_constants=(11.0, 11.0, 11.0, 8.0, 8.0, 8.0)
    )
    assert _run(*robot, "--torque-signal", "none").exit_code == 0
    assert Scene.load(path).joint_torque is None


def test_a_wrist_sensor_is_described_as_one_under_the_base(tmp_path: Path) -> None:
    """The e-Series arm of docs/sensors.md: no sensor under the base, one in the flange."""
    path = tmp_path / "a.yaml"
    e_series = ["new", path, "--robot", "ur10e", "--no-base-sensor", "--tool-mass", 1.2]
    wrist = ["--wrist-noise", "5.5,0.5", "--wrist-range", "100,10", "--wrist-translation", "0,0,-0.01"]
    result = _run(*e_series, *wrist, "--wrist-sign", "sensor_on_arm", "--wrist-rpy", "0,0,1.57")
    assert result.exit_code == 0, result.output
    scene = Scene.load(path)
    assert scene.base_wrench is None
    assert scene.wrist_wrench == WrenchSensor(
        force_noise=5.5,
        moment_noise=0.5,
        range=(100.0, 10.0),
        translation=(0.0, 0.0, -0.01),
        rpy=(0.0, 0.0, 1.57),
        sign="sensor_on_arm",
    )
    assert _run(*e_series, "--force", "--wrist-sensor").exit_code == 0
    assert Scene.load(path).wrist_wrench == WrenchSensor()
    assert _run(*e_series, "--force").exit_code == 0
    assert Scene.load(path).wrist_wrench is None


def test_the_robot_alone_gives_the_default_scene(tmp_path: Path) -> None:
    assert _run("new", tmp_path / "a.yaml", "--robot", "ur5e").exit_code == 0
    assert Scene.load(tmp_path / "a.yaml").model_dump() == Scene(robot="ur5e").model_dump()


def test_a_terminal_is_asked_for_what_is_missing(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(scene_new, "_on_terminal", lambda: True)
    answers = (
        "ur3e\nceiling\n0.8\n0,0,0.05\ny\nsensor_on_arm\n0,0,-0.04\n0,0,30\n0,0,0.5\n500,20\nactual_current\n"
        "y\n\n\n\n80,8\n"
    )
    # 30 is an angle in degrees: refused, and nothing is written.
    refused = _run("new", tmp_path / "a.yaml", answers=answers.replace("0,0,0.5\n", ""))
    assert refused.exit_code == 1
    assert "base_wrench.rpy" in refused.output
    assert not (tmp_path / "a.yaml").exists()
    result = _run("new", tmp_path / "a.yaml", answers=answers.replace("0,0,30\n", ""))
    assert result.exit_code == 0, result.output
    scene = Scene.load(tmp_path / "a.yaml")
    assert (scene.robot.name, scene.mounting) == ("ur3e", "ceiling")
    assert scene.base_wrench is not None
    assert (scene.base_wrench.rpy, scene.base_wrench.range) == ((0.0, 0.0, 0.5), (500.0, 20.0))
    assert scene.wrist_wrench == WrenchSensor(range=(80.0, 8.0))


@pytest.mark.parametrize(
    ("words", "status", "message"),
    [
        ([], 2, "--robot: expected one of"),
        (["--robot", "ur55"], 1, "robot: unknown robot 'ur55'"),
        (["--robot", "ur5e", "--mounting", "0,30,0"], 1, "mounting: expected roll, pitch, yaw in rad"),
        (
            ["--robot", "ur5e", "--mounting", "floor"],
            2,
            "--mounting': expected table, ceiling, wall or roll,pitch,yaw in rad, got 'floor'",
        ),
        (["--robot", "ur5e", "--tool-com", "0,0,0.1"], 2, "--tool-mass: expected the mass"),
        (["--robot", "ur5e", "--no-base-sensor", "--base-rpy", "0,0,1"], 2, "--no-base-sensor: expected no"),
        (
            ["--robot", "ur5e", "--no-wrist-sensor", "--wrist-noise", "4,0.3"],
            2,
            "--no-wrist-sensor: expected",
        ),
        (["--robot", "ur5e", "--no-base-sensor", "--torque-signal", "none"], 1, "expected at least one"),
        (["--robot", "ur5e", "--torque-signal", "external_torque"], 1, "joint_torque.fields: expected the 6"),
        (["--robot", "ur5e", "--torque-fields", "a,,c,d,e,f"], 1, "fields[1]: expected text that is not emp"),
        (
            ["--robot", "ur5e", "--torque-signal", "none", "--torque-noise", "2"],
            2,
            "expected no other option",
        ),
        (["--robot", "ur5e", "--torque-constants", "1,1,1,1,1,1"], 2, "expected --torque-signal actual_curr"),
        (["--robot", "ur5e", "--tool-mass", "1", "--tool-name", ""], 1, "tool.name: expected text that is n"),
        (["--robot", "ur5e", "--base-translation", "0,0,-50"], 1, "if these are mm: [0, 0, -0.05]"),
        (["--robot", "ur5e", "--touchable", ""], 1, "touchable: expected links of base"),
    ],
)
def test_what_cannot_be_is_one_line_and_nothing_is_written(
    tmp_path: Path, words: list[str], status: int, message: str
) -> None:
    result = _run("new", tmp_path / "a.yaml", *words)
    assert result.exit_code == status
    assert message in result.output
    assert list(tmp_path.iterdir()) == []


def test_a_file_is_overwritten_by_force_only(tmp_path: Path) -> None:
    path = tmp_path / "a.yaml"
    path.write_text("mine")
    refused = _run("new", path, "--robot", "ur5e")
    assert (refused.exit_code, path.read_text()) == (1, "mine")
    assert "--force overwrites it" in refused.output
    assert _run("new", path, "--robot", "ur5e", "--force").exit_code == 0
    assert Scene.load(path).robot.name == "ur5e"


@pytest.mark.slow
def test_show_prints_what_was_understood(tmp_path: Path) -> None:
    path = tmp_path / "a.yaml"
    path.write_text("robot: ur10e\nmounting: wall\nbase_wrench: {range: [500, 20]}\n")
    result = _run("show", path)
    assert result.exit_code == 0, result.output
    assert "base z axis 90.0 deg from the vertical" in result.output
    assert "warning: base_wrench.range: expected more than" in result.output
    plain = json.loads(_run("show", path, "--json", "--posture", "0,-90,0,0,0,0").stdout)
    assert json.loads(_run("show", path, "--json", "--pose", "0,-90,0,0,0,0").stdout) == plain
    assert plain["gravity_base"] == pytest.approx([9.81, 0.0, 0.0])
    assert plain["link_prior"]["upper_arm"] > 0.3 > 0.1 > plain["link_prior"]["wrist_3"]
    assert plain["base_reading_at_rest"][0] == pytest.approx(9.81 * plain["mass"])


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (["gone.yaml"], "cannot read the scene"),
        (
            ["a.yaml", "--posture", "1,2"],
            "--posture: expected 6 angles in degrees, separated by commas, got '1,2'",
        ),
        (["a.yaml", "--picture", "a.jpg"], "'--picture': expected a name that ends in .png, got a.jpg"),
        (["a.yaml", "--picture", "no/where.png"], "no/where.png: cannot write the picture: No such file"),
    ],
)
def test_what_cannot_be_shown_is_one_line(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, words: list[str], message: str
) -> None:
    monkeypatch.chdir(tmp_path)
    Path("a.yaml").write_text("robot: ur5e\n")
    result = _run("show", *words)
    assert result.exit_code in (1, 2)
    assert message in result.output


def test_serve_warns_of_a_range_that_is_too_small(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    def in_use(host: str, port: int) -> None:
        raise OSError(98, "Address already in use")

    monkeypatch.setattr(serve.logs, "configure", lambda *_: None)
    monkeypatch.setattr(serve, "listen", in_use)
    (tmp_path / "a.yaml").write_text("robot: ur10e\nbase_wrench: {range: [500, 20]}\n")
    result = CliRunner().invoke(cli, ["serve", "--scene", str(tmp_path / "a.yaml")])
    assert result.exit_code == 1
    assert "scene: base_wrench.range: expected more than" in caplog.text


def test_a_scene_elsewhere_names_the_same_arm(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    seven_joints(tmp_path)
    (tmp_path / "cell").mkdir()
    monkeypatch.chdir(tmp_path)
    assert _run("new", "cell/a.yaml", "--robot", "seven.urdf").exit_code == 0
    assert "robot: ../seven.urdf" in Path("cell/a.yaml").read_text(encoding="utf-8")
    assert Scene.load("cell/a.yaml").robot.name == "seven"


@pytest.mark.slow
def test_the_error_of_the_surface_is_shown(tmp_path: Path) -> None:
    """Each place has an error of its own where the surface file states it, unless the scene has another."""
    seven_joints(tmp_path)
    (tmp_path / "own.yaml").write_text("robot: ur5e\n")
    (tmp_path / "same.yaml").write_text("robot: ur5e\nsurface_error: 0.001\n")
    tool = "tool:\n  primitives: [{kind: sphere, center: [0, 0, 0.1], radius: 0.05}]\n"
    (tmp_path / "tool.yaml").write_text(f"robot: ur5e\n{tool}  deviation: |\n    0 0 0 150 0.4 5\n")
    shown = {
        name: " ".join(_run("show", tmp_path / f"{name}.yaml").output.split())
        for name in ("own", "same", "seven", "tool")
    }
    assert "as far from the skin as fine_deviation of the surface file says" in shown["own"]
    assert "0.1 x 0.1 x 0.1 m along its axes, as far from the skin as deviation says" in shown["tool"]
    assert "detail fine, within 1 mm (one sigma)" in shown["same"]
    assert "detail fine, within 0.5 mm (one sigma)" in shown["seven"]
