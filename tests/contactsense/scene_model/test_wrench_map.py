"""Readings of a sensor under the base, calculated by hand."""

import numpy as np
import pytest

from contactsense import Scene, WrenchSensor
from contactsense.scene_model.wrench_map import WrenchMap

BIAS = (1.0, 2.0, 3.0, 0.1, 0.2, 0.3)


@pytest.mark.parametrize(("sign", "factor"), [("arm_on_sensor", 1.0), ("sensor_on_arm", -1.0)])
def test_a_turned_sensor_below_the_base(sign: str, factor: float) -> None:
    """Its x axis is the base's y axis. 10 N at the base origin, 0.1 m above it, turn it about its x axis."""
    sensor = WrenchSensor.model_validate(
        {"rpy": (0.0, 0.0, np.pi / 2), "translation": (0.0, 0.0, -0.1), "sign": sign, "bias": BIAS}
    )
    wrench = np.array([10.0, 0.0, -50.0, 0.0, 0.0, 0.0])
    reading = factor * np.array([0.0, -10.0, -50.0, 1.0, 0.0, 0.0]) + BIAS
    wrench_map = WrenchMap.of(sensor)
    np.testing.assert_allclose(wrench_map.wrench(reading), wrench, atol=1e-12)
    np.testing.assert_allclose(wrench_map.reading(wrench), reading, atol=1e-12)
    np.testing.assert_allclose(
        wrench_map.wrench(np.array([reading, BIAS])), [wrench, np.zeros(6)], atol=1e-12
    )


def test_a_scene_without_base_sensor_is_told_so() -> None:
    scene = Scene(robot="ur5e", base_wrench=None)
    with pytest.raises(ValueError, match="base_wrench: expected a sensor of the scene, which has none"):
        WrenchMap.of(scene.base_wrench)
