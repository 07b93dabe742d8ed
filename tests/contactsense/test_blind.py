"""Blind is not free: no `none` from sensors that could not have felt a contact, and what `none` rules out."""

import functools
import math
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from contactsense import (
    Estimate,
    JointTorqueSensor,
    Localizer,
    Sample,
    SampleBlock,
    Scene,
    WrenchSensor,
    forward_model,
)
from contactsense.robots.tool import Tool
from contactsense.scene_model.constants import build_constants
from contactsense.sensors.settings import LinkWrenchSensor
from contactsense.sensors.stream_state import DEGRADED
from tests.plain_arm import plain_ur5e

ARM = plain_ur5e()
Q = np.array([0.0, -1.3, 1.6, -1.9, -1.57, 0.0])
STEP, COUNT, SILENT = 0.002, 300, 200
OFF_CENTRE = WrenchSensor(translation=(0.1, 0.05, -0.2))
"""Its moments are not about the base origin: forces and moments in base axes have correlated noise."""


def scene(**fields: Any) -> Scene:
    return Scene(robot=ARM, **fields)


def stream(
    of: Scene, has_value: Callable[[int], bool], wrench: np.ndarray | None = None, seed: int = 0
) -> list[Sample]:
    """An arm at rest; in the samples without values all sensors are silent. `wrench` acts on its base from
    the middle on."""
    rng = np.random.default_rng(seed)
    torque, weight = forward_model(of, Q, "base", np.zeros(3), np.zeros(3))[:2]
    constants = build_constants(of)
    factor = np.linalg.cholesky(constants.sensors.base_covariance)
    samples = []
    for i in range(COUNT):
        base = weight + factor @ rng.standard_normal(6)
        if wrench is not None and i >= COUNT // 2:
            base += wrench
        sample = Sample(STEP * i, Q, np.zeros(6))
        if has_value(i):
            sample = replace(
                sample,
                joint_torque=None if of.joint_torque is None else torque + rng.standard_normal(6),
                base_wrench=None if of.base_wrench is None else base,
            )
        samples.append(sample)
    return samples


def block(samples: list[Sample]) -> SampleBlock:
    def stack(name: str) -> np.ndarray:
        values = [getattr(sample, name) for sample in samples]
        return np.array([np.full(6, np.nan) if value is None else value for value in values])

    t = np.array([sample.t for sample in samples])
    return SampleBlock(t, stack("q"), stack("qd"), stack("joint_torque"), stack("base_wrench"))


SCENES = {
    "both sensors": scene(),
    "base sensor": scene(joint_torque=None),
    "torques": scene(base_wrench=None),
}


@functools.cache
def localizer_of(name: str) -> Localizer:
    return Localizer(SCENES[name])


@pytest.mark.parametrize("name", SCENES)
def test_silence_is_degraded_from_its_first_sample_on(name: str) -> None:
    localizer = localizer_of(name)
    samples = stream(localizer.scene, lambda i: i < SILENT)
    estimates = list(localizer.run(samples))
    assert {estimate.status for estimate in estimates[100:SILENT]} == {"none"}
    assert {estimate.status for estimate in estimates[SILENT:]} == {"degraded"}
    assert estimates[SILENT].reason == "no sensor has a value in this sample"
    assert "is missing" in estimates[-1].reason
    found = np.concatenate([one.flags for one in localizer.run_blocks([block(samples)])])
    degraded = [estimate.status == "degraded" for estimate in estimates]
    np.testing.assert_array_equal((found & localizer._sample_fields.relevant_flags & DEGRADED) != 0, degraded)


def test_a_stream_that_begins_without_values_is_degraded_until_the_sensors_settle() -> None:
    localizer = localizer_of("both sensors")
    estimates = list(localizer.run(stream(localizer.scene, lambda i: i >= 50)))
    assert {estimate.status for estimate in estimates[:85]} == {"degraded"}
    assert estimates[0].reason == "base_wrench is missing; joint_torque is missing"
    assert {estimate.status for estimate in estimates[100:]} == {"none"}


def test_one_lost_value_costs_one_sample() -> None:
    localizer = localizer_of("both sensors")
    estimates = list(localizer.run(stream(localizer.scene, lambda i: i != SILENT)))
    degraded = [i for i, estimate in enumerate(estimates) if i >= 100 and estimate.status != "none"]
    assert degraded == [SILENT]


def test_a_sensor_slower_than_the_stream_is_not_blind_between_its_values() -> None:
    localizer = localizer_of("base sensor")
    estimates = list(localizer.run(stream(localizer.scene, lambda i: i % 4 == 0 and i < SILENT)))
    assert {estimate.status for estimate in estimates[100 : SILENT + 1]} == {"none"}
    # The value of sample 200 is overdue half a usual step later, sample 201 on the border.
    assert {estimate.status for estimate in estimates[SILENT + 2 :]} == {"degraded"}


@pytest.mark.parametrize("name", ["both sensors", "base sensor"])
@pytest.mark.parametrize("base", [WrenchSensor(), OFF_CENTRE])
def test_a_detectable_force_is_detected_wherever_it_acts(name: str, base: WrenchSensor) -> None:
    localizer = Localizer(SCENES[name].model_copy(update={"base_wrench": base}))
    of = localizer.scene
    rng = np.random.default_rng(1)
    count = 1000
    covariance = build_constants(of).sensors.base_covariance
    noise = rng.standard_normal((count, 6)) @ np.linalg.cholesky(covariance).T
    fields: dict[str, Any] = {"q": np.tile(Q, (count, 1))}
    if of.joint_torque is not None:
        fields["joint_torque"] = rng.standard_normal((count, 6))
    first: dict[str, Any] = {key: 0.0 * value[0] for key, value in fields.items()}
    detectable = localizer.locate(**first | {"q": Q}, base_wrench=np.zeros(6)).detectable

    def detected(force: np.ndarray, moment: np.ndarray) -> float:
        wrench = np.concatenate((force, moment), axis=1)
        return float(localizer.locate_batch(**fields, base_wrench=wrench + noise).detected.mean())

    direction = rng.standard_normal((count, 3))
    direction *= detectable / np.linalg.norm(direction, axis=1)[:, None]
    anywhere = np.cross(rng.uniform(-0.5, 0.5, (count, 3)), direction)
    # The moment that hides the force best.
    hidden = direction @ np.linalg.solve(covariance[:3, :3], covariance[:3, 3:])
    deviation = math.sqrt(0.09 / count)
    assert detected(direction, anywhere) > 0.9 - 3.0 * deviation
    assert detected(direction, hidden) == pytest.approx(0.9, abs=3.0 * deviation)
    assert detected(0.9 * direction, hidden) < 0.9 - 3.0 * deviation


def test_a_detectable_force_is_detected_in_a_stream() -> None:
    localizer = localizer_of("both sensors")
    before = list(localizer.run(stream(localizer.scene, lambda _: True)))[-1]
    assert before.status == "none"
    rng = np.random.default_rng(2)
    for seed in range(4):
        force = rng.standard_normal(3)
        force *= before.detectable / np.linalg.norm(force)
        push = np.concatenate((force, np.zeros(3)))
        found = list(localizer.run(stream(localizer.scene, lambda _: True, push, seed)))
        assert any(event.kind == "onset" for estimate in found for event in estimate.events)
    # The observers average: a stream detects less than a single measurement does.
    assert before.detectable < 0.7 * localizer.locate(Q, base_wrench=np.zeros(6)).detectable


def test_a_lost_base_sensor_leaves_no_force_that_is_sure_to_be_detected() -> None:
    localizer = localizer_of("both sensors")
    samples = stream(localizer.scene, lambda _: True)
    samples[SILENT:] = [replace(sample, base_wrench=None) for sample in samples[SILENT:]]
    estimates = list(localizer.run(samples))
    assert np.isfinite([estimate.detectable for estimate in estimates[100:SILENT]]).all()
    missing = [estimate for estimate in estimates if "base_wrench is missing" in estimate.reason]
    assert len(missing) > 50
    assert {estimate.detectable for estimate in missing} == {math.inf}


def test_joint_torques_alone_are_sure_of_no_force() -> None:
    localizer = localizer_of("torques")
    assert localizer.locate(Q, joint_torque=np.zeros(6)).detectable == math.inf
    assert list(localizer.run(stream(localizer.scene, lambda _: True)))[-1].detectable == math.inf


def test_a_wrist_sensor_is_sure_where_only_the_tool_can_be_touched() -> None:
    tool = Tool(mass=1.0, com=(0.0, 0.0, 0.05), primitives=ARM.links[6].primitives)
    of = scene(base_wrench=None, joint_torque=JointTorqueSensor(), wrist_wrench=WrenchSensor(), tool=tool)
    zero = {"joint_torque": np.zeros(6), "wrist_wrench": np.zeros(6)}
    assert Localizer(of).locate(Q, **zero).detectable == math.inf
    only_tool = of.model_copy(update={"touchable": ("tool",)})
    assert 0.5 < Localizer(only_tool).locate(Q, **zero).detectable < 10.0


def test_the_detectable_force_of_a_link_sensor_counts_what_is_not_known_of_the_masses() -> None:
    # At rest they hide a force along gravity, and no other.
    of = scene(
        base_wrench=None, inertia_error=0.05, touchable=ARM.link_names[3:],
        link_wrenches=(LinkWrenchSensor(name="arm", link=ARM.link_names[2]),),
    )  # fmt: skip
    localizer, rng = Localizer(of), np.random.default_rng(0)
    weight = forward_model(of, Q, "forearm", np.zeros(3), np.zeros(3))

    def run(push: float) -> list[Estimate]:
        samples = []
        for i in range(COUNT):
            reading = weight.link_wrenches["arm"] + rng.standard_normal(6) * np.repeat([0.25, 0.05], 3)
            reading[2] += push if i >= COUNT // 2 else 0.0
            torque = weight.joint_torque + rng.standard_normal(6)
            samples.append(Sample(STEP * i, Q, np.zeros(6), torque, link_wrenches={"arm": reading}))
        return list(localizer.run(samples))

    free = run(0.0)[100:]
    assert {estimate.status for estimate in free} == {"none"}
    found = run(free[-1].detectable)[COUNT // 2 + 50 :]
    assert np.mean([estimate.status != "none" for estimate in found]) > 0.8
