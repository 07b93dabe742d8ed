"""What a calibration finds does not depend on how the same motion and the same cell are described."""

from dataclasses import replace

import numpy as np
import pytest

from contactsense import JointTorqueSensor
from contactsense.benchmarks.calibration.link_sensor_draws import WRIST
from contactsense.benchmarks.calibration.setup_draws import Case, right_setup
from contactsense.benchmarks.calibration.setup_draws import Settings as Drawn
from contactsense.calibration import Calibration, FreeMotion, Settings, calibrate, default_groups
from contactsense.calibration.parameters import OPTIONAL_FRICTION
from contactsense.sensors.settings import Friction
from contactsense.service.cli.calibration_doubts import as_read_with
from tests.turned_base import turned_base

pytestmark = pytest.mark.slow


@pytest.fixture(scope="module")
def case() -> Case:
    """A cell with a base sensor and one at the wrist, whose links are those of the robot's data."""
    return right_setup("ur5e", 1, Drawn(seconds=10.0, inertia_error=0.0, speed=0.5), WRIST)


@pytest.fixture(scope="module")
def found(case: Case) -> Calibration:
    return calibrate(case.scene, [case.recording])


def apart(one: Calibration, other: Calibration) -> float:
    """Largest difference of two results in stated standard deviations; infinite if one kept what the other
    estimated."""
    assert [value.entry.name for value in one.values] == [value.entry.name for value in other.values]
    found = 0.0
    for first, second in zip(one.values, other.values, strict=True):
        if bool(first.kept) != bool(second.kept):
            return np.inf
        if not first.kept:
            found = max(found, abs(first.after - second.after) / first.std, abs(second.std / first.std - 1.0))
    return found


def test_the_same_call_has_the_same_result(case: Case, found: Calibration) -> None:
    again = calibrate(case.scene, [case.recording])
    assert apart(found, again) == 0.0
    assert again.scene == found.scene


def test_the_clock_may_begin_anywhere(case: Case, found: Calibration) -> None:
    """Times since 1970 are known to a quarter of a microsecond."""
    part = case.recording
    assert apart(found, calibrate(case.scene, [replace(part, t=part.t + 1.7e9)])) < 0.05


def test_a_recording_may_be_cut_and_its_parts_exchanged(case: Case) -> None:
    """What is lost is the time in which the observer settles. Without friction of which little decides
    whether it is estimated."""
    first, second = (case.recording.part(x) for x in np.array_split(np.arange(len(case.recording.t)), 2))
    groups = default_groups(case.scene, [case.recording])
    settings = Settings(tuple(group for group in groups if group not in OPTIONAL_FRICTION), widths=False)
    whole, cut, exchanged = (
        calibrate(case.scene, parts, settings)
        for parts in ([case.recording], [first, second], [second, first])
    )
    assert apart(whole, cut) < 0.5
    assert apart(cut, exchanged) < 1e-5


def test_a_sensor_of_the_other_sign_has_the_opposite_bias_and_the_same_rest(
    case: Case, found: Calibration
) -> None:
    sensor = case.scene.base_wrench
    assert sensor is not None
    assert case.recording.reading is not None
    sign = {"arm_on_sensor": "sensor_on_arm", "sensor_on_arm": "arm_on_sensor"}[sensor.sign]
    other = sensor.model_copy(update={"sign": sign, "bias": tuple(-x for x in sensor.bias)})
    scene = case.scene.model_copy(update={"base_wrench": other})
    result = calibrate(scene, [replace(case.recording, reading=-case.recording.reading)])
    values = tuple(
        replace(value, after=-value.after) if value.entry.group == "wrench_bias" else value
        for value in result.values
    )
    assert apart(found, replace(result, values=values)) < 1e-6


def test_a_base_frame_turned_by_a_quarter_has_the_same_axes(case: Case, found: Calibration) -> None:
    """By other angles, the residuals' weights differ, which are those of each axis."""
    scene, part = turned_base(case.scene, case.recording, 0.5 * np.pi)
    result = calibrate(scene, [part])
    named = {value.entry.name: value for value in result.values}
    for value in found.values:
        name, sign = value.entry.name, 1.0
        if value.entry.group in ("tilt", "turn", "shift"):
            sign = -1.0 if name.endswith("y") else 1.0
            name = name[:-1] + {"x": "y", "y": "x", "z": "z"}[name[-1]]
        other = named[name]
        assert bool(other.kept) == bool(value.kept), name
        if not value.kept:
            assert other.after == pytest.approx(sign * value.after, abs=1e-3 * value.std), name
            assert other.std == pytest.approx(value.std, rel=1e-3), name


@pytest.mark.parametrize("seed", [2, 3])
def test_a_calibrated_scene_is_calibrated_already(seed: int) -> None:
    """Of currents, whose torques are those by the new constants: the second run confirms all of the first."""
    case = right_setup("ur10e", seed, Drawn(seconds=12.0, inertia_error=0.0, speed=0.6))
    assert case.scene.joint_torque is not None
    assert case.scene.base_wrench is not None
    bare = JointTorqueSensor(signal=case.scene.joint_torque.signal, friction=Friction(velocity=0.05))
    off = {"bias": (0.0,) * 6, "translation": (0.02, -0.01, -0.05), "delay": 0.0}
    base = case.scene.base_wrench.model_copy(update=off)
    start = case.scene.model_copy(update={"joint_torque": bare, "base_wrench": base, "tool": None})
    first = calibrate(start, [case.recording])
    second = calibrate(first.scene, [as_read_with(first.scene, start, case.recording)])
    std = {value.entry.name: value.std for value in first.values}
    estimated = {value.entry.name: value.after for value in first.values}
    assert {v.entry.name for v in first.values if v.kept} == {v.entry.name for v in second.values if v.kept}
    # Turns, displacements and factors are those of the scene's own values, which are the new ones.
    relative = {"turn": 0.0, "shift": 0.0, "tilt": 0.0, "gain": 1.0}
    for value in second.values:
        if not value.kept:
            name = value.entry.name
            expected = relative.get(value.entry.group, estimated[name])
            assert value.after == pytest.approx(expected, abs=0.25 * std[name]), name


def test_every_second_sample_tells_the_same() -> None:
    """Within the uncertainties of both: the noise of half of the samples differs from that of all."""
    case = right_setup("ur5e", 1, Drawn(seconds=10.0, inertia_error=0.0, speed=0.5, rate=250.0))
    one, other = calibrate(case.scene, [case.recording]), calibrate(case.scene, [_halved(case.recording)])
    scores = [
        (a.after - b.after) / np.hypot(a.std, b.std)
        for a, b in zip(one.values, other.values, strict=True)
        if not (a.kept or b.kept)
    ]
    assert len(scores) > 30
    assert np.sqrt(np.mean(np.square(scores))) < 1.0


def _halved(part: FreeMotion) -> FreeMotion:
    return part.part(np.arange(0, len(part.t), 2))
