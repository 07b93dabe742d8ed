"""What a stream feels from its first sample on points to a wrong scene, until the arm has been free."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from contactsense import Estimate, Localizer, Sample, SampleBlock, Scene, forward_model
from contactsense.plausibility.stream_start import FROM_START, StreamStart
from contactsense.sensors.stream_state import MISSING, TOUCHED
from tests.plain_arm import plain_ur5e

ARM = plain_ur5e()
RIGHT = Scene(robot=ARM)
Q = np.array([0.0, -1.3, 1.6, -1.9, -1.57, 0.0])
STEP = 0.002
POINT, FORCE = np.array([-0.2, 0.0, 0.047]), np.array([0.0, 0.0, -40.0])


def stream(count: int, pushed: Callable[[float], bool] = lambda t: False) -> list[Sample]:
    """An arm on a table that moves slowly, and is pushed at times."""
    chance = np.random.default_rng(0)
    samples = []
    for i in range(count):
        t = i * STEP
        q = Q + 1e-3 * t
        torque, wrench = forward_model(RIGHT, q, "forearm", POINT, FORCE * pushed(t))[:2]
        torque = torque + chance.standard_normal(6)
        wrench = wrench + chance.standard_normal(6) * np.repeat([0.25, 0.05], 3)
        samples.append(Sample(t, q, np.full(6, 1e-3), torque, wrench))
    return samples


def told(estimates: list[Estimate]) -> list[bool]:
    return [FROM_START in estimate.reason for estimate in estimates]


@pytest.fixture(scope="module")
def localizer() -> Localizer:
    return Localizer(RIGHT)


WRONG = {
    "mounting": Scene(robot=ARM, mounting=(0.0, 0.15, 0.0)),
    "joint_torque.sign": Scene(robot=ARM, base_wrench=None),
    "force and moment": RIGHT,
}


@pytest.mark.parametrize("line", WRONG)
def test_a_wrong_scene_is_suspected_from_the_first_settled_sample_on(line: str) -> None:
    samples = stream(300)
    if line == "joint_torque.sign":
        samples = [replace(x, joint_torque=-np.array(x.joint_torque)) for x in samples]
    elif line == "force and moment":
        # The weight of an exchanged reading contradicts the scene at rest; in motion it is not checked.
        samples = [
            replace(x, qd=np.full(6, 0.02), base_wrench=np.roll(np.array(x.base_wrench), 3)) for x in samples
        ]
    localizer = Localizer(WRONG[line])
    found = told(list(localizer.run(samples)))
    assert not any(found[:40])
    assert all(found[45:])
    assert localizer.doubt == FROM_START


def test_a_touch_that_begins_later_accuses_no_scene(localizer: Localizer) -> None:
    estimates = list(localizer.run(stream(500, lambda t: t > 0.3)))
    assert estimates[-1].contacts
    assert not any(told(estimates))
    assert localizer.doubt == ""


def test_an_arm_that_is_held_at_the_start_is_believed_once_it_has_been_free(localizer: Localizer) -> None:
    samples = stream(1500, lambda t: t < 0.5 or t > 2.2)
    estimates = list(localizer.run(samples))
    found = told(estimates)
    assert all(found[45:250])
    assert not any(found[320:])
    assert estimates[-1].contacts
    assert localizer.doubt == ""
    rows = [
        np.array([getattr(x, name) for x in samples])
        for name in ("t", "q", "qd", "joint_torque", "base_wrench")
    ]
    for end, doubt in ((200, FROM_START), (700, FROM_START), (1500, "")):
        for size in (end, 170):
            blocks = SampleBlock(*(row[:end] for row in rows)).split(size)
            assert sum(len(block) for block in localizer.run_blocks(blocks)) == end
            assert localizer.doubt == doubt


def test_a_sensor_that_joins_later_has_a_start_of_its_own() -> None:
    start = StreamStart(10.0, averages=False)
    for i in range(5000):
        assert not start.update(i * STEP, MISSING)
    assert start.watches
    assert not start.update(10.0, 0)
    assert start.update(10.1, TOUCHED)
    start.reset()
    for i in range(5000):
        start.update(i * STEP, 0)
    assert not start.watches
    assert not start.update(10.1, TOUCHED)


def test_what_the_average_shows_later_has_been_there_from_the_start() -> None:
    """Torques alone, 0.6 Nm off: two or three times the noise of a residual."""
    localizer, off = Localizer(Scene(robot=ARM, base_wrench=None)), np.array([0.0, 0.45, 0.45, 0.0, 0.0, 0.0])
    samples = [
        replace(x, base_wrench=None, joint_torque=np.asarray(x.joint_torque) + off) for x in stream(500)
    ]
    estimates = list(localizer.run(samples))
    begins = next(i for i, estimate in enumerate(estimates) if estimate.contacts)
    assert begins * STEP > 0.2, "when samples would have shown it"
    assert all(told(estimates[begins:]))
    assert localizer.doubt == FROM_START
