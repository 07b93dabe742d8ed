"""`contactsense calibrate` as its users run it."""

import json
import re
import sys
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from click.testing import CliRunner

from contactsense import JointTorqueSensor, Scene, WrenchSensor
from contactsense.benchmarks.calibration.simulate import simulate
from contactsense.calibration import Calibration, FreeMotion, Settings, SuspectedContact
from contactsense.calibration import calibrate as estimate
from contactsense.calibration.motion.fourier_trajectory import FourierTrajectory
from contactsense.calibration.parameters import Entry
from contactsense.calibration.result import Value
from contactsense.robots.tool import Tool
from contactsense.sensors.settings import Friction, LinkInertia
from contactsense.service.cli import calibration_doubts
from contactsense.service.cli.analyze import analyze
from contactsense.service.cli.calibrate import calibrate
from contactsense.service.cli.calibration_doubts import doubts
from contactsense.service.cli.calibration_page import page, reasons_against
from contactsense.service.cli.calibration_report import residuals_before_and_after
from contactsense.service.recordings.export import write_columns
from contactsense.service.recordings.free_motion import read_free_motion
from contactsense.service.scene.load_warnings import load_warnings

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
    columns["joint_torque_2"] = stretch.torque[:, 2] + 15.0 * ((stretch.t > 3.5) & (stretch.t < 4.5))
    write_columns(made / "pushed.csv", columns)
    scaled = {f"joint_torque_{i}": 100.0 * stretch.torque[:, i] for i in range(6)}
    write_columns(made / "ncm.csv", columns | scaled)
    columns |= {f"actual_q_{i}": np.degrees(stretch.q[:, i]) for i in range(6)}
    write_columns(made / "degrees.csv", columns)
    write_columns(made / "far.csv", columns | {"actual_q_2": 1e8 * stretch.q[:, 2]})
    (made / "scene.yaml").write_text("robot: ur5e\nbase_wrench: null\ndetail: coarse\n")
    return made


@pytest.mark.slow
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
    report = (folder / "report" / "report.md").read_text()
    advised = re.search(r"`contactsense analyze (.*?)`", report)
    assert advised is not None
    given = advised[1].replace("RECORDING", files[0]).split()
    with analyze.make_context("analyze", given) as context:  # an option that is missing raises
        assert context.params["scene_path"] == folder / "new.yaml"
    assert "residuals_0.png" in report
    assert "| coulomb of elbow_joint |" in report
    assert (folder / "report" / "residuals_0.png").stat().st_size > 10_000


@pytest.mark.slow
def test_the_links_are_estimated_if_wanted(folder: Path, tmp_path: Path) -> None:
    """The tool, which the arm of the recording does not have, is then kept: it cannot be told from them."""
    (tmp_path / "scene.yaml").write_text("{robot: ur5e, base_wrench: null, tool: {mass: 0.3}}")
    found = {}
    for options in ((), ("--links",)):
        files = [str(folder / "free.csv"), "--scene", str(tmp_path / "scene.yaml")]
        result = CliRunner().invoke(calibrate, [*files, "--out", str(tmp_path / "new.yaml"), *options])
        assert result.exit_code == 0, result.output
        found[options] = Scene.load(tmp_path / "new.yaml")
    without, links = found.values()
    assert without.inertia is None
    assert without.tool is None or without.tool.mass < 0.1
    assert links.tool is not None
    assert links.tool.mass == 0.3
    assert links.inertia is not None
    assert set(links.inertia) == {"shoulder", "upper_arm", "forearm", "wrist_1", "wrist_2", "wrist_3"}
    assert 0.0 < links.inertia["forearm"].mass != TRUTH.robot.links[3].inertia.mass


def test_a_scene_that_cannot_be_written_is_refused_before_the_work(folder: Path) -> None:
    files = [str(folder / "free.csv"), "--scene", str(folder / "scene.yaml")]
    result = CliRunner().invoke(calibrate, [*files, "--out", str(folder / "none" / "new.yaml")])
    assert result.exit_code == 1
    assert "--out: " in result.output
    assert "there is no folder" in result.output


def test_a_fit_that_has_gone_wrong_is_not_recommended(folder: Path) -> None:
    scene = Scene.load(folder / "scene.yaml")
    parts, _ = read_free_motion(folder / "free.csv", scene)
    found = estimate(scene, parts, Settings(("bias", "coulomb"), widths=False))

    def advice(found: Calibration) -> str:
        return "\n".join(page(found, scene, Path("new.yaml"), reasons_against(found, ()))[-1].lines)

    assert "do not use this scene" not in advice(found)
    worse = np.where(np.arange(len(found.after.rms)) == 2, 2.1 * found.before.rms, found.after.rms)
    wrong = replace(found, after=replace(found.after, rms=worse))
    assert advice(wrong).startswith("do not use this scene: the one before explains this motion better")


def test_another_motion_is_advised_only_where_it_helps(folder: Path) -> None:
    """Not after the motion of `excite`, of which no load of a vertical axis is known, nor beside a wrong
    line, whose residuals hide all parameters."""
    scene = Scene.load(folder / "scene.yaml")
    parts, _ = read_free_motion(folder / "free.csv", scene)
    found = estimate(scene, parts, Settings(("bias", "coulomb", "load"), widths=False))

    def advice(*groups: str, against: tuple[str, ...] = ()) -> str:
        kept = dict.fromkeys(groups, "not excited by this motion")
        values = tuple(replace(v, kept=kept.get(v.entry.group, "")) for v in found.values)
        return "\n".join(page(replace(found, values=values), scene, None, against)[-1].lines)

    assert "excite" not in advice("load")
    assert "this motion does not excite coulomb of elbow_joint, " in advice("coulomb", "load")
    assert "excite" not in advice("coulomb", against=("do not use this scene: robot: got ur10e",))


def test_what_was_left_out_as_a_contact_is_no_reason_for_doubts(
    folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Clocks of robots do not begin at zero, and a recording may have several stretches."""
    checked: list[FreeMotion] = []

    def check(_: Scene, parts: list[FreeMotion], leave_out_contacts: bool) -> SimpleNamespace:
        assert not leave_out_contacts
        checked.extend(parts)
        return SimpleNamespace(wrong=(), unexplained=())

    monkeypatch.setattr(calibration_doubts, "check", check)
    scene = Scene.load(folder / "scene.yaml")
    (motion,), _ = read_free_motion(folder / "free.csv", scene)
    half = len(motion.t) // 2
    stretches = [motion.part(np.arange(half)), motion.part(np.arange(half, len(motion.t)))]
    stretches = [replace(stretch, t=stretch.t + 5000.0) for stretch in stretches]
    first, last = half + 100, half + 199
    time = stretches[1].t - stretches[1].t[0]
    rows = (stretches[1].row_of(100), stretches[1].row_of(199))
    contact = SuspectedContact(motion.name, float(time[100]), float(time[199]), *rows, (0,), (9.0,))
    found = estimate(scene, [motion], Settings(("bias",), widths=False, leave_out_contacts=False))
    found = replace(found, contacts=(contact,))
    doubts(found, scene, stretches)
    kept = [stretch.row_of(i) for stretch in checked[:2] for i in range(len(stretch.t))]
    assert kept == [motion.row_of(i) for i in range(len(motion.t)) if not first <= i <= last]


def test_a_line_that_is_wrong_before_and_after_is_named_once(
    folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    proposals = iter(("997 per Nm", "999 per Nm"))

    def check(*_: object, leave_out_contacts: bool) -> SimpleNamespace:
        item = SimpleNamespace(
            line="joint torques: scale", stated="1 per Nm", proposed=next(proposals), remark=""
        )
        return SimpleNamespace(wrong=(item,), unexplained=())

    monkeypatch.setattr(calibration_doubts, "check", check)
    scene = Scene.load(folder / "scene.yaml")
    parts, _ = read_free_motion(folder / "free.csv", scene)
    found = estimate(scene, parts, Settings(("bias",), widths=False))
    assert doubts(found, scene, parts) == ("joint torques: scale: got 1 per Nm; 997 per Nm would fit",)
    assert next(proposals, None) is None


def test_a_report_draws_torques_by_the_calibrated_constants(folder: Path) -> None:
    """They were drawn by the former ones, with residuals far above those of the page."""
    signal = JointTorqueSensor(signal="actual_current", torque_constants=(10.0,) * 6)
    scene = TRUTH.model_copy(update={"joint_torque": signal})
    calibrated = scene.model_copy(
        update={"joint_torque": signal.model_copy(update={"torque_constants": (12.0,) * 6})}
    )
    (motion,), _ = read_free_motion(folder / "free.csv", TRUTH)
    assert motion.torque is not None
    as_read = replace(motion, torque=motion.torque / 1.2)
    before, after = residuals_before_and_after(scene, calibrated, as_read)
    right, _ = residuals_before_and_after(calibrated, calibrated, motion)
    np.testing.assert_allclose(after, right, atol=1e-9)
    assert np.abs(before - right).max() > 1.0


def test_a_report_that_cannot_be_made_is_refused_before_the_work(
    folder: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("contactsense.service.cli.calibrate.run", None)
    taken = tmp_path / "report"
    taken.write_text("")
    arguments = [str(folder / "free.csv"), "--scene", str(folder / "scene.yaml"), "--report"]
    for report in (taken, taken / "below"):
        result = CliRunner().invoke(calibrate, [*arguments, str(report)])
        assert result.stderr == f"Error: --report: expected a folder, got the file {taken}\n"
    monkeypatch.setitem(sys.modules, "matplotlib", None)
    result = CliRunner().invoke(calibrate, [*arguments, str(tmp_path / "other")])
    assert result.exit_code == 1
    assert result.stderr.startswith("Error: plots need matplotlib: pip install '.[geometry]'")


@pytest.mark.slow
def test_contacts_that_are_kept_are_told(folder: Path) -> None:
    """There is one push, from 3.5 s on, and the search for contacts leaves a margin before it."""
    files = [str(folder / "pushed.csv"), "--scene", str(folder / "scene.yaml"), "--keep-contacts"]
    result = CliRunner().invoke(calibrate, files)
    assert re.search(
        r"--keep-contacts has used one stretch .* the first from 3\.\d s on in .*pushed\.csv", result.output
    )


@pytest.mark.slow
def test_the_former_scene_is_kept_with_its_comments(folder: Path, tmp_path: Path) -> None:
    scene, text = tmp_path / "scene.yaml", "# my cell\n" + (folder / "scene.yaml").read_text()
    scene.write_text(text)
    result = CliRunner().invoke(calibrate, [str(folder / "free.csv"), "--scene", str(scene), "--write"])
    assert result.exit_code == 0, result.output
    assert (tmp_path / "scene.yaml.bak").read_text() == text
    assert "friction" in scene.read_text()


def test_no_coordinate_is_minus_zero(folder: Path) -> None:
    scene = Scene.load(folder / "scene.yaml")
    parts, _ = read_free_motion(folder / "free.csv", scene)
    found = estimate(scene, parts, Settings(("bias",), widths=False))
    tool = Tool(name="tool", mass=1.4, com=(-5e-5, 0.01, 0.08))
    found = replace(found, scene=found.scene.model_copy(update={"tool": tool}))
    (changed,) = (part.lines for part in page(found, scene, None, ()) if part.title == "What changed")
    assert "tool: 1.4 kg, centre of mass 0, 10, 80 mm from the flange (was none)" in changed


@pytest.mark.long
def test_sensors_within_the_arm_are_calibrated_and_written(tmp_path: Path) -> None:
    elbow = {"name": "elbow", "link": "forearm", "bias": (3.0, -2.0, 5.0, 0.2, -0.1, 0.3), "delay": 0.016}
    wrist = WrenchSensor(bias=(-2.0, 1.0, 4.0, 0.1, 0.3, -0.2))
    tool = {"mass": 1.2, "com": (0.0, 0.01, 0.05)}
    truth = Scene(robot="ur5e", joint_torque=None, tool=tool, wrist_wrench=wrist, link_wrenches=[elbow])
    center = np.array([0.0, -1.3, 1.5, -1.0, 0.8, 0.0])
    motion = FourierTrajectory.draw(np.random.default_rng(4), center, np.full(6, 0.7), 6, 8.0)
    stretch = simulate(truth, motion, 1, 125.0)
    columns = {"timestamp": stretch.t}
    groups = {"actual_q": stretch.q, "actual_qd": stretch.qd}
    groups |= {field.split(".")[-1]: values for field, values in stretch.readings.items()}
    groups["elbow_wrench"] = groups.pop("elbow")
    for name, array in groups.items():
        columns |= {f"{name}_{i}": array[:, i] for i in range(6)}
    write_columns(tmp_path / "free.csv", columns)
    write_columns(tmp_path / "brief.csv", {name: column[:375] for name, column in columns.items()})
    (tmp_path / "scene.yaml").write_text(
        "robot: ur5e\njoint_torque: null\ntool: {mass: 1.2}\nwrist_wrench: {}\n"
        "link_wrenches: [{name: elbow, link: forearm}]\n"
    )
    files = [str(tmp_path / "free.csv"), "--scene", str(tmp_path / "scene.yaml")]
    result = CliRunner().invoke(calibrate, [*files, "--out", str(tmp_path / "new.yaml")])
    assert result.exit_code == 0, result.output
    assert re.search(r"- bias of link_wrenches\.elbow: (2\.\d+|3(\.\d+)?), ", result.stdout)
    assert re.search(r"- bias of wrist_wrench: ", result.stdout)
    assert re.search(r"- wrist_wrench force x: [\d.]+ -> 0\.\d+ N ", result.stdout)
    scene = Scene.load(tmp_path / "new.yaml")
    for field, sensor in scene.link_sensors.items():
        true = truth.link_sensors[field]
        np.testing.assert_allclose(sensor.bias[:3], true.bias[:3], atol=0.3)
        np.testing.assert_allclose(sensor.bias[3:], true.bias[3:], atol=0.03)
        assert sensor.delay == pytest.approx(true.delay, abs=4e-3)
    # The form of the answer is that of three seconds, too.
    files[0] = str(tmp_path / "brief.csv")
    said = json.loads(CliRunner().invoke(calibrate, [*files, "--json"]).stdout)
    assert len(said["equations"]) == len(said["residuals"]["after"]["rms"]) == 24
    assert said["equations"][12:19:6] == ["link_wrenches.elbow force x", "wrist_wrench force x"]


@pytest.mark.slow
def test_a_result_that_cannot_be_is_not_recommended(folder: Path, tmp_path: Path) -> None:
    """Torques in Ncm, and the scene of another arm."""
    for name, robot, field in (
        ("ncm.csv", "ur5e", "joint torques: scale: got 1 per Nm; "),
        ("free.csv", "ur10e", "robot: got ur10e; ur5e would fit"),
    ):
        path = tmp_path / f"{robot}.yaml"
        path.write_text(f"robot: {robot}\nbase_wrench: null\n")
        before = path.read_text()
        result = CliRunner().invoke(calibrate, [str(folder / name), "--scene", str(path), "--write"])
        assert result.exit_code == 3, result.output
        assert f"do not use this scene: {field}" in result.stdout
        assert "no scene was changed" in result.stdout
        assert path.read_text() == before


def test_a_payload_that_pulls_upwards_is_not_recommended(folder: Path) -> None:
    scene = Scene.load(folder / "scene.yaml")
    parts, _ = read_free_motion(folder / "free.csv", scene)
    known = estimate(scene, parts, Settings(("bias",), widths=False))
    entry = Entry("payload", (0,), "payload mass", "kg", 5.0)
    for mass, told in ((-1.0, ()), (-4.0, ("tool.mass: expected at least -2.2 kg, got -4 kg",))):
        found = replace(known, values=(Value(entry, 0.0, mass, 0.1),))
        assert doubts(found, found.scene, []) == told


def test_a_tensor_that_no_link_has_is_no_reason_against_a_calibration(folder: Path) -> None:
    """Motion determines only sums over links, so calibration may share them out in such a way."""
    scene = Scene.load(folder / "scene.yaml")
    parts, _ = read_free_motion(folder / "free.csv", scene)
    known = estimate(scene, parts, Settings(("bias",), widths=False))
    forearm = LinkInertia(mass=2.8, com=(0.2, 0.0, 0.01), tensor=(0.006, 0.0, 0.0, 0.08, 0.0, 0.1))
    found = replace(known, scene=known.scene.model_copy(update={"inertia": {"forearm": forearm}}))
    assert any("inertia.forearm.tensor" in text for text in load_warnings(found.scene))
    assert doubts(found, known.scene, []) == ()


@pytest.mark.slow
def test_the_page_names_contacts_changes_and_next_steps(folder: Path) -> None:
    files = [str(folder / "pushed.csv"), "--scene", str(folder / "scene.yaml")]
    result = CliRunner().invoke(calibrate, [*files, "--verbose"])
    assert result.exit_code == 0, result.output
    _, left_out, changed, means, following = result.stdout.split("\n\n")
    assert left_out.startswith("Left out: something seems to push on the arm")
    assert re.search(
        r"pushed\.csv: 3\.\d+ to [45]\.\d+ s \(rows 3\d\d to [56]\d\d\), seen in elbow_joint", left_out
    )
    assert "Coulomb friction: " in changed
    assert "(was 0)" in changed
    assert "elbow_joint: " in means
    assert "--keep-contacts uses them" in following
    assert "nothing was written" in following
    assert "condition number" in following
    assert "warning: load of wrist_3_joint: not " in following
    assert ": kept" not in left_out + changed + means


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["absent.csv", "--scene", "scene.yaml"], "absent.csv: cannot read the recording"),
        (["free.csv", "--scene", "absent.yaml"], "absent.yaml: cannot read the scene"),
        (["far.csv", "--scene", "scene.yaml"], "in rad, or as much in degrees, elbow_joint within -9.425"),
        (["degrees.csv", "--scene", "scene.yaml"], "are they in degrees? (--columns angle_unit=deg)"),
    ],
)
def test_what_is_wrong_is_said(folder: Path, arguments: list[str], message: str) -> None:
    places = [str(folder / a) if "." in a else a for a in arguments]
    result = CliRunner().invoke(calibrate, places)
    assert result.exit_code == 1
    assert message in result.output


def test_a_recording_that_is_named_twice_is_refused(folder: Path) -> None:
    """Also by another path: its samples would count twice."""
    again = folder / ".." / folder.name / "free.csv"
    arguments = [str(folder / "free.csv"), str(again), "--scene", str(folder / "scene.yaml")]
    result = CliRunner().invoke(calibrate, arguments)
    assert result.exit_code == 2
    assert "free.csv: expected each recording once, got it twice" in result.output
