"""Two lines of a scene are wrong at once, and the one that explains most alone is none of them."""

from dataclasses import replace

import numpy as np
import pytest

from contactsense.benchmarks.calibration.setup_draws import Settings, right_setup
from contactsense.benchmarks.calibration.two_mistakes import ARM_AND_TOOL, two_wrong_lines
from contactsense.setup_check import check
from contactsense.setup_check.check import _wrong_lines
from contactsense.setup_check.fit.fitter import Fitter
from contactsense.setup_check.search.change import Change, with_changes
from contactsense.setup_check.search.explanation import Explanation
from contactsense.setup_check.setup import BASE, Setup
from contactsense.setup_check.terms.motion_basis import MotionBases, Readings

DRAWN = Settings(seconds=12.0)


@pytest.mark.long
@pytest.mark.parametrize(("arm", "seed"), [("ur5e", 20_000), ("ur5e", 20_005), ("ur10e", 10_000)])
def test_another_arm_and_a_missing_tool_are_no_other_line(arm: str, seed: int) -> None:
    """Line by line, a scale of the torques, a third arm or a load on a link explains most, and the search
    stayed with it."""
    case, lines = two_wrong_lines(arm, seed, Settings(), torques_alone=True, kinds=ARM_AND_TOOL)
    found = check(case.scene, [case.recording])
    assert {item.line for item in found.wrong} == set(lines)
    assert {item.line: item.proposed for item in found.wrong}["robot"] == arm
    for item in found.wrong:
        assert item.after == found.residuals
        assert item.before is not None
        assert item.before.torque is not None
        assert found.residuals.torque is not None
        assert item.before.torque > found.residuals.torque


@pytest.mark.slow
@pytest.mark.parametrize(
    ("arm", "seed"), [("ur10e", 20_000), pytest.param("ur5e", 20_001, marks=pytest.mark.long)]
)
def test_a_pair_is_found_where_one_line_leaves_residuals_far_beyond_the_noise(arm: str, seed: int) -> None:
    """In the second cell those residuals are small against the weight, and no line alone is convincing."""
    case, lines = two_wrong_lines(arm, seed, Settings(), kinds=ARM_AND_TOOL)
    found = check(case.scene, [case.recording])
    assert {item.line for item in found.wrong} == set(lines)
    assert {item.line: item.proposed for item in found.wrong}["robot"] == arm


def _cell() -> tuple[Setup, Fitter]:
    case = right_setup("ur5e", 2, DRAWN)
    scene, parts = case.scene, [case.recording]
    return Setup.of(scene), Fitter(scene, MotionBases({"ur5e": scene}, parts), Readings.of(scene, parts))


def _change(line: str, before: Setup, after: Setup) -> Change:
    return Change(line, (), before, after, after)


def test_a_change_of_another_setup_leaves_everything_else_as_it_is() -> None:
    stated = Setup.of(right_setup("ur5e", 2, DRAWN).scene)
    scaled = stated.with_sensor(BASE, order=2.0 * np.eye(6))
    heavier = replace(stated, mass=stated.mass + 1.0, gain=-stated.gain)
    swapped = heavier.with_sensor(BASE, order=np.eye(6)[[1, 0, 2, 3, 4, 5]], delay=0.1)
    both = with_changes([_change("a", stated, scaled), _change("b", stated, swapped)], stated)
    assert both.mass == heavier.mass
    assert both.robot == stated.robot
    np.testing.assert_array_equal(both.gain, -1.0)
    np.testing.assert_allclose(both.sensors[BASE].order, 2.0 * np.eye(6)[[1, 0, 2, 3, 4, 5]])
    assert both.sensors[BASE].delay == 0.1
    alone = with_changes([_change("b", scaled, both)], stated)
    np.testing.assert_allclose(alone.sensors[BASE].order, swapped.sensors[BASE].order)


def test_a_line_that_is_found_wrong_again_keeps_the_value_of_the_scene() -> None:
    stated, fitter = _cell()
    scene = right_setup("ur5e", 2, DRAWN).scene
    heavy = replace(stated, mass=stated.mass + 3.0)
    less = replace(stated, mass=stated.mass + 2.0)
    changes = (_change("tool.mass", stated, heavy), _change("tool.mass", heavy, less))
    whole = Explanation(changes, fitter.fit(less), {"tool.mass": fitter.fit(stated)}, {"tool.mass": ()})
    (item,) = _wrong_lines(fitter, scene, stated, whole)
    assert (item.stated, item.proposed) == (f"{stated.mass:.3g}", f"{less.mass:.3g}")


def test_a_line_that_returns_to_the_value_of_the_scene_is_not_wrong() -> None:
    stated, fitter = _cell()
    scene = right_setup("ur5e", 2, DRAWN).scene
    reverse = replace(stated, gain=-stated.gain)
    heavy = replace(stated, mass=stated.mass + 3.0)
    sign, mass = "joint_torque.sign", "tool.mass"
    changes = (
        _change(sign, stated, reverse),
        _change(mass, stated, heavy),
        _change(sign, reverse, stated),
    )
    fits = {sign: fitter.fit(heavy), mass: fitter.fit(stated)}
    whole = Explanation(changes, fitter.fit(heavy), fits, {sign: (), mass: ()})
    assert [item.line for item in _wrong_lines(fitter, scene, stated, whole)] == [mass]
