"""The lines of a sensor within the arm, at the wrist or in the elbow, are checked in simulated motion."""

from dataclasses import replace

import numpy as np
import pytest

from contactsense import robots
from contactsense.benchmarks.calibration.link_sensor_draws import ELBOW, LINK_MISTAKES, WRIST
from contactsense.benchmarks.calibration.setup_draws import Settings, right_setup, wrong_setup
from contactsense.calibration import FreeMotion
from contactsense.calibration.calibration_model import CalibrationModel
from contactsense.calibration.residuals.residual_jacobian import inertial_columns
from contactsense.kinematics.model import build_model
from contactsense.robots import Robot
from contactsense.scene import LinkWrenchSensor, Scene
from contactsense.scene_model.link_sensors import mounts
from contactsense.setup_check import CheckError, check, lines
from contactsense.setup_check.check import other_arms
from contactsense.setup_check.findings.sensor_findings import saturated_sensors
from contactsense.setup_check.fit.fitter import Fitter
from contactsense.setup_check.lines import sensor_lines
from contactsense.setup_check.setup import Setup, plain_order
from contactsense.setup_check.terms.instants import BANDWIDTH, instants
from contactsense.setup_check.terms.load_terms import LoadTerms
from contactsense.setup_check.terms.motion_basis import MotionBases, Readings
from tests.contactsense.link_sensors.truth import FOREARM, Oracle

DRAWN = Settings(seconds=8.0)
BOTH = pytest.mark.parametrize("field", [WRIST, ELBOW])


def range_kind(field: str) -> str:
    return next(kind for kind, (line, _) in LINK_MISTAKES[field].items() if line.endswith(".range"))


@BOTH
def test_predictions_agree_with_independent_dynamics(field: str) -> None:
    """Without noise of other sensors and errors of the model, nothing but the sensor's noise is left."""
    truth = right_setup("ur10e", 8, Settings(seconds=30.0, inertia_error=0.0), field)
    scene, parts = truth.scene, [truth.recording]
    fitter = Fitter(scene, MotionBases({"ur10e": scene}, parts), Readings.of(scene, parts))
    setup = Setup.of(scene)
    error = fitter._error(setup)[:, -6:]
    np.testing.assert_allclose(error.std(axis=0), fitter.noise[-6:], rtol=0.25)
    assert (np.abs(error.mean(axis=0)) < 0.5 * fitter.noise[-6:]).all()
    other = fitter._error(replace(setup, mass=setup.mass + 0.2))[:, -6:]
    assert other[:, :3].std() > 5.0 * error[:, :3].std()


def test_gravity_alone_is_the_weight_of_what_is_carried() -> None:
    """An arm at rest: the low-passed wrench is the wrench itself, which Pinocchio gives for the forearm."""
    oracle, robot = Oracle(), right_setup("ur5e", 1, DRAWN).scene.robot
    q = np.array([0.3, -1.3, 1.5, -1.0, 0.8, 0.4])
    still = FreeMotion(0.01 * np.arange(600), np.tile(q, (600, 1)), np.zeros((600, 6)))
    terms = LoadTerms.of(build_model(robot), FOREARM, [still], instants([still]))
    np.testing.assert_allclose(terms.at(np.zeros(3), 0.0)[-1], 0.0, atol=1e-12)
    found = np.einsum("ckp,kp->c", terms.at(np.array([0.0, 0.0, -9.81]), 0.0)[-1], _inertia(robot, FOREARM))
    rotation, place = oracle.pose(q, FOREARM)
    exact = oracle.at(q, np.zeros(6), np.zeros(6)).forearm
    force, moment = exact[:3], exact[3:] - np.cross(place, exact[:3])
    np.testing.assert_allclose(found, np.concatenate((rotation.T @ force, rotation.T @ moment)), atol=1e-8)


@pytest.mark.parametrize("node", range(5))
def test_the_base_is_a_sensor_below_the_first_link(node: int) -> None:
    """Its terms and those of the joints are those of calibration, at every node."""
    case = right_setup("ur5e", 1, replace(DRAWN, seconds=5.0))
    arm, gravity = CalibrationModel.of(case.scene), np.array([1.0, -3.0, -9.0])
    (at,) = instants([case.recording])
    followed = case.recording.part(at.motion)
    exact = inertial_columns(arm, followed, gravity, BANDWIDTH, slice(None))
    averages = replace(at, motion=np.arange(len(followed.t))).averages_of(exact)
    joint, base = np.split(averages[:, node], [len(arm.gain)], axis=1)
    basis = MotionBases({"ur5e": case.scene}, [case.recording]).of("ur5e", 1.0, plain_order(6), (0.0,) * 6)
    delay = -float(basis.joints.nodes[0, node])
    np.testing.assert_allclose(basis.loads(0).at(gravity, delay), -base, atol=1e-9)
    np.testing.assert_allclose(basis.joints.torques(gravity, True, delay), joint, atol=1e-9)


def _inertia(robot: Robot, first: int) -> np.ndarray:
    scene = right_setup("ur5e", 1, DRAWN).scene
    return Setup.of(scene.model_copy(update={"robot": robot, "tool": None})).bodies[first:]


@pytest.mark.slow
@BOTH
def test_a_right_setup_fits_and_a_wrong_bias_is_found(field: str) -> None:
    case = right_setup("ur10e", 3, DRAWN, field)
    sensor = case.scene.link_sensors[field]
    off = np.array([1.0, -2.0, 0.0, 0.2, 0.0, 0.0])
    wrong = sensor.model_copy(update={"bias": tuple((np.array(sensor.bias) + off).tolist())})
    changed = {"link_wrenches": (wrong,)} if isinstance(sensor, LinkWrenchSensor) else {field: wrong}
    found = check(case.scene.model_copy(update=changed), [case.recording])
    (item,) = found.wrong
    assert item.line == f"{field}.bias"
    assert item.proposed is not None
    proposed = np.array([float(x) for x in item.proposed.strip("[]").split(", ")])
    np.testing.assert_allclose(proposed, sensor.bias, atol=0.1)
    fits = {each.line for each in found.findings if each.verdict == "fits"}
    # The wrist's torques are little more than friction: which of them is which is not known.
    # Of loads only those that are found are told.
    loads = {line for line in lines(case.scene) if line.startswith("inertia.")}
    told = set(lines(case.scene)) - loads - {"joint torques: order"}
    assert fits - {"joint torques: order"} == told - {f"{field}.bias", "base_wrench.range"}


@pytest.mark.slow
def test_a_sensor_on_another_link_is_named() -> None:
    case = wrong_setup("elbow sensor on another link", "ur5e", 1, DRAWN, ELBOW)
    (item,) = check(case.scene, [case.recording]).wrong
    assert (item.line, item.proposed) == (f"{ELBOW}.link", "forearm")
    assert item.before is not None
    assert item.after is not None
    assert item.before.links[ELBOW].force > 10.0 * item.after.links[ELBOW].force


def test_recordings_of_which_only_a_saturated_sensor_is_left_are_refused() -> None:
    case = wrong_setup(range_kind(WRIST), "ur5e", 2, DRAWN, WRIST)
    alone = replace(case.recording, torque=None, reading=None)
    with pytest.raises(CheckError, match=r"wrist_wrench\.range: expected readings within it"):
        check(case.scene, [alone])
    assert saturated_sensors(case.scene, [alone]) == (WRIST,)
    assert saturated_sensors(right_setup("ur5e", 2, DRAWN, WRIST).scene, [alone]) == ()


@pytest.mark.slow
@BOTH
def test_a_sensor_at_its_range_is_not_used(field: str) -> None:
    case = wrong_setup(range_kind(field), "ur5e", 2, DRAWN, field)
    found = check(case.scene, [case.recording])
    assert [item.line for item in found.wrong] == [f"{field}.range"]
    own = set(sensor_lines(field))
    assert {item.line for item in found.findings} & own == own
    assert all(item.verdict == "cannot_tell" for item in found.findings[1:] if item.line in own)
    assert field not in found.residuals.links


@pytest.mark.slow
@pytest.mark.parametrize(
    ("field", "kind"),
    [
        # `make test` tries the first mistake of one sensor, too.
        pytest.param(field, kind, marks=[pytest.mark.slow] if number or field == WRIST else [])
        for field in (WRIST, ELBOW)
        for number, kind in enumerate(LINK_MISTAKES[field])
        if kind != range_kind(field)
    ],
)
def test_the_wrong_line_is_named(field: str, kind: str) -> None:
    case = wrong_setup(kind, "ur5e", 1, DRAWN, field)
    assert [item.line for item in check(case.scene, [case.recording]).wrong] == [case.line]


@pytest.mark.slow
@BOTH
def test_readings_beyond_the_stated_range_accuse_it(field: str) -> None:
    case = right_setup("ur5e", 4, DRAWN, field)
    sensor = case.scene.link_sensors[field]
    limit = 0.8 * float(np.abs(case.recording.readings[field][:, :3]).max())
    small = sensor.model_copy(update={"range": (limit, 150.0)})
    changed = {"link_wrenches": (small,)} if isinstance(sensor, LinkWrenchSensor) else {field: small}
    (item,) = check(case.scene.model_copy(update=changed), [case.recording]).wrong
    assert item.line == f"{field}.range"
    assert item.proposed is not None
    assert item.proposed.startswith("more than [")


def test_links_of_an_arm_of_ones_own_have_other_names_in_those_of_the_library() -> None:
    arm = robots.load("ur5e")
    own = replace(arm, name="own", file=None, links=tuple(replace(x, name=f"my_{x.name}") for x in arm.links))
    scene = Scene(robot=own, link_wrenches=[LinkWrenchSensor(name="elbow", link="my_forearm")])
    others = other_arms(scene)
    assert {"ur5e", "ur10e"} < set(others)
    assert {mounts(other)["link_wrenches.elbow"].body for other in others.values()} == {3}
