"""What a check says does not depend on how the same motion and the same cell are described."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from contactsense import Scene
from contactsense.benchmarks.calibration.setup_draws import Settings, right_setup, wrong_setup
from contactsense.calibration import FreeMotion, calibrate
from contactsense.setup_check import SetupCheck, check
from tests.turned_base import turned_base

pytestmark = pytest.mark.slow

Same = Callable[[Scene, FreeMotion], tuple[Scene, FreeMotion]]


def later(scene: Scene, part: FreeMotion) -> tuple[Scene, FreeMotion]:
    """The clock of a controller that counts from 1970."""
    return scene, replace(part, t=part.t + 1.7e9)


def other_sign(scene: Scene, part: FreeMotion) -> tuple[Scene, FreeMotion]:
    """The base sensor with the other sign and the opposite readings."""
    sensor = scene.base_wrench
    assert sensor is not None
    assert part.reading is not None
    sign = {"arm_on_sensor": "sensor_on_arm", "sensor_on_arm": "arm_on_sensor"}[sensor.sign]
    bias = tuple(-x for x in sensor.bias)
    turned = sensor.model_copy(update={"sign": sign, "bias": bias})
    return scene.model_copy(update={"base_wrench": turned}), replace(part, reading=-part.reading)


def other_axes(scene: Scene, part: FreeMotion) -> tuple[Scene, FreeMotion]:
    """The base sensor's frame and its readings turned."""
    sensor = scene.base_wrench
    assert sensor is not None
    assert part.reading is not None
    turn = Rotation.from_rotvec([0.4, -0.9, 0.3])
    axes = Rotation.from_matrix(sensor.rotation) * turn
    readings = np.hstack([turn.inv().apply(x) for x in np.split(part.reading, 2, axis=1)])
    bias = np.hstack([turn.inv().apply(x) for x in np.split(np.array(sensor.bias), 2)])
    update = {"rpy": tuple(axes.as_euler("xyz").tolist()), "bias": tuple(bias.tolist())}
    other = scene.model_copy(update={"base_wrench": sensor.model_copy(update=update)})
    return other, replace(part, reading=readings)


def verdicts(found: SetupCheck) -> dict[str, str]:
    return {item.line: item.verdict for item in found.findings}


@pytest.fixture(scope="module", params=["tool mass wrong by 0.5 to 2 kg", ""])
def checked(request: pytest.FixtureRequest) -> tuple[Scene, FreeMotion, SetupCheck]:
    """A cell with one wrong line or none, and what is said of it."""
    drawn = Settings(seconds=10.0)
    case = wrong_setup(request.param, "ur5e", 1, drawn) if request.param else right_setup("ur5e", 1, drawn)
    return case.scene, case.recording, check(case.scene, [case.recording])


@pytest.mark.parametrize("same", [later, other_sign, other_axes, turned_base])
def test_another_description_of_the_same_cell_has_the_same_verdicts(
    same: Same, checked: tuple[Scene, FreeMotion, SetupCheck]
) -> None:
    *cell, one = checked
    scene, part = same(*cell)
    other = check(scene, [part])
    assert verdicts(one) == verdicts(other)
    for first, second in zip(one.wrong, other.wrong, strict=True):
        assert first.line == second.line == "tool.mass"
        assert float(first.proposed or "") == pytest.approx(float(second.proposed or ""), abs=0.005)
        # Priors of the biases and the noise are those of each axis.
        assert first.evidence == pytest.approx(second.evidence, rel=0.05)
    assert one.residuals.force == pytest.approx(other.residuals.force, rel=1e-3)
    assert one.residuals.torque == pytest.approx(other.residuals.torque, rel=1e-3)


def test_the_order_of_recordings_does_not_matter() -> None:
    """Not even for the evidence: the last residual of one recording is no neighbour of the first of the next
    one."""
    case = wrong_setup("tool mass wrong by 0.5 to 2 kg", "ur5e", 1, Settings(seconds=12.0))
    parts = [case.recording.part(rows) for rows in np.array_split(np.arange(len(case.recording.t)), 3)]
    one, other = check(case.scene, parts), check(case.scene, [parts[2], parts[0], parts[1]])
    for first, second in zip(one.findings, other.findings, strict=True):
        assert first.line == second.line
        assert first.verdict == second.verdict
        assert first.proposed == second.proposed
        if first.evidence is not None:
            assert second.evidence == pytest.approx(first.evidence, rel=1e-3, abs=0.05), first.line


@pytest.mark.parametrize("pieces", [2, 3])
def test_a_recording_that_is_cut_says_the_same(pieces: int) -> None:
    case = wrong_setup("mounting tilted by 4 to 30 degrees", "ur5e", 4, Settings(seconds=15.0))
    parts = [case.recording.part(r) for r in np.array_split(np.arange(len(case.recording.t)), pieces)]
    assert [item.line for item in check(case.scene, parts).wrong] == [case.line]
    right = right_setup("ur5e", 4, Settings(seconds=15.0))
    parts = [right.recording.part(r) for r in np.array_split(np.arange(len(right.recording.t)), pieces)]
    assert check(right.scene, parts).fits


@pytest.mark.parametrize("arm", ["ur5e", "ur10e"])
def test_nothing_is_said_of_a_scene_that_calibrate_has_written(arm: str) -> None:
    """Neither a wrong line nor an offset of the base sensor nor friction, though the scene before has all."""
    case = right_setup(arm, 1, Settings(seconds=15.0, inertia_error=0.0))
    assert case.scene.base_wrench is not None
    off = case.scene.base_wrench.model_copy(update={"translation": (0.1, -0.05, -0.2), "bias": (0.0,) * 6})
    before = case.scene.model_copy(update={"base_wrench": off})
    assert [item.line for item in check(before, [case.recording]).wrong] == ["base_wrench.translation"]
    found = check(calibrate(before, [case.recording]).scene, [case.recording])
    assert found.fits
    assert found.base_offset is None
    assert found.friction is None
