"""A joint counts its position from another zero than the arm's."""

from dataclasses import replace

import numpy as np
import pytest

from contactsense.benchmarks.calibration.setup_draws import Settings, right_setup
from contactsense.setup_check import SetupCheck, check
from contactsense.setup_check.fit.fitter import Fitter
from contactsense.setup_check.lines import ZEROS
from contactsense.setup_check.setup import Setup
from contactsense.setup_check.terms.motion_basis import MotionBases, Readings

DRAWN = Settings(seconds=12.0)


def _checked(degrees: tuple[float, ...]) -> SetupCheck:
    """What is said of an arm whose joints report these angles too much."""
    case = right_setup("ur5e", 1, DRAWN)
    offset = np.radians(degrees)
    return check(case.scene, [replace(case.recording, q=case.recording.q + offset)])


@pytest.mark.slow
@pytest.mark.parametrize(
    ("joint", "name", "degrees"),
    [
        (1, "shoulder_lift_joint", 4.0),
        (2, "elbow_joint", -8.0),
        (4, "wrist_2_joint", 12.0),
    ],
)
def test_a_joint_with_another_zero_is_named_with_the_angle(joint: int, name: str, degrees: float) -> None:
    (item,) = _checked(tuple(degrees * np.eye(6)[joint])).wrong
    assert item.line == ZEROS
    assert item.proposed is not None
    said, angle, unit = item.proposed.split(" ")
    assert (said, unit) == (name, "degrees")
    assert float(angle) == pytest.approx(-degrees, abs=1.5)
    assert item.stated == "as read"


@pytest.mark.slow
def test_zeros_of_another_convention_are_named() -> None:
    (item,) = _checked((0.0, 90.0, 0.0, 0.0, 0.0, 0.0)).wrong
    assert item.line == ZEROS
    assert item.proposed is not None
    assert item.proposed.startswith("shoulder_lift_joint -9")


@pytest.mark.slow
def test_two_joints_with_another_zero_are_one_wrong_line() -> None:
    (item,) = _checked((0.0, 6.0, -8.0, 0.0, 0.0, 0.0)).wrong
    assert item.line == ZEROS
    assert item.proposed is not None
    assert [part.split(" ")[0] for part in item.proposed.split(", ")][:2] == [
        "shoulder_lift_joint",
        "elbow_joint",
    ]


@pytest.mark.slow
def test_joints_whose_zero_the_motion_does_not_determine_are_named() -> None:
    case = right_setup("ur5e", 1, DRAWN)
    found = check(case.scene.model_copy(update={"base_wrench": None}), [case.recording])
    assert not found.wrong
    (item,) = (item for item in found.findings if item.line == ZEROS)
    assert item.verdict == "cannot_tell"
    assert "wrist_2_joint" in item.remark


def test_a_zero_changes_the_prediction_as_the_positions_do() -> None:
    case = right_setup("ur5e", 2, DRAWN)
    scene, part, zero = case.scene, case.recording, (0.0, 0.1, 0.0, -0.2, 0.0, 0.0)
    fits = []
    for recording, setup in (
        (part, replace(Setup.of(scene), angle_zero=zero)),
        (replace(part, q=part.q + zero), Setup.of(scene)),
    ):
        fitter = Fitter(scene, MotionBases({"ur5e": scene}, [recording]), Readings.of(scene, [recording]))
        fits.append(fitter.fit(setup))
    np.testing.assert_allclose(fits[0].residual, fits[1].residual, atol=1e-8)
