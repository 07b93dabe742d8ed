"""Values in the packets of both sensors that cannot be measurements, from the mock's wire to samples."""

import numpy as np
import pytest

from contactsense.scene import JointTorqueSensor, Scene
from contactsense.service.mock.arm.cell import TORQUE_CONSTANTS
from contactsense.service.mock.interfaces.wire_faults import Fault
from contactsense.service.mock.servers import MockServers
from contactsense.service.sensors.live_source import LiveSource, SourceSettings
from tests.service.loopback import until, waiting_clock
from tests.service.sensors.mock_source import (
    FEED,
    MOCK,
    SCENE,
    collect,
    settings_for,
    start_when_connected,
)


def test_numbers_that_are_none():
    with MockServers(FEED, MOCK) as servers, LiveSource(SCENE, settings_for(servers)) as source:
        collect(source, 10)
        servers.rtde.fault = Fault.NAN
        assert until(lambda: source.poll(0.1) == [] and source.health.unusable > 10)
        servers.rtde.fault = Fault.NONE
        assert collect(source, 10)


def test_each_value_of_the_torques_is_used_once():
    torque = FEED.joint_torque[np.arange(FEED.n) // 3 * 3]  # a signal that is three times slower
    with (
        MockServers(FEED, MOCK, fields={"actual_current_as_torque": torque}) as servers,
        LiveSource(SCENE, settings_for(servers)) as source,
    ):
        samples = collect(source, 60)
    given = [tuple(sample.joint_torque) for sample in samples if sample.joint_torque is not None]
    assert len(set(given)) == len(given) == pytest.approx(len(samples) / 3, abs=2)
    assert "torques" not in source.health.trouble


def _exactly_zero(torque: np.ndarray) -> None:
    torque[::10] = 0.0


def _beyond_any_joint(torque: np.ndarray) -> None:
    """Beyond 1.5 times the joint's limit, which is 28 Nm for the wrist of a UR5e, and just within it."""
    torque[::10, 5] = -43.0
    torque[5::10, 5] = -41.0


@pytest.mark.parametrize(
    ("change", "reported"),
    [
        (_exactly_zero, "torques are exactly zero"),
        (_beyond_any_joint, "joint torques far beyond what its joints can apply"),
    ],
)
def test_torques_that_cannot_be_are_left_out_at_once(change, reported):
    torque = FEED.joint_torque.copy()
    change(torque)
    with (
        MockServers(FEED, MOCK, fields={"actual_current_as_torque": torque}) as servers,
        LiveSource(SCENE, settings_for(servers)) as source,
    ):
        samples = collect(source, 100)
        assert reported in source.health.trouble
    for sample in samples:
        assert (sample.joint_torque is None) == (round(sample.t * 500) % 10 == 0)


def test_a_joint_whose_current_is_stuck_is_named_and_the_torques_are_left_out():
    """While the arm rests, the controller's own target currents stay the same."""
    current = np.random.default_rng(0).standard_normal((FEED.n, 6))
    current[200:400, 4] = 0.0
    fields = {"actual_q": np.ones(6), "actual_qd": np.zeros(6), "actual_current": current}
    fields["target_current"] = np.zeros(6)
    signal = JointTorqueSensor(signal="actual_current_minus_target", torque_constants=TORQUE_CONSTANTS)
    scene = Scene(robot="ur5e", joint_torque=signal, base_wrench=None)
    told = set()
    with (
        MockServers(FEED, MOCK, fields=fields, clock=waiting_clock()) as servers,
        LiveSource(scene, SourceSettings(servers.rtde.host, servers.rtde.port)) as source,
    ):
        start_when_connected(servers, source)
        samples = []

        def past() -> bool:
            samples.extend(source.poll(0.1))
            told.add(source.health.trouble.partition(":")[0])
            return bool(samples) and samples[-1].t > 1.0

        assert until(past)
        assert until(lambda: source.poll(0.1) and source.health.trouble == "")
    assert "joint_torque[4]" in told
    for sample in samples:
        row = round(500 * sample.t)
        if 208 <= row < 400:
            assert sample.joint_torque is None
        elif not 204 <= row < 400:
            assert sample.joint_torque is not None


def test_velocities_that_no_joint_reaches():
    fields = {"actual_qd": np.full(6, 1e300)}
    with (
        MockServers(FEED, MOCK, fields=fields) as servers,
        LiveSource(SCENE, settings_for(servers)) as source,
    ):
        assert until(lambda: source.poll(0.1) == [] and source.health.unusable > 10)
        assert "velocities far beyond what its joints can do" in source.health.trouble
