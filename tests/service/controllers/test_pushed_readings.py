"""What a controller repeats while the arm moves is told and not used; at rest it may repeat."""

import contextlib
import json
import socket
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from contactsense import Sample, Scene
from contactsense.robots.tool import Tool
from contactsense.scene import JointTorqueSensor, WrenchSensor
from contactsense.service.controllers.framing import frame
from contactsense.service.controllers.push_source import PushSource
from contactsense.service.controllers.pushed_readings import HELD, PushedReadings
from contactsense.service.controllers.sample_message import MessageError

STEP = 0.002
SCENE = Scene(robot="ur5e", wrist_wrench=WrenchSensor(), tool=Tool(mass=1.0))


def moving(i: int) -> Sample:
    """Sample number i of an arm that moves; every number differs from those of other samples."""
    speed = np.linspace(0.1, 0.6, 6)
    return Sample(
        t=STEP * i,
        q=STEP * i * speed,
        qd=speed,
        joint_torque=10.0 + 0.01 * i + np.arange(6),
        base_wrench=20.0 + 0.01 * i + np.arange(6),
        wrist_wrench=30.0 + 0.01 * i + np.arange(6),
    )


def test_an_arm_that_moves_is_believed() -> None:
    readings = PushedReadings(SCENE)
    for i in range(100):
        sample = moving(i)
        checked = readings.checked(sample)
        assert checked.joint_torque is sample.joint_torque
        assert checked.base_wrench is sample.base_wrench
        assert checked.wrist_wrench is sample.wrist_wrench
    assert readings.trouble == ()


@pytest.mark.parametrize("field", ["joint_torque", "base_wrench", "wrist_wrench"])
def test_a_reading_that_repeats_in_motion_is_left_out(field: str) -> None:
    readings, first = PushedReadings(SCENE), getattr(moving(0), field)
    for i in range(100):
        checked = readings.checked(replace(moving(i), **{field: first}))
        assert (getattr(checked, field) is None) == (STEP * i > HELD)
        others = {"joint_torque", "base_wrench", "wrist_wrench"} - {field}
        assert all(getattr(checked, other) is not None for other in others)
    (text,) = readings.trouble
    assert text.startswith(f"{field}: the controller repeats the same reading")


def noisy(i: int, start: int, rng: np.random.Generator) -> Sample:
    """Sample number i of an arm that moves from sample number `start` on, and has noisy sensors."""
    sample = moving(max(0, i - start + 1))
    fields = {name: rng.standard_normal(6) for name in ("joint_torque", "base_wrench", "wrist_wrench")}
    return replace(sample, t=STEP * i, qd=0.0 * sample.qd if i < start else sample.qd, **fields)


def test_samples_that_are_sent_twice_are_used_once() -> None:
    """As estimates they were `degraded` by turns: a rule with `on_degraded: ignore` began again each time."""
    readings = PushedReadings(SCENE)
    for i in range(20):
        assert readings.checked(moving(i)).t == moving(i).t
        with pytest.raises(MessageError, match=r"t: expected a later time than .*, got .* again"):
            readings.checked(moving(i))
    (text,) = readings.trouble
    assert text.startswith("t: samples have the time of the one before")


@pytest.mark.parametrize("start", [400, 2000])
@pytest.mark.parametrize("value", [0.0, 3.0])
@pytest.mark.parametrize("field", ["joint_torque", "base_wrench", "wrist_wrench"])
def test_a_value_that_is_stuck_while_others_change_is_told(field: str, value: float, start: int) -> None:
    readings, rng = PushedReadings(SCENE), np.random.default_rng(0)
    for i in range(1000):
        stuck, sample = i >= 500, noisy(i, start, rng)
        if stuck:
            getattr(sample, field)[4] = value
        checked = readings.checked(sample)
        assert (getattr(checked, field) is None) == stuck or 500 <= i < 510
        others = {"joint_torque", "base_wrench", "wrist_wrench"} - {field}
        assert all(getattr(checked, other) is not None for other in others)
    (text,) = readings.trouble
    assert text.startswith(f"{field}[4]: this value stays the same")
    assert getattr(readings.checked(noisy(1000, start, rng)), field) is not None


def test_constants_of_a_simulator_are_believed() -> None:
    """The torque of an upright axis is 0, a joint that rests has a constant one, and nothing has noise."""
    readings = PushedReadings(SCENE)
    constant = {name: getattr(moving(0), name) for name in ("joint_torque", "base_wrench", "wrist_wrench")}
    for i in range(3000):
        rests = i % 1000 < 500
        sample = moving(i - 499 - i // 1000 * 500)
        if rests:
            sample = replace(moving(i // 1000 * 500), **constant, qd=np.zeros(6))
        torque = sample.joint_torque.copy()
        torque[0], torque[3] = 0.0, 7.0
        checked = readings.checked(replace(sample, t=STEP * i, joint_torque=torque))
        assert checked.joint_torque is torque
        assert checked.base_wrench is not None
        assert checked.wrist_wrench is not None
    assert readings.trouble == ()


@pytest.mark.slow
def test_a_constant_for_a_joint_without_a_sensor_is_believed() -> None:
    readings, rng = PushedReadings(SCENE), np.random.default_rng(0)
    for i in range(7000):
        sample = noisy(i, 500, rng)
        assert sample.joint_torque is not None
        sample.joint_torque[5] = 0.0
        assert readings.checked(sample).joint_torque is not None


def test_a_sensor_slower_than_the_controller_is_believed() -> None:
    readings = PushedReadings(SCENE)
    for i in range(100):
        sample = replace(moving(i), base_wrench=moving(i // 5 * 5).base_wrench)
        assert readings.checked(sample).base_wrench is not None
    assert readings.trouble == ()


def test_a_sensor_that_is_too_slow_is_told() -> None:
    """At 50 Hz, four in ten samples lack it: its estimates need a reason."""
    readings = PushedReadings(SCENE)
    for i in range(100):
        readings.checked(replace(moving(i), base_wrench=moving(i // 10 * 10).base_wrench))
    (text,) = readings.trouble
    assert "slower than 100 Hz?" in text


def test_a_sensor_that_is_late_now_and_then_is_no_trouble() -> None:
    readings, lacking = PushedReadings(SCENE), 0
    for i in range(400):
        newest = i // 100 * 100 if i % 100 < 7 else i  # 14 ms late four times
        checked = readings.checked(replace(moving(i), base_wrench=moving(newest).base_wrench))
        lacking += checked.base_wrench is None
    assert lacking == 4
    assert readings.trouble == ()


def test_samples_with_stale_positions_are_refused() -> None:
    readings, first = PushedReadings(SCENE), moving(0)
    readings.checked(first)
    for i in range(1, 50):
        with pytest.raises(MessageError, match="q: expected positions that change"):
            readings.checked(replace(moving(i), q=first.q))
    assert "its state is stale" in readings.trouble[0]
    assert readings.checked(moving(50)).t == moving(50).t


@pytest.mark.parametrize(
    ("times", "used", "told"),
    [
        ([0, 0, 1, 1, 2, 2, 3, 3], [0, 1, 2, 3], "t: samples have the time of the one before"),
        ([1, 0, 3, 2, 5, 4, 7, 6], [1, 3, 5, 7], "t: the times of the samples run back again and again"),
        (
            [0, 1000, 1, 1001, 2, 1002, 3],
            [0, 1000, 1, 1001, 2, 1002, 3],
            "t: the times of the samples jump back",
        ),
        ([0, 1, 1, 2, 2, 3], [0, 1, 2, 3], None),  # few
    ],
)
def test_what_is_wrong_with_the_times_is_told(times: list[int], used: list[int], told: str | None) -> None:
    readings, taken = PushedReadings(SCENE), []
    for i in times:
        # At rest: two clocks would contradict the velocities, too.
        with contextlib.suppress(MessageError):
            readings.checked(replace(moving(0), t=STEP * i, qd=np.zeros(6)))
            taken.append(i)
    assert taken == used
    assert [text[: len(told or "")] for text in readings.trouble] == ([] if told is None else [told])


def test_a_simulator_at_rest_may_repeat_itself() -> None:
    readings, sample = PushedReadings(SCENE), replace(moving(0), qd=np.zeros(6))
    for i in range(100):
        checked = readings.checked(replace(sample, t=STEP * i))
        assert checked.joint_torque is not None
        assert checked.base_wrench is not None
    assert readings.trouble == ()


@pytest.mark.parametrize(
    ("meaning", "torque_is_used"), [("motor", False), ("gravity_free", True), ("external", True)]
)
def test_a_reading_that_carries_the_arm_is_never_exactly_zero(meaning: str, torque_is_used: bool) -> None:
    scene = Scene(robot="ur5e", joint_torque=JointTorqueSensor.model_validate({"meaning": meaning}))
    readings, zero = PushedReadings(scene), np.zeros(6)
    for i in range(10):
        checked = readings.checked(replace(moving(i), joint_torque=zero, base_wrench=zero, wrist_wrench=None))
        assert checked.base_wrench is None
        assert (checked.joint_torque is not None) == torque_is_used
    assert any(text.startswith("base_wrench: the reading is exactly zero") for text in readings.trouble)


def test_the_source_tells_what_it_leaves_out(tmp_path: Path) -> None:
    source = PushSource(SCENE, tmp_path / "source")
    with socket.socket(socket.AF_UNIX, socket.SOCK_STREAM) as controller:
        controller.connect(str(tmp_path / "source"))
        source.poll(0.1)
        samples = []
        for i in range(100):
            content = {"t": STEP * i, "q": moving(i).q.tolist(), "qd": moving(i).qd.tolist()}
            content["base_wrench"] = [1.0, 2.0, 3.0, 4.0, 5.0, 6.0]
            controller.sendall(frame(json.dumps(content).encode(), False))
            samples += source.poll(0.1)
        assert [sample.base_wrench is None for sample in samples] == [STEP * i > HELD for i in range(100)]
        assert source.health.trouble.startswith("base_wrench: the controller repeats the same reading")
        assert source.health.without_wrench == sum(sample.base_wrench is None for sample in samples)
    source.close()
