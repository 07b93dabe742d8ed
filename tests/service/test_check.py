"""`contactsense check` as its users run it."""

import json
from dataclasses import replace
from io import StringIO
from pathlib import Path

import numpy as np
import pytest
import yaml
from click.testing import CliRunner
from rich.console import Console

from contactsense.benchmarks.calibration.link_sensor_draws import ELBOW, WRIST
from contactsense.benchmarks.calibration.setup_draws import Settings, right_setup
from contactsense.calibration import FreeMotion, SuspectedContact
from contactsense.scene import Scene
from contactsense.scene_model.link_sensor_frame import LinkSensorFrame
from contactsense.sensors.link_values import as_fields, column_of
from contactsense.sensors.settings import Friction, per_joint
from contactsense.service.cli.check import check, print_check
from contactsense.service.mock.arm.script import Script
from contactsense.service.mock.arm.simulated_arm import simulate
from contactsense.service.mock.servers import MockServers, MockSettings
from contactsense.service.recordings.export import write_columns
from contactsense.service.recordings.free_motion import read_free_motion
from contactsense.service.sensors.clients.robot_stream import SensorError
from contactsense.service.sensors.live_free_motion import _free_motion
from contactsense.service.sensors.source_settings import SourceSettings
from contactsense.setup_check import Finding, Residuals, SetupCheck
from contactsense.setup_check import check as run
from contactsense.setup_check.result import FITS_BETTER, NOT_RECORDED
from contactsense.types import Sample
from tests.service.loopback import own_address, until


def _write(path: Path, part: FreeMotion) -> None:
    columns = {"timestamp": part.t}
    groups = {"actual_q": part.q, "actual_qd": part.qd, "joint_torque": part.torque}
    for field, readings in part.link_readings.items():
        groups[column_of(field)] = readings
    for name, array in {**groups, "base_wrench": part.reading}.items():
        assert array is not None
        columns |= {f"{name}_{i}": array[:, i] for i in range(array.shape[1])}
    write_columns(path, columns)


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    made = tmp_path_factory.mktemp("check")
    case = right_setup("ur5e", 1, Settings(seconds=10.0))
    content = case.scene.model_dump(mode="json", exclude_defaults=True)
    (made / "right.yaml").write_text(yaml.safe_dump(content))
    roll, pitch, yaw = content["mounting"]
    (made / "wrong.yaml").write_text(yaml.safe_dump({**content, "mounting": [roll, -pitch, yaw]}))
    _write(made / "free.csv", case.recording)
    degrees = replace(case.recording, q=np.degrees(case.recording.q), qd=np.degrees(case.recording.qd))
    _write(made / "degrees.csv", degrees)
    return made


def _printed(found: SetupCheck, scene: Scene | None = None) -> str:
    console = Console(file=StringIO(), width=120)
    print_check(found, scene or Scene(robot="ur5e"), console)
    assert isinstance(console.file, StringIO)
    return console.file.getvalue()


def test_where_nothing_can_be_told_and_residuals_remain_a_contact_is_suspected() -> None:
    findings = (Finding("mounting", "cannot_tell", "table"), Finding("tool.mass", "cannot_tell", "0.909"))
    left = Residuals(5.0, 1.0, 2.0)
    text = _printed(SetupCheck(findings, left, ("base sensor's force x: residual 5 N",), 10.0))
    assert "Something may have touched the arm: repeat without contact" in text
    assert "To determine the other lines, move more joints" not in text
    assert "To determine the other lines, move more joints" in _printed(SetupCheck(findings, left, (), 10.0))


def test_contacts_are_named_before_the_lines() -> None:
    findings = (Finding("mounting", "cannot_tell", "table"),)
    contact = SuspectedContact("free.csv", 4.86, 7.29, 607, 911, (8,), (18.4,))
    found = SetupCheck(findings, Residuals(5.0, 1.0, 2.0), (), 10.0, contacts=(contact,))
    first, second, *rest = _printed(found).splitlines()
    assert first == "Left out: something seems to push on the arm"
    assert second == "- free.csv: 4.86 to 7.29 s (rows 607 to 911), seen in base force z (18.4 N)"
    assert any("--keep-contacts uses them" in line for line in rest)
    unexplained = ("base sensor's force z: residual 5 N",)
    kept = replace(found, unexplained=unexplained, contacts_left_out=False)
    first, second, *rest = _printed(kept).splitlines()
    assert first.startswith("Something seems to push on the arm, for too long to be left out")
    assert "free.csv: 4.86 to 7.29 s" in second
    assert not any("move more joints" in line or "--keep-contacts" in line for line in rest)


def test_lines_of_a_sensor_that_was_not_recorded_need_no_other_motion() -> None:
    lines = Finding("mounting", "fits", "table"), Finding("base_wrench.rpy", "cannot_tell", "[0, 0, 0]")
    lacking = (lines[0], replace(lines[1], remark=NOT_RECORDED))
    left = Residuals(None, None, 0.1)
    assert "To determine the other lines" in _printed(SetupCheck(lines, left, (), 10.0))
    text = _printed(SetupCheck(lacking, left, (), 10.0))
    assert "not recorded" in text
    assert "To determine the other lines" not in text


def test_a_value_that_fits_better_is_shown_though_it_is_not_proposed() -> None:
    """A base sensor displaced by 30 mm, where velocities are noisy and the motion takes a few seconds."""
    place, remark = "base_wrench.translation", f"{FITS_BETTER}: [0, 0, -0.065]"
    better = Finding(place, "cannot_tell", "[0, 0, -0.035]", remark=remark)
    as_well = Finding("base_wrench.rpy", "cannot_tell", "[0, 0, 0]", remark="another value fits as well")
    text = _printed(SetupCheck((better, as_well), Residuals(None, None, 0.1), (), 10.0))
    assert f"{place}: {remark} m\n" in text
    assert "as well" not in text


def test_values_have_their_units() -> None:
    stated = {
        "mounting": ("[0.1, 0, 0]", "[0.1, 0, 0] rad"),
        "tool": ("mass 0.909, com [0, 0, 0.06]", "mass 0.909 kg, com [0, 0, 0.06] m"),
        "tool.mass": ("0.909", "0.909 kg"),
        "tool.com": ("[0, 0, 0.06]", "[0, 0, 0.06] m"),
        "base_wrench.delay": ("0.0120", "0.0120 s"),
        "base_wrench.range": ("[1800, 350]", "[1800, 350] N, Nm"),
        "wrist_wrench.bias": ("[1, 2, 3, 0.1, 0.2, 0.3]", "[1, 2, 3, 0.1, 0.2, 0.3] N, Nm"),
    }
    findings = tuple(Finding(line, "fits", value) for line, (value, _) in stated.items())
    wrong = Finding("base_wrench.delay", "does_not_fit", "0.0000", "0.0080")
    text = _printed(SetupCheck((*findings, wrong), Residuals(None, None, 0.1), (), 10.0))
    for _, value in stated.values():
        assert value in text
    assert "this would: 0.0080 s" in text


def test_values_that_are_words_have_no_unit() -> None:
    wrong = (
        Finding("mounting", "does_not_fit", "[3.14, 0, 0]", "ceiling"),
        Finding("base_wrench.range", "does_not_fit", "[100, 20]", "a sensor of larger range"),
    )
    text = _printed(SetupCheck(wrong, Residuals(None, None, 0.1), (), 10.0))
    assert "this would: ceiling\n" in text
    assert "this would: a sensor of larger range\n" in text


def test_a_right_scene_fits(folder: Path) -> None:
    result = CliRunner().invoke(check, [str(folder / "right.yaml"), str(folder / "free.csv")])
    assert result.exit_code == 0, result.output
    assert "Nothing contradicts the scene" in result.output
    assert "does not fit" not in result.output


@pytest.mark.slow
def test_a_bias_that_a_stream_takes_for_a_contact_is_told(folder: Path) -> None:
    """A sensor that was tared, or whose zero was not measured, contradicts no line, and fits no stream."""
    scene = Scene.load(folder / "right.yaml")
    assert scene.base_wrench is not None
    off = np.array([5.0, -3.0, 2.0, 0.3, 0.1, -0.2])
    parts, _ = read_free_motion(folder / "free.csv", scene)
    known = run(scene, parts).base_offset or np.zeros(6)  # that of links whose mass differs from their data
    biased = [replace(part, reading=part.reading + off) for part in parts if part.reading is not None]
    found = run(scene, biased)
    assert found.fits
    assert found.base_offset is not None
    np.testing.assert_allclose(found.base_offset, known + off, atol=1e-6)
    force = ", ".join(f"{value:.3g}" for value in found.base_offset[:3])
    assert f"The base sensor reads ({force}) N, (" in _printed(found)
    bias = tuple((np.array(scene.base_wrench.bias) + found.base_offset).tolist())
    stated = scene.model_copy(update={"base_wrench": scene.base_wrench.model_copy(update={"bias": bias})})
    assert run(stated, biased).base_offset is None
    # With a wrong line it would be as wrong as what is proposed for that.
    wrong = run(Scene.load(folder / "wrong.yaml"), biased)
    assert wrong.wrong
    assert wrong.base_offset is None


@pytest.mark.slow
def test_friction_of_which_the_scene_states_none_is_told(folder: Path) -> None:
    """It contradicts no line, and a stream takes it for contacts of all joints that move."""
    scene = Scene.load(folder / "right.yaml")
    assert scene.joint_torque is not None
    parts, _ = read_free_motion(folder / "free.csv", scene)
    known = run(scene, parts)
    assert known.fits
    assert known.friction is None
    none = scene.joint_torque.model_copy(update={"friction": Friction()})
    found = run(scene.model_copy(update={"joint_torque": none}), parts)
    assert found.fits
    true = per_joint(scene.joint_torque.friction.coulomb, 6)
    np.testing.assert_allclose(found.friction, true, atol=0.15 * true.max())
    assert "The joint torques contain Coulomb friction of about (" in _printed(found)
    quiet = none.model_copy(update={"model_error": float(true.max())})
    assert run(scene.model_copy(update={"joint_torque": quiet}), parts).friction is None


@pytest.mark.slow
def test_a_short_push_is_no_bias(folder: Path) -> None:
    """Its mean over the recording is far beyond the noise, and calibration would rightly change nothing."""
    scene = Scene.load(folder / "right.yaml")
    assert scene.base_wrench is not None
    parts, _ = read_free_motion(folder / "free.csv", scene)
    off = np.array(run(scene, parts).base_offset or np.zeros(6))
    bias = tuple((np.array(scene.base_wrench.bias) + off).tolist())
    stated = scene.model_copy(update={"base_wrench": scene.base_wrench.model_copy(update={"bias": bias})})
    (part,) = parts
    assert part.reading is not None
    during = (part.t > part.t[0] + 4.0) & (part.t < part.t[0] + 5.5)
    pushed = part.reading + np.outer(during, [0.0, 0.0, 12.0, 0.0, 0.0, 0.0])
    found = run(stated, [replace(part, reading=pushed)])
    assert found.fits
    assert found.base_offset is None


@pytest.mark.slow
def test_a_wrong_line_is_named_with_the_value_that_fits(
    folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("COLUMNS", "80")
    arguments = [str(folder / "wrong.yaml"), str(folder / "free.csv")]
    result = CliRunner().invoke(check, arguments)
    assert result.exit_code == 1
    assert max(len(line) for line in result.stdout.splitlines()) <= 80
    scene = Scene.load(folder / "right.yaml")
    right = "[" + ", ".join(f"{round(x, 4):g}" for x in scene.mounting) + "]"
    assert f"this would: {right} rad (opposite sign)" in result.stdout

    said = json.loads(CliRunner().invoke(check, [*arguments, "--json"]).stdout)
    assert not said["fits"]
    wrong = [item for item in said["findings"] if item["verdict"] == "does_not_fit"]
    assert [(item["line"], item["proposed"]) for item in wrong] == [("mounting", right)]
    assert wrong[0]["before"]["moment"] > 10.0 * wrong[0]["after"]["moment"]


@pytest.mark.slow
def test_a_recording_without_a_sensor_hides_nothing_of_the_others(folder: Path, tmp_path: Path) -> None:
    """The sensor was not used in any of them, and nothing contradicted the scene; later the recording that
    lacks it was not used."""
    scene = Scene.load(folder / "right.yaml")
    sensor = scene.base_wrench
    assert sensor is not None
    other = {"arm_on_sensor": "sensor_on_arm", "sensor_on_arm": "arm_on_sensor"}[sensor.sign]
    content = yaml.safe_load((folder / "right.yaml").read_text())
    content["base_wrench"]["sign"] = other
    wrong, lacking = tmp_path / "wrong.yaml", tmp_path / "lacking.csv"
    wrong.write_text(yaml.safe_dump(content))
    (part,), _ = read_free_motion(folder / "free.csv", scene)
    columns = {"timestamp": part.t}
    for name, values in (("actual_q", part.q), ("actual_qd", part.qd), ("joint_torque", part.torque)):
        assert values is not None
        columns |= {f"{name}_{i}": values[:, i] for i in range(6)}
    write_columns(lacking, columns)
    result = CliRunner().invoke(check, [str(wrong), str(folder / "free.csv"), str(lacking), "--json"])
    assert result.exit_code == 1
    found = json.loads(result.stdout)
    assert found["findings"][0]["line"] == "base_wrench.sign"
    assert found["seconds"] == pytest.approx(2.0 * part.seconds, abs=0.1)


@pytest.mark.slow
def test_units_of_a_recording_are_a_matter_of_its_columns(folder: Path) -> None:
    arguments = [str(folder / "right.yaml"), str(folder / "degrees.csv")]
    result = CliRunner().invoke(check, arguments)
    assert result.exit_code == 1
    assert "joint positions: unit does not fit" in result.output
    assert "this would: deg (they are in degrees: --columns angle_unit=deg reads them)" in result.output
    assert CliRunner().invoke(check, [*arguments, "--columns", "angle_unit=deg"]).exit_code == 0


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["right.yaml", "absent.csv"], "absent.csv: cannot read the recording"),
        (
            ["right.yaml", "free.csv", "degrees.csv", "free.csv"],
            "free.csv: expected each recording once, got",
        ),
        (["absent.yaml", "free.csv"], "absent.yaml: cannot read the scene"),
        (["right.yaml"], "expected either recordings or --robot-host, got neither"),
        (["right.yaml", "free.csv", "--robot-host", "127.0.0.1"], "or --robot-host, got both"),
        (["right.yaml", "free.csv", "--columns", "unit"], "unit: cannot read the column mapping"),
        (["right.yaml", "--robot-host", "127.0.0.1"], "expected either its address"),
        (
            ["right.yaml", "free.csv", "--ft-port", "1"],
            "--ft-port is for a live robot: expected it with --ro",
        ),
    ],
)
def test_what_cannot_be_used_is_said(folder: Path, arguments: list[str], message: str) -> None:
    places = [str(folder / a) if a.endswith((".yaml", ".csv")) else a for a in arguments]
    result = CliRunner().invoke(check, places)
    assert result.exit_code == 2
    assert message in result.output


@pytest.mark.slow
def test_a_live_arm_is_checked(tmp_path: Path) -> None:
    """The mock's arm moves without contact; the scene says that it hangs from the ceiling."""
    motion = simulate(
        Script.model_validate(
            {
                "robot": "ur5e",
                "noise": {"base_force": 0.25, "base_moment": 0.05, "joint_torque": 1.0},
                "trajectory": {
                    "start": [0.0, -1.3, 1.6, -1.9, -1.57, 0.0],
                    "moves": [
                        {"to": [0.6, -1.0, 1.2, -1.4, -1.0, 0.5], "duration": 2.5},
                        {"to": [0.0, -1.3, 1.6, -1.9, -1.57, 0.0], "duration": 2.5},
                    ],
                },
            }
        )
    )
    (tmp_path / "scene.yaml").write_text("{robot: ur5e, mounting: ceiling}")
    chosen = MockSettings(host=own_address(), rtde_port=0, netft_port=0, http_port=0, loop=True)
    with MockServers(motion, chosen) as servers:
        source = ["--robot-host", chosen.host, "--robot-port", str(servers.rtde.port), "--seconds", "5"]
        source += ["--ft-host", chosen.host, "--ft-port", str(servers.netft.port)]
        source += ["--ft-http-port", str(servers.netft.http_port)]
        results = []

        def told() -> bool:  # where the host stands still, the command refuses what it has read
            results.append(CliRunner().invoke(check, [str(tmp_path / "scene.yaml"), *source]))
            return "without gaps" not in results[-1].output

        assert until(told, 120.0)
    assert results[-1].exit_code == 1, results[-1].output
    assert "this would: table" in results[-1].output


def test_sensors_without_an_option_are_those_of_the_environment(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    read: list[SourceSettings] = []

    def no_robot(scene: Scene, settings: SourceSettings, *others: object) -> None:
        read.append(settings)
        raise SensorError("there is no robot in this test")

    monkeypatch.setattr("contactsense.service.cli.check.read_live_motion", no_robot)
    (tmp_path / "scene.yaml").write_text(
        "{robot: ur5e, base_wrench: null, tool: {mass: 1}, wrist_wrench: {}, "
        "link_wrenches: [{name: elbow, link: forearm}]}"
    )
    fields = [f"output_double_register_{i}" for i in range(6)]
    variables = {
        "CONTACTSENSE_ROBOT_HOST": "192.0.2.1",
        "CONTACTSENSE_WRIST_FIELDS": "actual_TCP_force",
        "CONTACTSENSE_LINK_WRENCHES": json.dumps({"elbow": {"fields": ",".join(fields)}}),
    }
    result = CliRunner().invoke(check, [str(tmp_path / "scene.yaml")], env=variables)
    assert "there is no robot in this test" in result.output
    (settings,) = read
    assert settings.robot_host == "192.0.2.1"
    assert settings.wrist_fields == ("actual_TCP_force",)
    assert settings.link_wrenches["elbow"].fields == tuple(fields)


@pytest.mark.parametrize("field", [WRIST, ELBOW])
def test_readings_of_a_sensor_within_the_arm_come_as_they_were_read(tmp_path: Path, field: str) -> None:
    """From a file and from live samples, in which they are wrenches in base axes, whatever the delay."""
    case = right_setup("ur5e", 1, Settings(seconds=1.0), field)
    late = case.scene.link_sensors[field].model_copy(update={"delay": 0.02})
    changed = {WRIST: late} if field == WRIST else {"link_wrenches": (late,)}
    part, scene = case.recording, case.scene.model_copy(update=changed)
    _write(tmp_path / "free.csv", part)
    (read,), problems = read_free_motion(tmp_path / "free.csv", scene)
    assert problems == ()
    np.testing.assert_allclose(read.link_readings[field], part.link_readings[field], atol=1e-9)
    frame = LinkSensorFrame(scene, field)
    samples = [
        Sample(float(t), q, qd, **as_fields({field: frame.wrench(q, reading)}))
        for t, q, qd, reading in zip(part.t, part.q, part.qd, part.link_readings[field], strict=True)
    ]
    samples[5] = replace(samples[5], wrist_wrench=None, link_wrenches=None)
    live = _free_motion(scene, samples, "live")
    np.testing.assert_allclose(
        live.link_readings[field], np.delete(part.link_readings[field], 5, axis=0), atol=1e-9
    )
