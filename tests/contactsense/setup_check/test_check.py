"""A scene is checked against simulated and real motion: the wrong line is named, a right one never."""

import json
from dataclasses import replace

import numpy as np
import pytest
from scipy.signal import lfilter

from contactsense import JointTorqueSensor, Scene
from contactsense.benchmarks.calibration.recordings import read
from contactsense.benchmarks.calibration.setup_draws import Settings, right_setup, wrong_setup
from contactsense.calibration import FreeMotion
from contactsense.robots.rotations import rotation_from_rpy
from contactsense.robots.tool import Tool
from contactsense.setup_check import CheckError, SetupCheck, check, lines
from contactsense.setup_check.findings.proposals import line_value, roll_and_pitch
from contactsense.setup_check.findings.signal_findings import velocity_finding
from contactsense.setup_check.findings.unexplained import unexplained_signals
from contactsense.setup_check.fit.fitter import Fitter
from contactsense.setup_check.search.changes import tolerance
from contactsense.setup_check.setup import BASE, Free, Setup
from contactsense.setup_check.terms.motion_basis import MotionBases, Readings
from tests.shared import shared
from tests.unknown_limits import without_limits

DRAWN = Settings(seconds=12.0)
USUAL = ("tool mass wrong by 0.5 to 2 kg", "velocities zero, or in degrees")
OTHERS = (
    "mounting: one angle with the wrong sign",
    "joint torques of another scale or unit",
    "base sensor 10 to 50 ms late or early",
    "one component of the base sensor reversed",
    "positions of two joints exchanged",
    "torque constants wrong by 25 to 100 %",
    "torque of one joint zero or frozen",
    "forces in kgf or lbf",
    "torques of two joints exchanged",
)
KINDS = [*USUAL, *(pytest.param(kind, marks=pytest.mark.slow) for kind in OTHERS)]


def _untold(found: SetupCheck) -> set[str]:
    return {item.line for item in found.findings if item.verdict == "cannot_tell"}


@pytest.mark.slow
@pytest.mark.parametrize("kind", KINDS)
def test_the_wrong_line_is_named(kind: str) -> None:
    case = wrong_setup(kind, "ur5e", 1, DRAWN)
    found = check(case.scene, [case.recording])
    assert [item.line for item in found.wrong] == [case.line]
    assert not found.fits
    # What explains the readings about as well, and nothing else: the tool's mass is also a part of `tool`.
    assert found.wrong[0].instead == (("tool",) if case.line == "tool.mass" else ())
    if found.wrong[0].before is not None:
        assert found.wrong[0].after == found.residuals


@pytest.mark.slow
def test_a_right_setup_fits_and_the_proposed_value_is_the_true_one() -> None:
    right = right_setup("ur10e", 3, DRAWN)
    found = check(right.scene, [right.recording])
    assert found.fits
    # The wrist's torques are little more than friction: which of them is which is not known.
    assert _untold(found) <= {"joint torques: order"}

    assert isinstance(right.scene.mounting, tuple)
    roll, pitch, yaw = right.scene.mounting
    wrong = right.scene.model_copy(update={"mounting": (roll, -pitch, yaw)})
    (item,) = check(wrong, [right.recording]).wrong
    assert item.proposed == f"[{round(roll, 4):g}, {round(pitch, 4):g}, {round(yaw, 4):g}]"
    assert item.remark == "opposite sign"


@pytest.mark.slow
@pytest.mark.parametrize("stated", [1.62, 12.0])
def test_a_wrong_gravity_is_no_scale_of_the_torques(stated: float) -> None:
    right = right_setup("ur10e", 3, DRAWN)
    scene = right.scene.model_copy(update={"gravity": stated})
    (item,) = check(scene, [right.recording]).wrong
    assert (item.line, item.stated, item.proposed) == ("gravity", f"{stated:g}", "9.81")
    assert item.instead == ()


@pytest.mark.slow
def test_an_arm_whose_limits_are_not_known_can_be_checked() -> None:
    right = right_setup("ur5e", 1, DRAWN)
    unknown = right.scene.model_copy(update={"robot": without_limits(right.scene.robot)})
    assert check(unknown, [right.recording]).fits


@pytest.mark.long
def test_two_wrong_lines_are_both_named() -> None:
    case = wrong_setup("joint positions in degrees", "ur5e", 4, DRAWN)
    assert case.scene.tool is not None
    heavier = case.scene.tool.model_copy(update={"mass": case.scene.tool.mass + 2.0})
    found = check(case.scene.model_copy(update={"tool": heavier}), [case.recording])
    assert [item.line for item in found.wrong] == ["joint positions: unit", "tool.mass"]


def test_the_frame_of_an_upright_sensor_is_written_without_a_warning() -> None:
    """Its x axis points up: roll and yaw turn about the same axis."""
    scene = Scene(robot="ur5e")
    turned = Setup.of(scene).with_sensor(BASE, rotation=rotation_from_rpy((0.0, -np.pi / 2.0, 0.0)))
    assert line_value("base_wrench.rpy", turned, scene) == (
        "[0, -1.5708, 0]",
        "turned by 90 degrees about -y",
    )


@pytest.mark.slow
def test_torques_that_are_too_large_are_no_signal_that_a_scene_could_state() -> None:
    """No finding may propose what the scene already states."""
    case = right_setup("ur10e", 5, DRAWN)
    assert case.recording.torque is not None
    assert case.scene.joint_torque is not None
    torques = case.scene.joint_torque.model_copy(update={"signal": "actual_current_as_torque"})
    scene = case.scene.model_copy(update={"joint_torque": torques})
    found = check(scene, [replace(case.recording, torque=10.0 * case.recording.torque)])
    assert not [item.line for item in found.wrong if item.proposed == item.stated]
    assert "joint_torque.signal" not in [item.line for item in found.wrong]


@pytest.mark.slow
def test_a_centre_of_mass_in_centimetres_is_no_wrong_mass() -> None:
    """The fit comes back from so far away; a tool without mass would explain the readings, too."""
    case = right_setup("ur5e", 1, DRAWN)
    tool = case.scene.tool
    assert tool is not None
    far = tool.model_copy(update={"com": tuple(100.0 * x for x in tool.com)})
    (item,) = check(case.scene.model_copy(update={"tool": far}), [case.recording]).wrong
    assert item.line == "tool.com"
    assert item.proposed is not None
    assert json.loads(item.proposed) == pytest.approx(tool.com, abs=0.01)


@pytest.mark.slow
def test_torque_constants_that_all_differ_are_all_estimated() -> None:
    """A constant that is right by itself is part of the line, too."""
    case = right_setup("ur5e", 1, DRAWN)
    sensor, torque = case.scene.joint_torque, case.recording.torque
    assert sensor is not None
    assert sensor.torque_constants is not None
    assert torque is not None
    factors = np.array([1.2, 0.8, 1.3, 0.6, 1.0, 1.0])
    stated = sensor.model_copy(update={"signal": "actual_current"})
    scene = case.scene.model_copy(update={"joint_torque": stated})
    (item,) = check(scene, [replace(case.recording, torque=factors * torque)]).wrong
    assert item.line == "joint_torque.torque_constants"
    assert item.proposed is not None
    right = np.array(sensor.torque_constants) / factors
    np.testing.assert_allclose(json.loads(item.proposed)[:4], right[:4], rtol=0.1)


@pytest.mark.slow
def test_torque_constants_that_are_all_one_are_estimated() -> None:
    """Torques and currents are the same then, which hid that the scale is another one."""
    case = right_setup("ur5e", 1, DRAWN)
    sensor, torque = case.scene.joint_torque, case.recording.torque
    assert sensor is not None
    assert torque is not None
    ones = sensor.model_copy(update={"signal": "actual_current", "torque_constants": (1.0,) * 6})
    found = check(
        case.scene.model_copy(update={"joint_torque": ones}), [replace(case.recording, torque=0.1 * torque)]
    )
    (item,) = found.wrong
    assert item.line == "joint_torque.torque_constants"
    assert item.proposed is not None
    np.testing.assert_allclose(json.loads(item.proposed)[:3], 10.0, rtol=0.05)


@pytest.mark.parametrize(("mass", "factor"), [(5.0, 1.0), (0.5, 2.0), (0.1, 10.0)])
def test_the_centre_of_mass_of_a_light_tool_matters_less(mass: float, factor: float) -> None:
    """What counts is the moment of its weight."""
    limits = [
        tolerance(Free("com"), Setup.of(Scene(robot="ur5e", tool=Tool(mass=kilograms))))
        for kilograms in (mass, 1.0)
    ]
    assert limits[0] == pytest.approx(factor * limits[1])


@pytest.mark.slow
@pytest.mark.parametrize("tared", [False, True])
def test_an_arm_at_rest_tells_little_and_accuses_nothing(tared: bool) -> None:
    case = right_setup("ur10e", 5, DRAWN)
    rng, moving = np.random.default_rng(6), case.recording
    assert moving.torque is not None
    assert moving.reading is not None
    reading = moving.reading[:1] + rng.normal(0.0, 0.2, moving.reading.shape)
    still = replace(
        moving,
        q=np.repeat(moving.q[:1], len(moving.t), axis=0),
        qd=np.zeros_like(moving.qd),
        torque=moving.torque[:1] + rng.normal(0.0, 1.0, moving.q.shape),
        reading=reading - (moving.reading[0] if tared else 0.0),
    )
    found = check(case.scene, [still])
    assert found.fits
    untold = _untold(found)
    assert {"robot", "tool.mass", "base_wrench.rpy", "base_wrench.translation", "base_wrench.delay"} <= untold
    assert {"base wrench: scale", "base wrench: frozen values", "joint torques: frozen values"} <= untold
    assert "joint velocities: agreement" in untold


@pytest.mark.slow
@pytest.mark.parametrize("missing", [(0.3, 0.1), (0.023, 0.015)])
def test_a_sensor_set_to_zero_under_load_and_missing_samples_accuse_nothing(
    missing: tuple[float, float],
) -> None:
    case = right_setup("ur5e", 7, DRAWN)
    whole = case.recording
    assert whole.torque is not None
    assert whole.reading is not None
    kept = (np.abs(whole.t - 4.0) > missing[0]) & (np.abs(whole.t - 8.0) > missing[1])
    parts = {"torque": whole.torque[kept], "reading": (whole.reading - whole.reading[0])[kept]}
    found = check(case.scene, [FreeMotion(whole.t[kept], whole.q[kept], whole.qd[kept], **parts)])
    assert found.fits
    assert _untold(found) <= {"joint torques: order"}


@pytest.mark.slow
def test_predictions_agree_with_independent_dynamics() -> None:
    """Without noise and errors of the model, only the interpolation of the delay is left."""
    truth = right_setup("ur10e", 8, replace(DRAWN, inertia_error=0.0))
    scene, recording = truth.scene, truth.recording
    fitter = Fitter(scene, MotionBases({"ur10e": scene}, [recording]), Readings.of(scene, [recording]))
    setup = Setup.of(scene)
    noise = fitter.noise
    assert (fitter.fit(setup).residual.std(axis=0) < 1.4 * noise)[:12].all()
    assert scene.base_wrench is not None
    late = fitter.fit(setup.with_sensor(BASE, delay=0.03), (Free("delay", BASE),))
    assert late.setup.sensors[BASE].delay == pytest.approx(0.0, abs=4.0 * float(late.std[0]))


@pytest.mark.parametrize(
    "mounting", [(0.4, -0.3, 0.0), (-0.4, 0.3, 1.0), (2.5, 0.1, -2.0), (-2.5, -1.2, 0.5)]
)
def test_roll_and_pitch_are_those_of_the_gravity(mounting: tuple[float, float, float]) -> None:
    found = roll_and_pitch(Scene(robot="ur5e", mounting=mounting).gravity_base)
    assert found == pytest.approx(mounting[:2])


@pytest.mark.parametrize(("correlation", "independent"), [(0.0, 1.0), (0.6, 0.25), (0.99, 0.05)])
def test_correlated_residuals_count_as_fewer_rows(correlation: float, independent: float) -> None:
    """The variance of the mean of a first-order process is (1 + r) / (1 - r) times that of white noise."""
    case = right_setup("ur10e", 8, DRAWN)
    readings = Readings.of(case.scene, [case.recording])
    fitter = Fitter(case.scene, MotionBases({"ur10e": case.scene}, [case.recording]), readings)
    noise = np.random.default_rng(0).standard_normal((50_000, len(fitter.noise)))
    residual = 3.0 + lfilter([1.0], [1.0, -correlation], noise, axis=0)
    fitter.set_effective_rows(residual)
    np.testing.assert_allclose(fitter.effective, independent, rtol=0.05)


@pytest.mark.parametrize("unit", [1.0, 1000.0])
@pytest.mark.parametrize(("share", "told"), [(0.027, False), (0.033, True)])
def test_a_residual_that_is_small_for_the_joint_is_no_unexplained_signal(
    share: float, told: bool, unit: float
) -> None:
    """However far it is above the noise: 3 % of the joint's limit is what counts, also of torques in mNm."""
    case = right_setup("ur5e", 2, DRAWN)
    assert case.scene.joint_torque is not None
    quiet = case.scene.joint_torque.model_copy(update={"noise": 0.01})
    scene = case.scene.model_copy(update={"joint_torque": quiet})
    readings = Readings.of(scene, [case.recording])
    fitter = Fitter(scene, MotionBases({"ur5e": scene}, [case.recording]), readings)
    fit = fitter.fit(Setup.of(scene))
    residual = np.zeros_like(fit.residual)
    residual[:, 5] = unit * share * scene.robot.joints[5].torque_limit
    scaled = replace(fit, residual=residual, setup=replace(fit.setup, gain=unit * fit.setup.gain))
    found = unexplained_signals(scene, fitter, readings, scaled)
    assert bool(found) == told


@pytest.mark.slow
def test_what_remains_is_told_in_the_units_that_are_found() -> None:
    case = right_setup("ur5e", 2, DRAWN)
    torque, reading = case.recording.torque, case.recording.reading
    assert torque is not None
    assert reading is not None
    right = check(case.scene, [case.recording]).residuals
    scales = np.repeat([1.0, 1000.0], 3)
    found = check(case.scene, [replace(case.recording, torque=1000.0 * torque, reading=scales * reading)])
    assert {item.line for item in found.wrong} == {"joint_torque.torque_constants", "base wrench: scale"}
    assert not found.unexplained
    assert found.residuals.torque == pytest.approx(right.torque, rel=0.05)
    assert found.residuals.moment == pytest.approx(right.moment, rel=0.05)


@pytest.mark.long
def test_real_recordings_fit_and_a_load_and_a_push_are_seen() -> None:
    """A UR10e with motor currents alone, without and with a load at the flange."""
    scene = Scene(robot="ur10e", base_wrench=None, joint_torque=JointTorqueSensor(signal="actual_current"))
    folder = shared("ur10e_recordings")

    def of(name: str, described: Scene = scene) -> FreeMotion:
        return read(folder / f"{name}.csv.gz", described)[0]

    for name in ("ur-20_01_31-unload", "ur-20_02_05-20sec_8harm", "collision_free", "validation-p9"):
        assert check(scene, [of(name)]).fits, name
    loaded = check(scene, [of("ur-20_01_31-load")])
    assert [item.line for item in loaded.wrong] == ["tool"]
    pushed = check(scene, [of("push_pose_1")])
    assert pushed.fits
    assert len(pushed.contacts) == 4
    assert check(scene, [of("push_pose_1")], leave_out_contacts=False).unexplained
    recording = of("ur-20_01_31-unload")
    assert recording.torque is not None
    for line, changed, read_as in (
        ("joint_torque.sign", scene, replace(recording, torque=-recording.torque)),
        ("joint positions: unit", scene, replace(recording, q=np.degrees(recording.q))),
        ("robot", scene.model_copy(update={"robot": Scene(robot="ur5e").robot}), recording),
        ("mounting", scene.model_copy(update={"mounting": "wall"}), recording),
    ):
        found = check(changed, [read_as])
        assert [item.line for item in found.wrong][:1] == [line]


@pytest.mark.slow
def test_lines_of_a_sensor_that_was_not_recorded_cannot_be_told() -> None:
    case = right_setup("ur5e", 10, DRAWN)
    found = check(case.scene, [replace(case.recording, reading=None)])
    assert found.fits
    verdicts = {item.line: item.verdict for item in found.findings}
    base = {line for line in lines(case.scene) if line.startswith("base")} - {"base_wrench.range"}
    assert {verdicts[line] for line in base} == {"cannot_tell"}
    assert verdicts["joint_torque.sign"] == verdicts["mounting"] == "fits"


def test_recordings_that_cannot_be_used_are_refused() -> None:
    case = right_setup("ur5e", 9, replace(DRAWN, seconds=2.0))
    whole = case.recording
    with pytest.raises(CheckError, match="at least one recording"):
        check(case.scene, [])
    with pytest.raises(CheckError, match="at least 3 s"):
        check(case.scene, [whole])
    apart = [replace(whole, torque=None), replace(whole, reading=None)]
    with pytest.raises(CheckError, match="at least 3 s"):
        check(case.scene, apart)
    long = right_setup("ur5e", 9, replace(DRAWN, seconds=6.0)).recording
    short_pieces = long.part(np.flatnonzero(np.arange(len(long.t)) % 100 < 51))
    with pytest.raises(CheckError, match=r"at least 3 s without gaps above 0\.05 s, got 0\.4 s"):
        check(case.scene, [short_pieces])
    bare = replace(whole, torque=None, reading=None)
    with pytest.raises(CheckError, match="expected joint torques or base wrenches"):
        check(case.scene, [bare])
    short = FreeMotion(whole.t, whole.q[:, :5], whole.qd[:, :5])
    for parts in ([short], [whole, short]):
        with pytest.raises(CheckError, match="expected 6 joints, as ur5e has, got 5"):
            check(case.scene, parts)


@pytest.mark.parametrize(
    ("of_positions", "of_velocities", "verdict", "reason"),
    [
        (180.0 / np.pi, 1.0, "cannot_tell", "the positions are in degrees, the velocities are not"),
        (1.0, 180.0 / np.pi, "does_not_fit", "the velocities are in degrees"),
        (1.0, -1.0, "does_not_fit", "the velocities have the opposite sign"),
        (1.0, 0.0, "does_not_fit", "the velocities stay near zero"),
        (0.0, 1.0, "does_not_fit", "the positions stay the same"),
    ],
)
def test_units_of_positions_and_velocities_are_told_apart(
    of_positions: float, of_velocities: float, verdict: str, reason: str
) -> None:
    case = right_setup("ur5e", 10, DRAWN)
    part = case.recording
    read_as = replace(part, q=of_positions * part.q, qd=of_velocities * part.qd)
    found, _ = velocity_finding(case.scene, [read_as])
    assert found.verdict == verdict
    assert reason in found.remark


def test_values_that_no_mistake_explains_are_refused() -> None:
    """Other lines were said to fit them, such as a scale of the base sensor of 4e-8."""
    case = right_setup("ur5e", 10, DRAWN)
    part = case.recording
    assert part.torque is not None
    some = np.repeat([180.0 / np.pi, 1.0], 3)
    far = part.q * (np.arange(6) == 2)
    for changed, message in (
        (replace(part, q=1e8 * far), r"q: expected .* in degrees, elbow_joint within -.* got .*e\+0[78]$"),
        (replace(part, torque=1e9 * part.torque), r"joint_torque: expected at most 100000 times the 150 Nm"),
        (
            replace(part, q=some * part.q),
            r"q: expected .* one unit, got degrees for shoulder_pan_joint, .* and rad for wrist_1_joint",
        ),
        (
            replace(part, q=some * part.q, qd=some * part.qd),
            r"q: expected .* one unit, got degrees for shoulder_pan_joint, .*, by the arm's limits",
        ),
    ):
        with pytest.raises(CheckError, match=message):
            check(case.scene, [changed])
