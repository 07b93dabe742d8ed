"""What the result of a calibration says and writes."""

import numpy as np
import pytest

from contactsense.calibration.calibration_model import CalibrationModel
from contactsense.calibration.result import residual_statistics, scene_of
from contactsense.robots.tool import Tool
from contactsense.scene import Scene
from contactsense.sensors.field_checks import carried_by


def test_residuals_are_those_of_the_recordings_that_have_the_sensor() -> None:
    rng = np.random.default_rng(0)
    long, short = rng.standard_normal((900, 3)), rng.standard_normal((100, 3))
    long[:, 1:] = short[:, 2] = 0.0
    found = residual_statistics(
        [long, short], [np.array([True, False, False]), np.array([True, True, False])]
    )
    np.testing.assert_allclose(
        found.rms[:2], [np.concatenate([long[:, 0], short[:, 0]]).std(), short[:, 1].std()], rtol=0.02
    )
    assert found.tail[1] == pytest.approx(np.quantile(np.abs(short[:, 1]), 0.999))
    assert np.isnan([found.rms[2], found.tail[2]]).all()


def test_what_weighs_next_to_nothing_is_not_placed_by_the_noise() -> None:
    tool = Tool(mass=0.0, com=(0.01, 0.0, 0.05))
    found = _with_payload(Scene(robot="ur5e", tool=tool), 3e-4).tool
    assert found is not None
    assert found.mass == pytest.approx(3e-4)
    assert found.com == tool.com
    carried_by(Scene(robot="ur5e").robot.mass, found)


@pytest.mark.parametrize("mass", [-0.01, 3e-4, 0.5])
def test_an_arm_without_a_tool_gets_one_only_if_it_carries_something(mass: float) -> None:
    assert (_with_payload(Scene(robot="ur5e"), mass).tool is None) == (mass < 0.1)


@pytest.mark.parametrize("mounting", ["wall", (0.1, 0.9, -2.0)])
def test_a_tilt_does_not_turn_the_base_about_gravity(mounting: str | tuple[float, float, float]) -> None:
    """No sensor of the arm observes such a turn."""
    arm = CalibrationModel.of(Scene(robot="ur5e", mounting=mounting))
    arm = arm.with_values(tilt=np.array([0.0, 0.03, -0.02]))
    found = scene_of(arm, {"tilt"}, None, {})
    np.testing.assert_allclose(found.gravity_base, arm.gravity, atol=1e-4)
    turn = (arm.scene.orientation.inv() * found.orientation).as_rotvec()
    assert abs(turn @ arm.scene.gravity_base) < 1e-3 * np.linalg.norm(turn) * arm.scene.gravity


def _with_payload(scene: Scene, mass: float) -> Scene:
    arm = CalibrationModel.of(scene).with_values(payload=np.array([mass, 0.002, 0.0, 0.0]))
    return scene_of(arm, {"payload"}, None, {})
