"""What cannot be is taken out of a stream's samples, and told with field, expected and given value."""

from dataclasses import replace

import numpy as np
import pytest

from contactsense import Estimate, Localizer, Sample, SampleBlock, Scene, WrenchSensor, forward_model
from contactsense.plausibility.plausible_limits import PlausibleLimits
from contactsense.plausibility.stream_screening import StreamScreening
from contactsense.robots.tool import Tool
from contactsense.sensors.stream_state import INVALID, MISSING, UNUSABLE
from tests.plain_arm import plain_ur5e

ARM = plain_ur5e()
Q = np.array([0.0, -1.3, 1.6, -1.9, -1.57, 0.0])
STEP = 0.002
COUNT = 200


def at_rest(scene: Scene, count: int = COUNT, seed: int = 0) -> list[Sample]:
    """An arm at rest that nobody touches, with the sensors' noise."""
    chance = np.random.default_rng(seed)
    torque, wrench = forward_model(scene, Q, "base", np.zeros(3), np.zeros(3))[:2]
    noise = np.array([0.25] * 3 + [0.05] * 3)
    return [
        Sample(
            i * STEP,
            Q,
            np.zeros(6),
            torque + chance.standard_normal(6),
            wrench + noise * chance.standard_normal(6),
        )
        for i in range(count)
    ]


def answers(localizer: Localizer, samples: list[Sample]) -> list[Estimate]:
    return list(localizer.run(samples))


def test_a_right_stream_is_not_screened(ordinary: Localizer) -> None:
    settled = answers(ordinary, at_rest(ordinary.scene))[100:]
    assert {estimate.status for estimate in settled} == {"none"}


def test_positions_in_degrees_are_told(ordinary: Localizer) -> None:
    samples = [replace(sample, q=np.degrees(Q)) for sample in at_rest(ordinary.scene)]
    for estimate in answers(ordinary, samples):
        assert estimate.status == "degraded"
        assert estimate.reason.startswith("q: expected positions in rad, shoulder_lift_joint within")
        assert estimate.reason.endswith("are they in degrees?; the sample is not used")


def test_torques_beyond_the_joints_are_not_used_and_told(ordinary: Localizer) -> None:
    samples = at_rest(ordinary.scene)
    samples[150] = replace(samples[150], joint_torque=np.array([0.0, 0.0, 300.0, 0.0, 0.0, 0.0]))
    found = answers(ordinary, samples)
    assert found[150].status == "degraded"
    assert (
        "joint_torque: expected at most 1.5 times the 150 Nm of elbow_joint, got 300 Nm" in found[150].reason
    )
    assert {estimate.status for estimate in found[151:]} == {"none"}


def test_stamps_in_milliseconds_are_told(ordinary: Localizer) -> None:
    samples = [replace(sample, t=1e3 * sample.t) for sample in at_rest(ordinary.scene)]
    for estimate in answers(ordinary, samples)[1:]:
        assert estimate.status == "degraded"
        assert estimate.reason == (
            "t: expected at most 0.15 s from one sample to the next, got 2 s; is the time in milliseconds?"
        )


def test_a_step_that_no_clock_makes_is_not_told_by_another_number(ordinary: Localizer) -> None:
    samples = at_rest(ordinary.scene)
    samples[50] = replace(samples[50], t=1e9)
    estimate = answers(ordinary, samples[:51])[50]
    assert estimate.status == "degraded"
    assert "got a day or more; is the time in milliseconds?" in estimate.reason


def test_times_that_run_back_are_told(ordinary: Localizer) -> None:
    """Pairs in the wrong order: each time the stream begins again, and contacts are never detected."""
    samples = at_rest(ordinary.scene)
    samples[0::2], samples[1::2] = samples[1::2], samples[0::2]
    found = answers(ordinary, samples)
    assert {estimate.status for estimate in found} == {"degraded"}
    told = "t: expected a later time than that of the previous sample, got an earlier one"
    assert [told in estimate.reason for estimate in found] == [i % 2 == 1 for i in range(len(found))]


def test_a_saturated_channel_is_told_and_not_used() -> None:
    """A push that takes the moment to the end of the range and stays there: no contact of that size."""
    sensor = WrenchSensor(range=(1000.0, 60.0), rpy=(0.0, 0.0, 0.5), sign="sensor_on_arm")
    scene = Scene(robot=ARM, base_wrench=sensor)
    localizer, limits = Localizer(scene), PlausibleLimits(scene)
    samples = at_rest(scene)
    for i in range(150, COUNT):
        wrench = np.array(samples[i].base_wrench)
        wrench[4] += 500.0
        reading = np.clip(wrench @ limits._to_reading, -60.0, 60.0)
        samples[i] = replace(samples[i], base_wrench=np.linalg.solve(limits._to_reading.T, reading))
    found = answers(localizer, samples)
    assert {estimate.status for estimate in found[100:150]} == {"none"}
    for estimate in found[150:]:
        assert estimate.status == "degraded"
        assert (
            "base_wrench: expected a reading within the sensor's range, below 60 Nm in m" in estimate.reason
        )
        assert not estimate.contacts


WRONG = {
    "sign": (Scene(robot=ARM), -1.0, "it points the opposite way; see base_wrench.sign and mounting"),
    "tared": (Scene(robot=ARM), 0.0, "is the sensor tared? See base_wrench.bias"),
    "tilt": (Scene(robot=ARM, mounting=(0.0, np.pi / 6, 0.0)), 1.0, "it is tilted by 30 deg; see mounting"),
    "mass": (Scene(robot=ARM, tool=Tool(mass=15.0)), 1.0, "it carries 0.59 times the mass of the scene"),
}


@pytest.mark.parametrize(("scene", "factor", "advice"), WRONG.values(), ids=WRONG)
def test_a_weight_that_contradicts_the_scene_is_told(scene: Scene, factor: float, advice: str) -> None:
    """The samples are those of an arm on a table without a tool; the scene says otherwise."""
    samples = at_rest(Scene(robot=ARM))
    samples = [replace(x, base_wrench=factor * np.array(x.base_wrench)) for x in samples]
    for estimate in answers(Localizer(scene), samples):
        assert estimate.status == "degraded"
        assert "base_wrench: expected the weight of arm and tool, force (" in estimate.reason
        assert advice in estimate.reason


@pytest.mark.parametrize("mounting", ["table", "ceiling", (0.3, -0.4, 0.0)])
def test_a_right_weight_is_never_accused(mounting: object) -> None:
    """200 draws: masses wrong by 3 %, a bias of 10 N, a push of 30 N from the start."""
    scene = Scene(robot=ARM, mounting=mounting)
    chance = np.random.default_rng(1)
    limits = PlausibleLimits(scene)
    for _ in range(200):
        factor = 1.0 + 0.03 * chance.standard_normal()
        off = 10.0 * _direction(chance)
        screening = StreamScreening(scene, limits)
        push = 30.0 * _direction(chance)
        for i in range(30):
            force = factor * limits.weight.force + off + push + 0.25 * chance.standard_normal(3)
            sample = Sample(i * STEP, Q, np.zeros(6), base_wrench=np.append(force, np.zeros(3)))
            assert screening.screened(sample) is sample


def _direction(chance: np.random.Generator) -> np.ndarray:
    vector = chance.standard_normal(3)
    return np.asarray(vector / np.linalg.norm(vector))


def test_the_weight_is_checked_at_the_start_only_and_forgiven_when_it_is_right() -> None:
    scene = Scene(robot=ARM)
    screening = StreamScreening(scene, PlausibleLimits(scene))
    samples = at_rest(scene, 40)
    wrong = replace(samples[0], base_wrench=np.zeros(6))
    screening.screened(wrong)
    assert "tared" in screening.refused["base_wrench"]
    screening.screened(replace(wrong, qd=np.ones(6)))  # in motion, what was found at rest still holds
    assert "tared" in screening.refused["base_wrench"]
    for sample in samples:
        assert screening.screened(sample) is sample
    assert screening.screened(wrong) is wrong
    assert not screening.refused
    screening.reset()
    assert screening.screened(wrong) is not wrong


def _as_block(*samples: Sample) -> SampleBlock:
    return SampleBlock(
        *(np.array([getattr(s, n) for s in samples]) for n in ("t", "q", "qd", "joint_torque", "base_wrench"))
    )


@pytest.mark.parametrize(("speed", "told"), [(0.009, True), (0.011, False), (-0.011, False)])
def test_the_weight_is_compared_at_rest_only(speed: float, told: bool) -> None:
    scene = Scene(robot=ARM)
    first = at_rest(scene, 1)[0]
    turning = replace(first, base_wrench=np.zeros(6), qd=np.array([0.0, 0.0, speed, 0.0, 0.0, 0.0]))
    one, block = (StreamScreening(scene, PlausibleLimits(scene)) for _ in range(2))
    assert (one.screened(turning) is not turning) == told
    found = block.screened_block(_as_block(turning, turning)).base_wrench
    assert found is not None
    assert np.isnan(found).any(axis=1).tolist() == [told] * 2
    assert set(one.refused) == set(one.first) == set(block.first) == ({"base_wrench"} if told else set())


@pytest.mark.parametrize("interrupted", [False, True])
def test_ten_samples_in_a_row_with_the_right_weight_are_enough(interrupted: bool) -> None:
    scene = Scene(robot=ARM)
    right = at_rest(scene, 9)
    wrong = replace(right[0], base_wrench=np.zeros(6))
    for by_block in (False, True):
        screening = StreamScreening(scene, PlausibleLimits(scene))
        for sample in (*right, *[wrong] * interrupted, right[0]):
            if by_block:
                screening.screened_block(_as_block(sample))
            else:
                screening.screened(sample)
        assert (screening.screened(wrong) is not wrong) == interrupted
        assert screening.by_kernel != interrupted


def test_payloads_that_come_and_go_are_not_accused() -> None:
    scene = Scene(robot=ARM, picks_up=True)
    heavy = replace(at_rest(scene)[0], base_wrench=np.array([0.0, 0.0, -500.0, 0.0, 0.0, 0.0]))
    assert StreamScreening(scene, PlausibleLimits(scene)).screened(heavy) is heavy


@pytest.mark.parametrize("factor", [1.0, 0.0, -1.0])
def test_a_recording_is_screened_as_the_stream_is(factor: float) -> None:
    sensor = WrenchSensor(range=(1000.0, 100.0))
    scene = Scene(robot=ARM, base_wrench=sensor)
    samples = at_rest(scene)
    samples = [replace(x, base_wrench=factor * np.array(x.base_wrench)) for x in samples]
    samples[60] = replace(samples[60], q=np.degrees(Q))
    samples[80] = replace(samples[80], joint_torque=np.full(6, 1e3))
    samples[100] = replace(samples[100], base_wrench=np.full(6, 300.0))
    localizer = Localizer(scene)
    one_by_one = [_marks(estimate) for estimate in localizer.run(samples)]
    reasons = localizer.refusals
    assert len(reasons) == 3
    rows = [
        np.array([getattr(x, name) for x in samples])
        for name in SampleBlock.__dataclass_fields__
        if name not in ("wrist_wrench", "link_wrenches")
    ]
    (block,) = localizer.run_blocks([SampleBlock(*rows)])
    flags = block.flags
    together = [
        (bool(f & UNUSABLE), bool(f & (INVALID | MISSING)), bool(f & (INVALID | MISSING) << 1)) for f in flags
    ]
    assert together == one_by_one
    assert set(localizer.refusals) == set(reasons)
    assert any(any(marks) for marks in together)


def _marks(estimate: Estimate) -> tuple[bool, bool, bool]:
    """Whether sample, base wrench and joint torques were not used."""
    return (
        "the sample is not used" in estimate.reason,
        "base_wrench: " in estimate.reason,
        "joint_torque: " in estimate.reason,
    )


@pytest.mark.parametrize("huge", [1e9, 1e300])
def test_a_huge_reading_is_refused_in_few_words(huge: float) -> None:
    """Nothing overflows, in single samples and in blocks; a message has no hundreds of digits."""
    scene = Scene(robot=ARM, base_wrench=WrenchSensor())
    samples = [replace(s, base_wrench=np.array([huge, 0.0, 0.0, 0.0, 0.0, 0.0])) for s in at_rest(scene, 4)]
    localizer = Localizer(scene)
    reasons = [estimate.reason for estimate in answers(localizer, samples)]
    assert f"got ({huge:.3g}, 0.0, 0.0) N" in reasons[-1]
    assert len(reasons[-1]) < 400
    block = SampleBlock(
        np.array([s.t for s in samples]), np.array([s.q for s in samples]), np.array([s.qd for s in samples]),
        None, np.array([s.base_wrench for s in samples]),
    )  # fmt: skip
    list(localizer.run_blocks([block]))
    assert len(localizer.refusals[0]) < 400
