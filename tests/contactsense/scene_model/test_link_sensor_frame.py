"""Readings of a sensor within the arm, as a program of one's own converts them."""

from collections.abc import Callable

import numpy as np
import pytest

from contactsense import Scene, WrenchSensor
from contactsense.robots.tool import Tool
from contactsense.scene_model.link_sensor_frame import LinkSensorFrame

READING = np.array([1.0, -2.0, 9.0, 0.1, 0.2, 0.3])
SCENE = Scene(robot="ur5e", tool=Tool(mass=1.0), wrist_wrench=WrenchSensor(rpy=(0.0, 0.0, 0.5)))


@pytest.mark.parametrize("made", [list, tuple, np.array])
def test_positions_of_any_type_are_converted(made: Callable[[list[int]], np.ndarray]) -> None:
    q = [0, -1, 1, -2, -1, 0]
    frame = LinkSensorFrame(SCENE, "wrist_wrench")
    right = frame.wrench(np.array(q, dtype=np.float64), READING)
    np.testing.assert_array_equal(frame.wrench(made(q), READING), right)
    np.testing.assert_allclose(frame.reading(made(q), right), READING)


@pytest.mark.parametrize("shape", [(5,), (7,), (1, 6)])
def test_positions_of_another_arm_are_refused(shape: tuple[int, ...]) -> None:
    frame = LinkSensorFrame(SCENE, "wrist_wrench")
    with pytest.raises(ValueError, match=r"q: expected 6 joint positions, got an array of shape \("):
        frame.wrench(np.zeros(shape), READING)


def test_a_sensor_that_the_scene_does_not_have_is_refused() -> None:
    with pytest.raises(
        ValueError, match=r"link_wrenches\.elbow: expected a sensor of the scene, .* wrist_wrench"
    ):
        LinkSensorFrame(SCENE, "link_wrenches.elbow")
    with pytest.raises(ValueError, match="wrist_wrench: expected a sensor of the scene, which has none"):
        LinkSensorFrame(Scene(robot="ur5e"), "wrist_wrench")
