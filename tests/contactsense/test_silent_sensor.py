"""A sensor that falls silent while the arm moves, and comes back: no contact begins."""

import math
from dataclasses import replace

import pytest

from contactsense import Localizer, Sample, Scene
from contactsense.sensors.stream_state import SETTLING_PERIODS
from contactsense.service.mock.arm.script import Script
from contactsense.service.mock.arm.simulated_arm import simulate

SCRIPT = Script.model_validate(
    {
        "robot": "ur5e",
        "noise": {"base_force": 0.25, "base_moment": 0.05, "joint_torque": 1.0, "seed": 3},
        "trajectory": {
            "start": [0.0, -1.3, 1.6, -1.9, -1.57, 0.0],
            "moves": [{"to": [0.9, -1.0, 1.3, -1.9, -1.2, 0.5], "duration": 3.0, "dwell": 0.0}],
        },
    }
)
SETTLED, SILENT, BACK = 100, 60, 60
"""Samples before the sensor falls silent, without it, and with it again."""


@pytest.mark.parametrize("sensor", ["joint_torque", "base_wrench"])
def test_no_contact_begins_wherever_a_sensor_falls_silent(sensor: str) -> None:
    motion = simulate(SCRIPT)
    columns = zip(motion.t, motion.q, motion.qd, motion.joint_torque, motion.base_wrench, strict=True)
    samples = [Sample(*values) for values in columns]
    localizer = Localizer(Scene(robot="ur5e"))
    for start in range(SETTLED, len(samples) - SILENT - BACK, 17):
        silent = range(start, start + SILENT)
        localizer.reset()
        for i in range(start - SETTLED, start + SILENT + BACK):
            sample = replace(samples[i], **{sensor: None}) if i in silent else samples[i]
            estimate = localizer.step(sample)
            assert not estimate.contacts, (sensor, start, i - start, estimate.contacts[0].link)


@pytest.mark.parametrize("sensor", ["joint_torque", "base_wrench"])
def test_a_sensor_that_returns_is_named_until_it_is_used_again(sensor: str) -> None:
    motion = simulate(SCRIPT)
    columns = zip(motion.t, motion.q, motion.qd, motion.joint_torque, motion.base_wrench, strict=True)
    localizer = Localizer(Scene(robot="ur5e"))
    returns, step = SETTLED + SILENT, motion.t[1] - motion.t[0]
    settled = returns + math.ceil(SETTLING_PERIODS / localizer.scene.bandwidth / step)
    for i, values in zip(range(returns + BACK), columns, strict=False):
        sample = Sample(*values)
        estimate = localizer.step(replace(sample, **{sensor: None}) if SETTLED <= i < returns else sample)
        if returns <= i < settled - 1:
            assert estimate.status == "degraded"
            assert estimate.reason == f"{sensor} is settling after its start: not used yet"
        elif SETTLED - 1 <= i <= SETTLED or i > settled:
            assert estimate.reason == ""


@pytest.mark.parametrize("silent", [30, 60])
def test_what_is_detectable_is_known_again_as_soon_as_the_sensor_is(silent: int) -> None:
    """Without the base sensor it is infinite. That must not outlast the outage: `none` would mean nothing."""
    motion = simulate(SCRIPT)
    columns = zip(motion.t, motion.q, motion.qd, motion.joint_torque, motion.base_wrench, strict=True)
    localizer = Localizer(Scene(robot="ur5e"))
    outage = range(SETTLED, SETTLED + silent)
    free = []
    for i, values in zip(range(SETTLED + silent + 2 * BACK), columns, strict=False):
        sample = Sample(*values)
        estimate = localizer.step(replace(sample, base_wrench=None) if i in outage else sample)
        assert i < SETTLED or math.isfinite(estimate.detectable) == (estimate.status == "none"), i
        free.append(estimate.status == "none")
    assert not all(free[SETTLED:])
    assert all(free[-BACK:])
