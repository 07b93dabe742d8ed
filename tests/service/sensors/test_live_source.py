"""Both sensors together, from the mock's wire to samples."""

import dataclasses
from types import SimpleNamespace

import numpy as np
import pytest

from contactsense.robots.tool import Tool
from contactsense.scene import JointTorqueSensor, LinkWrenchSensor, Scene, WrenchSensor
from contactsense.scene_model.link_sensor_frame import LinkSensorFrame
from contactsense.scene_model.wrench_map import WrenchMap
from contactsense.service.mock.arm.cell import TORQUE_CONSTANTS
from contactsense.service.mock.arm.newton_euler import link_poses
from contactsense.service.mock.interfaces.netft_server import NetFtServer
from contactsense.service.mock.interfaces.rtde_fields import Controller
from contactsense.service.mock.playback import Playback, PlaybackWrench
from contactsense.service.mock.servers import MockServers
from contactsense.service.sensors.clients.robot_stream import SensorError
from contactsense.service.sensors.live_source import LiveSource
from contactsense.service.sensors.network_wrench import WrenchSource
from contactsense.service.sensors.source_settings import SourceSettings
from contactsense.service.wire.recipe import RtdeFieldError
from tests.service.loopback import own_address, until
from tests.service.sensors.mock_source import FEED, KNOWN_WITHIN, MOCK, SCENE, WRENCH, collect, settings_for
from tests.service.ur_rtde import ur_rtde_installed


def with_wrench(source, n):
    """That many samples, all of them from after the force/torque sensor's clock is known: that takes longer
    on a busy computer."""
    known = until(lambda: any(s.base_wrench is not None for s in source.poll(0.1)), timeout=KNOWN_WITHIN)
    assert known, source.health
    return [sample for sample in collect(source, n) if sample.base_wrench is not None]


def assert_of_its_instant(samples, shift=0.0, tolerance=2e-3):
    errors = [sample.base_wrench - (sample.t + np.arange(6) - shift) for sample in samples]
    assert np.abs(np.median(errors)) < tolerance


@pytest.mark.realtime
def test_samples_of_one_instant():
    with MockServers(FEED, MOCK) as servers, LiveSource(SCENE, settings_for(servers)) as source:
        collect(source, 500)  # until the clocks are known, and a second has passed since
        samples = with_wrench(source, 600)
        health = source.health
    assert len(samples) > 570
    rows = [round(sample.t * 500) for sample in samples]
    assert np.allclose([sample.q for sample in samples], FEED.q[rows])
    assert np.allclose([sample.qd for sample in samples], FEED.qd[rows])
    assert np.allclose([sample.joint_torque for sample in samples], FEED.joint_torque[rows])
    assert_of_its_instant(samples)
    assert (health.robot.state, health.robot.lost) == ("streaming", 0)
    assert health.wrench is not None
    assert (health.wrench.state, health.wrench.overrun, health.trouble) == ("streaming", 0, "")
    assert health.unusable == 0
    closed = source.health
    assert closed.wrench is not None
    assert (closed.robot.state, closed.wrench.state) == ("closed", "closed")


@pytest.mark.slow
def test_the_rate_of_the_sensor_may_be_learned():
    with (
        MockServers(FEED, MOCK) as servers,
        LiveSource(SCENE, settings_for(servers, wrench_rate=None)) as source,
    ):
        with_wrench(source, 500)
        assert_of_its_instant(with_wrench(source, 300))


@pytest.mark.slow
@pytest.mark.parametrize(
    ("network", "sensor", "shift"), [(0.006, 0.0, 0.0), (0.002, 0.004, 0.0), (0.0, 0.0, 0.006)]
)
def test_a_later_force_torque_stream(network, sensor, shift):
    """The delay of the network is a setting of the source, that of the sensor belongs to the scene."""
    mock = dataclasses.replace(MOCK, netft_delay=0.006)
    place = SCENE.base_wrench.model_copy(update={"delay": sensor})
    scene = SCENE.model_copy(update={"base_wrench": place})
    with (
        MockServers(FEED, mock) as servers,
        LiveSource(scene, settings_for(servers, wrench_delay=network, wrench_wait=0.02)) as source,
    ):
        assert_of_its_instant(with_wrench(source, 300), shift)


def test_a_sensor_may_be_later_than_a_sample_waits_for_its_box():
    mock = dataclasses.replace(MOCK, netft_delay=0.04)
    place = SCENE.base_wrench.model_copy(update={"delay": 0.04})
    scene = SCENE.model_copy(update={"base_wrench": place})
    with MockServers(FEED, mock) as servers, LiveSource(scene, settings_for(servers)) as source:
        assert_of_its_instant(with_wrench(source, 300))


@pytest.mark.parametrize("delay", [0.03, 0.003, -0.01])
def test_readings_in_packets_are_those_of_one_delay_before(delay):
    names = tuple(f"output_double_register_{24 + i}" for i in range(6))
    fields = {name: WRENCH[:, i] for i, name in enumerate(names)}
    elbow = LinkWrenchSensor(name="elbow", link="forearm")
    for scene, where in (
        (Scene(robot="ur5e", base_wrench=WrenchSensor(delay=delay)), {"wrench_fields": names}),
        (
            Scene(robot="ur5e", base_wrench=None, link_wrenches=[elbow.model_copy(update={"delay": delay})]),
            {"link_wrenches": {"elbow": WrenchSource(fields=names)}},
        ),
    ):
        with MockServers(FEED, MOCK, fields=fields) as servers:
            settings = SourceSettings(servers.rtde.host, servers.rtde.port, **where)
            with LiveSource(scene, settings) as source:
                samples = collect(source, 100)[20:]
        assert np.allclose(np.diff([sample.t for sample in samples]), 0.002)  # none is lost
        for sample in samples:
            felt = sample.t + delay + np.arange(6)
            if sample.base_wrench is None:
                assert sample.link_wrenches["elbow"] == pytest.approx(
                    LinkSensorFrame(scene, "link_wrenches.elbow").wrench(sample.q, felt)
                )
            else:
                assert sample.base_wrench == pytest.approx(felt)


def test_a_later_robot_stream():
    mock = dataclasses.replace(MOCK, rtde_delay=0.006)
    with (
        MockServers(FEED, mock) as servers,
        LiveSource(SCENE, settings_for(servers, wrench_delay=-0.006)) as source,
    ):
        assert_of_its_instant(with_wrench(source, 300))


def test_a_sensor_turned_and_shifted_and_counting_the_other_way():
    place = WrenchSensor(rpy=(0.3, -0.2, 1.0), translation=(0.01, -0.02, -0.05), sign="sensor_on_arm")
    scene = Scene(robot="ur5e", base_wrench=place)
    to_sensor = WrenchMap.of(place).to_sensor
    with (
        MockServers(FEED, MOCK, to_sensor=to_sensor) as servers,
        LiveSource(scene, settings_for(servers)) as source,
    ):
        assert_of_its_instant(with_wrench(source, 200))


def test_motor_currents_become_torques():
    signal = JointTorqueSensor(signal="actual_current", torque_constants=TORQUE_CONSTANTS)
    scene = Scene(robot="ur5e", joint_torque=signal, base_wrench=None)
    with MockServers(FEED, MOCK) as servers:
        settings = SourceSettings(servers.rtde.host, servers.rtde.port)
        with LiveSource(scene, settings) as source:
            samples = collect(source, 50)
            assert source.health.wrench is None
    assert all(sample.base_wrench is None for sample in samples)
    for sample in samples:
        assert sample.joint_torque == pytest.approx(FEED.joint_torque[round(sample.t * 500)])


def test_no_joint_torques_wanted_none_read():
    scene = Scene(robot="ur5e", joint_torque=None)
    with MockServers(FEED, MOCK) as servers, LiveSource(scene, settings_for(servers)) as source:
        assert all(sample.joint_torque is None for sample in collect(source, 10))


def test_force_torque_values_out_of_registers():
    names = tuple(f"output_double_register_{24 + i}" for i in range(6))
    fields = {name: WRENCH[:, i] for i, name in enumerate(names)}
    with MockServers(FEED, MOCK, fields=fields) as servers:
        settings = SourceSettings(servers.rtde.host, servers.rtde.port, wrench_fields=names)
        with LiveSource(SCENE, settings) as source:
            for sample in collect(source, 50):
                assert sample.base_wrench == pytest.approx(WRENCH[round(sample.t * 500)])


@pytest.mark.parametrize("registers", [False, True])
def test_a_wrist_sensor_comes_with_the_robot_and_turns_with_its_flange(registers):
    names = tuple(f"output_double_register_{24 + i}" for i in range(6)) if registers else ("ft_raw_wrench",)
    columns = {name: WRENCH[:, i] for i, name in enumerate(names)} if registers else {names[0]: WRENCH}
    place = WrenchSensor(
        rpy=(0.0, 0.0, 0.5), translation=(0.0, 0.0, 0.02), bias=(1.0, 2.0, 3.0, 4.0, 5.0, 6.0)
    )
    scene = Scene(robot="ur5e", base_wrench=None, wrist_wrench=place, tool=Tool(mass=1.0))
    with MockServers(FEED, MOCK, fields=columns) as servers:
        wrist = {"wrist_fields": names} if registers else {}
        with LiveSource(scene, SourceSettings(servers.rtde.host, servers.rtde.port, **wrist)) as source:
            samples = collect(source, 50)
    for sample in samples:
        felt = WRENCH[round(sample.t * 500)] - place.bias
        rotations, origins = link_poses(scene.robot, sample.q[None])
        turn = rotations[-1, 0] @ scene.robot.flange_rotation
        origin = origins[-1, 0] + rotations[-1, 0] @ scene.robot.flange_translation + 0.02 * turn[:, 2]
        turn = turn @ place.rotation
        force, moment = turn @ felt[:3], turn @ felt[3:]
        assert sample.wrist_wrench == pytest.approx(np.append(force, moment + np.cross(origin, force)))


ELBOW = LinkWrenchSensor(name="elbow", link="forearm", rpy=(0.0, 0.0, 0.5), translation=(0.0, 0.0, 0.02))


def felt_in_base_axes(scene, q, reading):
    """A reading of the sensor in the elbow in base axes, about the base origin, by the mock's kinematics."""
    rotations, origins = link_poses(scene.robot, q[None])
    turn, place = rotations[3, 0] @ ELBOW.rotation, origins[3, 0] + 0.02 * rotations[3, 0][:, 2]
    force, moment = turn @ reading[:3], turn @ reading[3:]
    return np.append(force, moment + np.cross(place, force))


def test_a_sensor_between_links_comes_with_the_robot():
    names = tuple(f"output_double_register_{i}" for i in range(6))
    scene = Scene(robot="ur5e", base_wrench=None, link_wrenches=[ELBOW])
    with MockServers(FEED, MOCK, fields={name: WRENCH[:, i] for i, name in enumerate(names)}) as servers:
        sources = {"elbow": WrenchSource(fields=names)}
        settings = SourceSettings(servers.rtde.host, servers.rtde.port, link_wrenches=sources)
        with LiveSource(scene, settings) as source:
            samples = collect(source, 50)
    for sample in samples:
        felt = felt_in_base_axes(scene, sample.q, WRENCH[round(sample.t * 500)])
        assert sample.link_wrenches["elbow"] == pytest.approx(felt)
        assert sample.wrist_wrench is None


def test_a_sensor_between_links_has_its_own_box():
    """Beside the base sensor's, each at its own rate: both readings are those of the sample's instant."""
    scene = Scene(robot="ur5e", link_wrenches=[ELBOW])
    with MockServers(FEED, MOCK) as servers:
        reading = PlaybackWrench(FEED, Playback(FEED, loop=True), np.eye(6))
        own = NetFtServer(reading, servers.clock, port=0, http_port=0, rate=800.0)
        with own:
            sources = {"elbow": WrenchSource(own.host, own.port, own.http_port)}
            settings = settings_for(servers, wrench_rate=None, link_wrenches=sources)
            with LiveSource(scene, settings) as source:
                samples, raw = [], []
                source.observer = SimpleNamespace(robot=lambda *_: None, wrench=raw.extend)

                def complete():
                    both = [s for s in source.poll(0.1) if s.link_wrenches and s.base_wrench is not None]
                    samples.extend(both)
                    return len(samples) > 200

                assert until(complete, timeout=KNOWN_WITHIN), source.health
                assert_of_its_instant(samples)
                own.close()
                assert until(lambda: all(not s.link_wrenches for s in source.poll(0.1)[-1:]))
                assert with_wrench(source, 50)
    read = [
        np.linalg.solve(
            np.column_stack([felt_in_base_axes(scene, s.q, unit) for unit in np.eye(6)]),
            s.link_wrenches["elbow"],
        )
        - (s.t + np.arange(6))
        for s in samples
    ]
    assert np.abs(np.median(read)) < 2e-3
    assert (np.diff([reading.tick for reading in raw]) > 0).all()  # those of the base sensor alone


def test_a_sensor_between_links_needs_one_source():
    scene = Scene(robot="ur5e", base_wrench=None, link_wrenches=[ELBOW])
    with pytest.raises(SensorError, match=r"^link_wrenches\.elbow: expected either .* got neither$"):
        LiveSource(scene, SourceSettings("127.0.0.1"))
    both = {"elbow": WrenchSource(host="127.0.0.1", fields=("ft_raw_wrench",))}
    with pytest.raises(SensorError, match=r"^link_wrenches\.elbow: expected either .* got both$"):
        LiveSource(scene, SourceSettings("127.0.0.1", link_wrenches=both))
    one = {"elbow": WrenchSource(fields=("timestamp",))}
    with pytest.raises(SensorError, match=r"^link_wrenches\.elbow\.fields: .*got timestamp with 1$"):
        LiveSource(scene, SourceSettings("127.0.0.1", link_wrenches=one))


def test_time_stamps_in_milliseconds_are_told(monkeypatch):
    seconds = Controller._timestamp
    monkeypatch.setattr(Controller, "_timestamp", lambda self, t: [1e3 * x for x in seconds(self, t)])
    with MockServers(FEED, MOCK) as servers, LiveSource(SCENE, settings_for(servers)) as source:
        assert until(lambda: source.poll(0.1) is None or "expected seconds" in source.health.trouble)
        assert "timestamp" in source.health.trouble


def test_wrist_fields_must_have_six_numbers():
    scene = Scene(robot="ur5e", base_wrench=None, wrist_wrench=WrenchSensor(), tool=Tool(mass=1.0))
    with pytest.raises(SensorError, match=r"wrist_fields.*6 numbers, got timestamp with 1"):
        LiveSource(scene, SourceSettings("127.0.0.1", wrist_fields=("timestamp",)))


def test_a_mute_force_torque_sensor_leaves_samples_without_it():
    with MockServers(FEED, MOCK) as servers, LiveSource(SCENE, settings_for(servers)) as source:
        with_wrench(source, 20)
        servers.netft.mute = True
        assert until(lambda: (got := source.poll(0.1)) and got[-1].base_wrench is None)
        assert all(sample.base_wrench is None for sample in collect(source, 50))
        assert until(lambda: source.poll(0.1) and "silent, it sends no readings" in source.health.trouble)
        before = source.health.without_wrench
        assert before >= 50
        servers.netft.mute = False
        assert with_wrench(source, 20)
        assert until(lambda: source.poll(0.1) and source.health.trouble == "")


def test_readings_beyond_the_range_are_no_readings():
    with MockServers(FEED, MOCK) as servers, LiveSource(SCENE, settings_for(servers)) as source:
        with_wrench(source, 20)
        servers.netft.status = 0x80020000
        assert until(lambda: source.poll(0.1) and "beyond its range" in source.health.trouble)
        assert until(lambda: (got := source.poll(0.1)) and got[-1].base_wrench is None)
        assert all(sample.base_wrench is None for sample in collect(source, 20))


def test_nobody_there_then_somebody():
    with MockServers(FEED, MOCK) as servers:
        settings = settings_for(servers)
    with LiveSource(SCENE, settings) as source:
        assert until(lambda: source.poll(0.05) or source.health.robot.failures >= 2)
        assert until(lambda: source.poll(0.05) or "force/torque sensor" in source.health.trouble)
        assert f"robot at 127.0.0.1:{settings.robot_port} cannot be reached" in source.health.trouble
        again = dataclasses.replace(
            MOCK,
            rtde_port=settings.robot_port,
            netft_port=settings.wrench_port,
            http_port=settings.wrench_http_port,
        )
        with MockServers(FEED, again):
            assert with_wrench(source, 20)


@ur_rtde_installed
def test_ur_rtde_as_the_client():
    host = own_address()
    signal = JointTorqueSensor(signal="actual_current", torque_constants=TORQUE_CONSTANTS)
    scene = Scene(robot="ur5e", joint_torque=signal)
    mock = dataclasses.replace(MOCK, host=host, rtde_port=30004)
    with MockServers(FEED, mock) as servers:
        with LiveSource(scene, settings_for(servers, client="ur_rtde")) as source:
            samples = with_wrench(source, 100)
        assert_of_its_instant(samples)
        with pytest.raises(SensorError, match="no getter for actual_current_as_torque"):
            LiveSource(SCENE, settings_for(servers, client="ur_rtde"))
        with pytest.raises(SensorError, match="ur_rtde reads port 30004 only, got 30005"):
            LiveSource(scene, dataclasses.replace(settings_for(servers), client="ur_rtde", robot_port=30005))


def test_iteration_ends_with_close():
    with MockServers(FEED, MOCK) as servers:
        source = LiveSource(SCENE, settings_for(servers))
        taken = []
        for sample in source:
            taken.append(sample)
            if len(taken) == 20:
                source.close()
        assert len(taken) >= 20
        assert source.poll(0.0) == []


def test_contradictions_are_named():
    with pytest.raises(SensorError, match=r"wrench_host.*wrench_fields.*got neither"):
        LiveSource(SCENE, SourceSettings("127.0.0.1"))
    names = ("output_double_register_24",) * 6
    with pytest.raises(SensorError, match="got both"):
        LiveSource(SCENE, SourceSettings("127.0.0.1", wrench_host="127.0.0.1", wrench_fields=names))
    with pytest.raises(SensorError, match=r"wrench_fields: expected .* with 6 numbers, got .* with 3"):
        LiveSource(SCENE, SourceSettings("127.0.0.1", wrench_fields=names[:3]))


def test_a_field_that_the_robot_lacks_is_raised():
    mock = dataclasses.replace(MOCK, version=(5, 22, 0, 0))
    with (
        MockServers(FEED, mock) as servers,
        LiveSource(SCENE, settings_for(servers)) as source,
        pytest.raises(RtdeFieldError, match="actual_current_as_torque"),
    ):
        source.poll(0.1)
