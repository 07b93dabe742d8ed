"""Signals with both the opposite sign and another scale: two lines are named."""

from dataclasses import replace

import numpy as np
import pytest

from contactsense import Scene
from contactsense.benchmarks.calibration.setup_draws import Settings, right_setup
from contactsense.calibration import FreeMotion
from contactsense.setup_check import check

DRAWN = Settings(seconds=12.0)
SIGNS = {"by_actuator": "on_arm", "on_arm": "by_actuator"}
G = 9.80665


def _cell() -> tuple[Scene, FreeMotion, np.ndarray, np.ndarray]:
    """A right scene of torques in Nm, its recording, torques and base readings."""
    case = right_setup("ur5e", 4, DRAWN)
    torque, reading = case.recording.torque, case.recording.reading
    assert case.scene.joint_torque is not None
    assert torque is not None
    assert reading is not None
    sensor = case.scene.joint_torque.model_copy(update={"signal": "actual_current_as_torque"})
    return case.scene.model_copy(update={"joint_torque": sensor}), case.recording, torque, reading


def _said(scene: Scene, recording: FreeMotion) -> dict[str, tuple[str | None, str]]:
    """Proposal and remark by wrong line."""
    return {item.line: (item.proposed, item.remark) for item in check(scene, [recording]).wrong}


@pytest.mark.slow
@pytest.mark.parametrize("scale", [100.0, pytest.param(1.0 / G, marks=pytest.mark.long)])
def test_torques_of_another_unit_and_the_opposite_sign(scale: float) -> None:
    scene, recording, torque, _ = _cell()
    said = _said(scene, replace(recording, torque=-scale * torque))
    assert set(said) == {"joint_torque.sign", "joint torques: scale"}
    assert scene.joint_torque is not None
    assert said["joint_torque.sign"][0] == SIGNS[scene.joint_torque.sign]
    unit = "Ncm" if scale == 100.0 else "kgf m"
    proposed, remark = said["joint torques: scale"]
    assert proposed is not None
    assert float(proposed.split()[0]) == pytest.approx(scale, rel=0.05)
    assert remark == f"they are in {unit}"


@pytest.mark.long
def test_the_torque_of_one_joint_with_another_scale_and_the_opposite_sign() -> None:
    scene, recording, torque, _ = _cell()
    factors = np.array([1.0, 1.0, -10.0, 1.0, 1.0, 1.0])
    said = _said(scene, replace(recording, torque=torque * factors))
    assert said["joint torques: order"] == ("1 2 -3 4 5 6", "joint 3 has the opposite sign")
    assert set(said) == {"joint torques: order", "joint torques: scale"}


@pytest.mark.long
@pytest.mark.parametrize(
    ("factors", "line", "proposed"),
    [
        (np.repeat([-1.0 / G, 1.0], 3), "order of axes", "forces -x -y -z, moments x y z"),
        (np.repeat([1.0, -100.0], 3), "order of axes", "forces x y z, moments -x -y -z"),
        (np.repeat([-1.0 / G, -100.0 / G], 3), "sign", None),
    ],
)
def test_a_base_sensor_of_another_scale_and_the_opposite_sign(
    factors: np.ndarray, line: str, proposed: str | None
) -> None:
    scene, recording, _, reading = _cell()
    assert scene.base_wrench is not None
    other = {"arm_on_sensor": "sensor_on_arm", "sensor_on_arm": "arm_on_sensor"}
    said = _said(scene, replace(recording, reading=reading * factors))
    name = "base_wrench.sign" if line == "sign" else f"base wrench: {line}"
    assert set(said) == {name, "base wrench: scale"}
    assert said[name][0] == (proposed or other[scene.base_wrench.sign])
    scale, _ = said["base wrench: scale"]
    assert scale is not None
    values = [float(part.split()[0]) for part in scale.split(", ")]
    np.testing.assert_allclose(values, np.abs(factors[[0, 3]]), rtol=0.05)
