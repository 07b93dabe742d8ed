"""Two lines of a scene are wrong at once, and the one that explains most alone is none of them."""

import json
from dataclasses import replace

import numpy as np
import pytest
from scipy.linalg import block_diag
from scipy.spatial.transform import Rotation

from contactsense import Scene
from contactsense.benchmarks.calibration.setup_draws import Settings, right_setup
from contactsense.benchmarks.calibration.two_mistakes import ARM_AND_TOOL, two_wrong_lines
from contactsense.setup_check import check
from contactsense.setup_check.check import _wrong_lines
from contactsense.setup_check.findings.proposals import as_sign_and_turn
from contactsense.setup_check.fit.fitter import Fitter
from contactsense.setup_check.search.change import Change, with_changes
from contactsense.setup_check.search.explanation import Explanation
from contactsense.setup_check.search.stated_fields import by_stated_fields
from contactsense.setup_check.setup import BASE, Free, Setup
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


@pytest.mark.slow
def test_sign_and_turn_of_a_sensor_are_no_order_of_its_axes() -> None:
    """Exchanged axes and another turn explain the same, but no field of a scene states them."""
    case = right_setup("ur5e", 4, DRAWN)
    sensor = case.scene.base_wrench
    assert sensor is not None
    other = {"arm_on_sensor": "sensor_on_arm", "sensor_on_arm": "arm_on_sensor"}[sensor.sign]
    turned = Rotation.from_matrix(sensor.rotation) * Rotation.from_euler("z", 90, degrees=True)
    changes = {"sign": other, "rpy": tuple(turned.as_euler("xyz").tolist())}
    scene = case.scene.model_copy(update={"base_wrench": sensor.model_copy(update=changes)})
    found = check(scene, [case.recording])
    proposed = {item.line: item.proposed for item in found.wrong}
    assert proposed.keys() == {"base_wrench.sign", "base_wrench.rpy"}
    assert proposed["base_wrench.sign"] == sensor.sign
    rpy = json.loads(proposed["base_wrench.rpy"] or "")
    error = Rotation.from_euler("xyz", rpy) * Rotation.from_matrix(sensor.rotation).inv()
    assert error.magnitude() < np.radians(1.0)
    for item in found.wrong:
        assert item.before is not None
        assert item.after is not None
        assert item.before.moment > 3.0 * item.after.moment


@pytest.mark.parametrize("axes", [np.eye(3)[[1, 0, 2]], np.diag([1.0, 1.0, -1.0])])
def test_the_opposite_sign_and_another_turn_predict_the_same(axes: np.ndarray) -> None:
    stated, fitter = _cell()
    sensor = stated.sensors[BASE]
    turned = stated.with_sensor(
        BASE, rotation=sensor.rotation @ Rotation.from_euler("x", 180, degrees=True).as_matrix()
    )
    order = stated.with_sensor(BASE, order=sensor.order @ block_diag(axes, axes))
    free = (Free("turn", BASE),)
    changes = (
        Change("base_wrench.rpy", free, stated, turned, turned),
        _change("base wrench: order of axes", stated, order),
    )
    setup = with_changes(changes, stated)
    fit = fitter.fit(setup)
    without = dict.fromkeys(("base_wrench.rpy", "base wrench: order of axes"), fitter.fit(stated))
    rivals = dict.fromkeys(without, ("mounting",))
    # The turn is needed where the readings are those of the turned sensor.
    found = by_stated_fields(
        fitter, stated, Explanation(changes, replace(fit, penalty=-1e9), without, rivals)
    )
    assert found.lines == ("base_wrench.rpy", "base_wrench.sign")
    assert set(found.without) == set(found.rivals) == set(found.lines)
    assert found.changes[0].free == free
    for same in (found.fit.setup, with_changes(found.changes, stated)):
        assert same.sensors[BASE].sign == -sensor.sign
        np.testing.assert_array_equal(same.sensors[BASE].order, np.eye(6))
        np.testing.assert_allclose(same.reading_per_wrench(BASE), setup.reading_per_wrench(BASE), atol=1e-12)


def test_mirrored_axes_are_also_told_by_what_a_scene_can_state() -> None:
    """A network sensor cannot exchange its axes."""
    scene = Scene(robot="ur5e")
    stated, line = Setup.of(scene), "base wrench: order of axes"
    mirror = np.diag([1.0, 1.0, -1.0])
    mirrored = stated.with_sensor(BASE, order=block_diag(mirror, mirror))
    assert as_sign_and_turn(line, mirrored, scene) == (
        "the same as base_wrench.sign: sensor_on_arm with base_wrench.rpy: [0, 0, 3.1416] rad"
    )
    for other in (stated, stated.with_sensor(BASE, order=block_diag(mirror, np.eye(3)))):
        assert as_sign_and_turn(line, other, scene) == ""
    assert as_sign_and_turn("mounting", mirrored, scene) == ""
