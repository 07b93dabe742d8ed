"""A stream whose sensors are noisier than the scene states: told, followed, and no contact."""

import numpy as np
import pytest

from contactsense import JointTorqueSensor, Localizer, Sample, Scene, WrenchSensor
from tests.at_rest import weight
from tests.plain_arm import plain_ur5e

DT, BEGINS, FOLLOWED, ENDS = 0.002, 3.0, 5.0, 15.0
"""Sample time, when the noise grows, when it is followed, end of the stream [s]."""
Q = np.array([0.2, -1.1, 1.3, -0.8, -1.2, 0.5])
SCENE = Scene(
    robot=plain_ur5e(),
    base_wrench=WrenchSensor(force_noise=0.25, moment_noise=0.05),
    joint_torque=JointTorqueSensor(noise=0.5),
)


@pytest.fixture(scope="module")
def localizer() -> Localizer:
    return Localizer(SCENE)


@pytest.mark.parametrize("ratio", [1.4, 3.0])
def test_it_is_followed_within_two_seconds_and_told(localizer: Localizer, ratio: float) -> None:
    """Then a push of 20 N on the whole arm's base axis is still an onset."""
    torque, wrench = weight(SCENE, Q)
    rng = np.random.default_rng(1)
    localizer.reset()
    onsets, reasons = [], set()
    for t in np.arange(0.0, ENDS + 0.5, DT):
        scale = ratio if t >= BEGINS else 1.0
        push = np.array([20.0, 0.0, 0.0, 0.0, 10.0, 0.0]) if t >= ENDS else np.zeros(6)
        motion = localizer._buffers.state.motion
        estimate = localizer.step(
            Sample(
                float(t), Q, np.zeros(6),
                torque - (motion.screw @ push if t > 0.0 else 0.0) + scale * 0.5 * rng.standard_normal(6),
                wrench + push + scale * np.repeat([0.25, 0.05], 3) * rng.standard_normal(6),
            )
        )  # fmt: skip
        onsets += [event.t for event in estimate.events if event.kind == "onset"]
        if FOLLOWED < t < ENDS:
            reasons.add(estimate.reason)
    assert not [t for t in onsets if FOLLOWED < t < ENDS or t < BEGINS]
    if ratio < 2.0:
        assert min(onsets) > ENDS
    assert any(t > ENDS for t in onsets)
    assert any("times as large as noise and model allow" in reason for reason in reasons)
