"""Recordings of different sensors in one check: each sensor is judged from those that have it."""

from dataclasses import replace

import numpy as np
import pytest

from contactsense.benchmarks.calibration.link_sensor_draws import WRIST
from contactsense.benchmarks.calibration.setup_draws import Settings, right_setup, wrong_setup
from contactsense.calibration import FreeMotion
from contactsense.setup_check import check
from contactsense.setup_check.result import NOT_RECORDED
from contactsense.setup_check.usable_recordings import TOO_SHORT

DRAWN = Settings(seconds=12.0)
KINDS = (
    "tool mass wrong by 0.5 to 2 kg",
    "sign of the base wrench",
    "base sensor displaced by 5 to 20 cm",
    "joint torques of another scale or unit",
)


def halves(part: FreeMotion) -> tuple[FreeMotion, FreeMotion]:
    """The first half with the base sensor, the second one with the joint torques."""
    n = len(part.t) // 2
    first, second = part.part(np.arange(n)), part.part(np.arange(n, len(part.t)))
    return replace(first, torque=None), replace(second, reading=None)


@pytest.mark.slow
@pytest.mark.parametrize("kind", KINDS)
def test_a_wrong_line_is_found_though_no_recording_has_both_sensors(kind: str) -> None:
    case = wrong_setup(kind, "ur5e", 1, DRAWN)
    found = check(case.scene, list(halves(case.recording)))
    assert [item.line for item in found.wrong] == [case.line]
    assert found.unexplained == ()


@pytest.mark.slow
def test_a_right_scene_fits_and_no_line_of_either_sensor_is_missing() -> None:
    case = right_setup("ur10e", 3, DRAWN, WRIST)
    base, torque = halves(case.recording)
    without = [replace(part, link_readings={}) for part in (base, torque)]
    found = check(case.scene, [replace(base, link_readings={}), torque])
    assert found.fits
    assert not [item.line for item in found.findings if item.remark == NOT_RECORDED]
    assert found.residuals.force is not None
    assert found.residuals.torque is not None
    assert found.residuals.links.keys() == {WRIST}
    missing = {item.line for item in check(case.scene, without).findings if item.remark == NOT_RECORDED}
    assert missing == {line for line in (item.line for item in found.findings) if line.startswith("wrist")}


@pytest.mark.slow
def test_a_sensor_of_a_short_recording_is_not_judged_and_hides_nothing() -> None:
    """Of a few rows any values would fit: a fit of many unknowns leaves no residual."""
    case = wrong_setup("sign of the joint torques", "ur5e", 1, DRAWN)
    whole = case.recording
    short = replace(whole.part(np.arange(250)), torque=None)
    found = check(case.scene, [replace(whole, reading=None), short])
    assert [item.line for item in found.wrong] == [case.line]
    remarks = {item.line: item.remark for item in found.findings}
    assert remarks["base_wrench.sign"] == TOO_SHORT
    assert found.residuals.force is None
