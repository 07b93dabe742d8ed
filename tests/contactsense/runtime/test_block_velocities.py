"""Blocks of samples whose velocities have noise: the same digits as one sample at a time."""

from collections.abc import Iterator
from dataclasses import replace
from typing import NamedTuple

import numpy as np
import pytest

from contactsense import Localizer, Sample, SampleBlock, Scene
from contactsense.kinematics.model import build_model, empty_motion
from contactsense.kinematics.momenta import kinematics_and_momenta
from contactsense.runtime.state import State
from contactsense.service.mock.arm.measured_velocity import measured_velocity
from tests.contactsense.link_sensors.truth import ARM, BASE, FOREARM, SENSOR, STEP, TORQUE, stream
from tests.contactsense.runtime.test_blocks import agree, recording
from tests.plain_arm import plain_ur5e

SCENE = Scene(robot=ARM, base_wrench=BASE, joint_torque=TORQUE, link_wrenches=(SENSOR,), bandwidth=20.0)
POINT, PUSH = np.array([-0.2, 0.04, 0.007]), np.array([0.0, -30.0, 0.0])

pytestmark = pytest.mark.slow  # its kernels compile for long


def arrays(state: NamedTuple) -> Iterator[np.ndarray]:
    """Those of a state, and of the states in it."""
    for value in state:
        if isinstance(value, tuple):
            yield from arrays(value)  # type: ignore[arg-type]
        else:
            yield np.array(value)


def what_follows_from_velocities(localizer: Localizer) -> list[np.ndarray]:
    """In a localizer after its last sample."""
    state: State = localizer._buffers.state
    parts = (state.velocity_noise, state.base_velocity_error, state.link_velocity_error)
    covariances = (state.base_noise, state.base_covariance, state.link_variance)
    return [array for part in parts for array in arrays(part)] + [array.copy() for array in covariances]


def block_of(samples: list[Sample]) -> SampleBlock:
    """Samples of `stream`, of which some may lack wrenches."""
    missing = np.full(6, np.nan)
    return SampleBlock(
        *(np.array([getattr(x, name) for x in samples]) for name in ("t", "q", "qd", "joint_torque")),
        np.array([missing if x.base_wrench is None else x.base_wrench for x in samples]),
        link_wrenches={
            SENSOR.name: np.array([(x.link_wrenches or {}).get(SENSOR.name, missing) for x in samples])
        },
    )


def test_they_are_the_same_with_a_base_sensor() -> None:
    """The arm rests and moves; a few samples cannot be used, and every fourth has a wrench for a while."""
    block = recording()[:4500]
    qd = measured_velocity(block.qd, 0.001, np.random.default_rng(1))
    assert block.base_wrench is not None
    t, wrench = block.t.copy(), block.base_wrench.copy()
    wrench[1200:2200][np.arange(1000) % 4 > 0] = np.nan
    t[700], qd[800, 1] = t[699], np.nan
    whole = SampleBlock(t, block.q, qd, block.joint_torque, wrench)
    agree(Scene(robot=plain_ur5e()), whole, lambda block: [block[:1001], block[1001:]])


@pytest.mark.parametrize("samples", [100, 497, 800])
def test_they_are_the_same_with_a_sensor_in_the_arm(samples: int) -> None:
    """After a number of samples with which the arm is free or touched, and whether or not the covariances
    were refreshed in the last one."""
    load = (FOREARM, PUSH, np.cross(POINT, PUSH))
    taken = stream(SCENE, 1.6, [load], velocity_noise=0.001)[:samples]
    for i in range(200, min(samples, 300)):
        taken[i] = replace(taken[i], link_wrenches={} if i % 3 else taken[i].link_wrenches)
    localizer = Localizer(SCENE)
    estimates = list(localizer.run(taken))
    expected = what_follows_from_velocities(localizer)
    found = list(localizer.run_blocks([block_of(taken)]))
    assert any(estimate.contacts for estimate in estimates) == (samples > 550)
    assert sum(len(part.sample) for part in found) == sum(bool(one.contacts) for one in estimates)
    for one, other in zip(what_follows_from_velocities(localizer), expected, strict=True):
        np.testing.assert_array_equal(one, other)


def test_each_sensor_has_the_inertia_that_it_carries_and_its_own_steps() -> None:
    """The base sensor has a value in each sample, that of the forearm in each fourth."""
    localizer, model = Localizer(SCENE), build_model(ARM)
    samples = stream(SCENE, 0.5, velocity_noise=0.001)
    state = localizer._buffers.state
    for i, sample in enumerate(samples):
        localizer.step(sample if i % 4 == 0 else replace(sample, link_wrenches={}))
        if i > 200 and i % 4 == 0 and state.velocity_noise.history[0].due:
            break
    base, forearm = state.base_velocity_error, state.link_velocity_error
    assert base.steps.history[0].step == pytest.approx(STEP)
    assert forearm.steps.history[0][0].step == pytest.approx(4.0 * STEP)
    motion, gravity = empty_motion(6), np.array([0.0, 0.0, -9.81])
    for j in range(6):
        kinematics_and_momenta(model, sample.q, np.eye(6)[j], gravity, motion)
        np.testing.assert_allclose(base.unit_momentum[j], motion.momentum[1], atol=1e-9)
        np.testing.assert_allclose(forearm.unit_momentum[0, j], motion.momentum[FOREARM], atol=1e-9)
