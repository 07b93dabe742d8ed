"""Sensors at their range are told and not used; the arm's own load on them is bounded."""

from dataclasses import replace

import numpy as np
import pytest

from contactsense import Localizer, Sample, SampleBlock, Scene, WrenchSensor, forward_model
from contactsense.benchmarks.calibration.simulate import arm_of
from contactsense.plausibility.largest_reading import (
    RAMP_TIME,
    largest_reading_at_rest,
    largest_reading_in_motion,
)
from contactsense.robots.link_poses import link_poses
from contactsense.robots.tool import Tool
from contactsense.scene_model.link_sensor_frame import LinkSensorFrame
from contactsense.scene_model.load_weight import LoadWeight
from contactsense.scene_model.wrench_map import WrenchMap
from contactsense.sensors.settings import LinkInertia
from contactsense.sensors.stream_state import INVALID
from contactsense.service.mock.arm.newton_euler import inverse_dynamics
from tests.plain_arm import plain_ur5e

ARM = plain_ur5e()
Q = np.array([0.0, -1.3, 1.6, -1.9, -1.57, 0.0])
WRIST = WrenchSensor(
    rpy=(0.3, -0.2, 0.5), translation=(0.01, 0.0, 0.03), sign="sensor_on_arm", bias=(1, 2, 3, 0.1, 0.2, 0.3),
    range=(100.0, 8.0),
)  # fmt: skip
SCENE = Scene(robot=ARM, tool=Tool(mass=1.5, com=(0.0, 0.0, 0.05)), wrist_wrench=WRIST)
FRAME = LinkSensorFrame(SCENE, "wrist_wrench")
TOOL_WEIGHT = LoadWeight(SCENE, "wrist_wrench")


@pytest.fixture(scope="module")
def localizer() -> Localizer:
    return Localizer(SCENE)


def readings(moment: float) -> np.ndarray:
    """A wrist wrench at rest, base axes, with which the sensor reads this moment about its x axis [Nm]."""
    read = FRAME.reading(Q, TOOL_WEIGHT.wrench(Q))
    read[3] = moment
    return FRAME.wrench(Q, read)


def test_the_wrist_frame_is_that_of_the_flange() -> None:
    flange = link_poses(ARM, Q)[-1]
    R = flange[:3, :3] @ WRIST.rotation
    place = flange[:3, 3] + flange[:3, :3] @ WRIST.translation
    wrench = np.array([3.0, -2.0, 7.0, 0.5, 0.4, -0.6])
    force, moment = R.T @ wrench[:3], R.T @ (wrench[3:] - np.cross(place, wrench[:3]))
    np.testing.assert_allclose(FRAME.reading(Q, wrench), WRIST.bias - np.concatenate((force, moment)))
    np.testing.assert_allclose(FRAME.wrench(Q, FRAME.reading(Q, wrench)), wrench)


def test_a_saturated_wrist_sensor_is_told_and_not_used_in_streams_and_recordings(
    localizer: Localizer,
) -> None:
    """A push takes the moment to the end of the range and stays there."""
    chance = np.random.default_rng(0)
    torque, base = forward_model(SCENE, Q, "base", np.zeros(3), np.zeros(3))[:2]
    noise = np.repeat([0.25, 0.05], 3)
    samples = [
        Sample(
            0.002 * i, Q, np.zeros(6), torque + chance.standard_normal(6),
            base + noise * chance.standard_normal(6),
            TOOL_WEIGHT.wrench(Q) + 0.1 * noise * chance.standard_normal(6),
        )
        for i in range(120)
    ]  # fmt: skip
    samples[100:] = [replace(sample, wrist_wrench=readings(-8.0)) for sample in samples[100:]]
    estimates = list(localizer.run(samples))
    assert {estimate.status for estimate in estimates[60:100]} == {"none"}
    for estimate in estimates[100:]:
        assert estimate.status == "degraded"
        assert not estimate.contacts
        text = "wrist_wrench: expected a reading within the sensor's range, below 8 Nm in mx, got -8 Nm"
        assert text in estimate.reason
    (told,) = localizer.refusals
    names = ("t", "q", "qd", "joint_torque", "base_wrench", "wrist_wrench")
    block = SampleBlock(*(np.array([getattr(x, name) for x in samples]) for name in names))
    (found,) = localizer.run_blocks([block])
    assert localizer.refusals == (told,)
    np.testing.assert_array_equal(found.flags & INVALID << 2 > 0, np.arange(120) >= 100)


def test_a_request_with_a_saturated_wrist_sensor_is_refused(localizer: Localizer) -> None:
    torque, base = forward_model(SCENE, Q, "base", np.zeros(3), np.zeros(3))[:2]
    weight = TOOL_WEIGHT.wrench(Q)
    for wrist, external in ((readings(8.5), False), (readings(8.5) - weight, True)):
        given = {
            "base_wrench": np.zeros(6) if external else base,
            "joint_torque": np.zeros(6) if external else torque,
            "wrist_wrench": wrist,
        }
        message = r": expected a reading within the sensor's range, below 8 Nm in mx, got 8\.5 Nm"
        with pytest.raises(ValueError, match=rf"^wrist_wrench{message}"):
            localizer.locate(Q, external=external, **given)
        rows = {name: np.stack([value] * 2) for name, value in given.items()}
        rows["wrist_wrench"][0] = 0.0 if external else weight
        with pytest.raises(ValueError, match=rf"^wrist_wrench\[1\]{message}"):
            localizer.locate_batch(np.stack([Q] * 2), external=external, **rows)
        assert localizer.locate(Q, external=external, **given | {"wrist_wrench": rows["wrist_wrench"][0]})


@pytest.mark.parametrize("field", ["base_wrench", "wrist_wrench"])
def test_no_motion_within_the_limits_loads_a_sensor_more(field: str) -> None:
    """Against the mock's dynamics; for the wrist, of an arm of which only the tool has a mass."""
    sensor = WrenchSensor(rpy=(0.2, 0.1, 0.4), translation=(0.02, 0.0, -0.05), bias=(5, 0, 0, 0, 1, 0))
    scene = SCENE.model_copy(update={field: sensor, "mounting": (0.3, -0.2, 0.0)})
    bound = largest_reading_in_motion(scene, field)
    arm, chance = arm_of(scene), np.random.default_rng(1)
    if field == "wrist_wrench":
        tool = arm_of(scene.model_copy(update={"inertia": massless()})).links[-1]
        bare = arm_of(Scene(robot=ARM).model_copy(update={"inertia": massless()}))
        arm = replace(bare, links=(*bare.links[:-1], tool))
    speed = np.array([joint.velocity_limit for joint in ARM.joints])
    q = chance.uniform(-np.pi, np.pi, (30_000, 6))
    qd, ramp = speed * chance.choice([-1.0, 0.0, 1.0], q.shape), speed / RAMP_TIME
    qdd = ramp * chance.choice([-1.0, 1.0], q.shape)
    wrench = inverse_dynamics(arm, q, qd, qdd, (), tuple(scene.gravity_base))[1]  # type: ignore[arg-type]
    if field == "wrist_wrench":
        read = LinkSensorFrame(scene, field).readings(q, wrench)
    else:
        read = WrenchMap.of(sensor).reading(wrench)
    assert (bound >= largest_reading_at_rest(scene, field)).all()
    largest = np.abs(read).max(axis=0)
    assert (bound > largest).all()
    assert (bound < 2.0 * largest).all()


def massless() -> dict[str, object]:
    nothing = LinkInertia(mass=0.0, com=(0.0, 0.0, 0.0), tensor=(0.0,) * 6)
    return {link.name: nothing for link in ARM.links}
