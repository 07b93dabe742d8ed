"""The wrist sensor's lines are checked against simulated motion."""

from dataclasses import replace

import numpy as np
import pytest

from contactsense.benchmarks.calibration.setup_draws import (
    WRIST_MISTAKES,
    Settings,
    right_setup,
    wrong_setup,
)
from contactsense.calibration import FreeMotion
from contactsense.setup_check import LINES, CheckError, check
from contactsense.setup_check.fit import Fitter
from contactsense.setup_check.motion_basis import MotionBases, Readings
from contactsense.setup_check.sensor_findings import saturated_sensors
from contactsense.setup_check.setup import Setup
from contactsense.setup_check.tool_terms import tool_terms

DRAWN = Settings(seconds=8.0)
WRIST_LINES = {line for line in LINES if line.startswith("wrist")}
RANGE_KIND = "wrist sensor of a range too small"


def test_predictions_agree_with_independent_dynamics() -> None:
    """Without noise of other sensors and errors of the model, nothing but the wrist's noise is left."""
    truth = right_setup("ur10e", 8, replace(DRAWN, inertia_error=0.0), wrist=True)
    scene, parts = truth.scene, [truth.recording]
    fitter = Fitter(scene, MotionBases({"ur10e": scene}, parts), Readings.of(scene, parts))
    setup = Setup.of(scene)
    error = fitter._error(setup)[:, -6:]
    assert (error.std(axis=0) < 1.4 * fitter.noise[-6:]).all()
    assert (np.abs(error.mean(axis=0)) < 0.5 * fitter.noise[-6:]).all()
    other = fitter._error(replace(setup, mass=setup.mass + 0.1))[:, -6:]
    assert other[:, :3].std() > 5.0 * error[:, :3].std()


def test_gravity_alone_is_the_weight_in_flange_axes() -> None:
    """An arm at rest: the low-passed wrench is the wrench itself."""
    scene = right_setup("ur5e", 1, DRAWN, wrist=True).scene
    q = np.tile([0.3, -1.3, 1.5, -1.0, 0.8, 0.4], (600, 1))
    still = FreeMotion(0.01 * np.arange(600), q, np.zeros_like(q))
    *by_axis, motion = (terms[-1] for terms in tool_terms(scene, still, 2.0))
    np.testing.assert_allclose(motion, 0.0, atol=1e-12)
    wrench = np.tensordot(scene.gravity_base, by_axis, 1) @ Setup.of(scene).tool
    assert scene.tool is not None
    size = 9.81 * scene.tool.mass
    assert np.linalg.norm(wrench[:3]) == pytest.approx(size, rel=1e-9)
    np.testing.assert_allclose(wrench[3:], np.cross(scene.tool.com, wrench[:3]), atol=1e-9)


def test_a_right_setup_fits_and_a_wrong_bias_is_found() -> None:
    case = right_setup("ur10e", 3, DRAWN, wrist=True)
    assert case.scene.wrist_wrench is not None
    off = np.array([1.0, -2.0, 0.0, 0.2, 0.0, 0.0])
    bias = tuple((np.array(case.scene.wrist_wrench.bias) + off).tolist())
    sensor = case.scene.wrist_wrench.model_copy(update={"bias": bias})
    found = check(case.scene.model_copy(update={"wrist_wrench": sensor}), [case.recording])
    (item,) = found.wrong
    assert item.line == "wrist_wrench.bias"
    assert item.proposed is not None
    proposed = np.array([float(x) for x in item.proposed.strip("[]").split(", ")])
    np.testing.assert_allclose(proposed, case.scene.wrist_wrench.bias, atol=0.1)
    fits = {each.line for each in found.findings if each.verdict == "fits"}
    assert fits == set(LINES) - {"wrist_wrench.bias", "base_wrench.range"}


def test_recordings_of_which_only_a_saturated_sensor_is_left_are_refused() -> None:
    case = wrong_setup(RANGE_KIND, "ur5e", 2, DRAWN)
    alone = replace(case.recording, torque=None, reading=None)
    with pytest.raises(CheckError, match=r"wrist_wrench\.range: expected readings within it"):
        check(case.scene, [alone])
    assert saturated_sensors(case.scene, [alone]) == ("wrist",)
    assert saturated_sensors(right_setup("ur5e", 2, DRAWN, wrist=True).scene, [alone]) == ()


@pytest.mark.slow
def test_a_sensor_at_its_range_is_not_used() -> None:
    case = wrong_setup(RANGE_KIND, "ur5e", 2, DRAWN)
    found = check(case.scene, [case.recording])
    assert [item.line for item in found.wrong] == ["wrist_wrench.range"]
    untold = {item.line: item.remark for item in found.findings if item.line in WRIST_LINES}
    assert set(untold) == WRIST_LINES
    assert found.residuals.wrist_force is None


@pytest.mark.slow
@pytest.mark.parametrize("kind", [kind for kind in WRIST_MISTAKES if kind != RANGE_KIND])
def test_the_wrong_line_is_named(kind: str) -> None:
    case = wrong_setup(kind, "ur5e", 1, DRAWN)
    assert [item.line for item in check(case.scene, [case.recording]).wrong] == [case.line]


@pytest.mark.slow
def test_readings_beyond_the_stated_range_accuse_it() -> None:
    case = right_setup("ur5e", 4, DRAWN, wrist=True)
    assert case.recording.wrist is not None
    assert case.scene.wrist_wrench is not None
    limit = 0.8 * float(np.abs(case.recording.wrist[:, :3]).max())
    sensor = case.scene.wrist_wrench.model_copy(update={"range": (limit, 10.0)})
    (item,) = check(case.scene.model_copy(update={"wrist_wrench": sensor}), [case.recording]).wrong
    assert item.line == "wrist_wrench.range"
    assert item.proposed is not None
    assert item.proposed.startswith("more than [")
