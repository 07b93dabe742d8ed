"""The mock force/torque sensor, read by bytes made by hand and by pynetft."""

import socket
import struct
import time
import urllib.error
import urllib.request
from contextlib import contextmanager

import numpy as np
import pynetft
import pytest

from contactsense.service.mock.interfaces.netft_server import NetFtServer
from contactsense.service.mock.playback import Playback, PlaybackWrench, SimClock
from contactsense.service.wire.netft import SATURATED, Configuration
from tests.service.loopback import SmallFeed, until, waiting_clock

SECONDS = np.arange(5000) / 500.0
WRENCH = np.column_stack(
    [SECONDS, 10 + SECONDS, np.full(5000, -200.0), SECONDS / 10, -SECONDS, np.full(5000, 3.0)]
)
FEED = SmallFeed(base_wrench=WRENCH)


READINGS = PlaybackWrench(FEED, Playback(FEED))


@contextmanager
def netft_server(feed=FEED, to_sensor=None, **options):
    options = {"port": 0, "http_port": 0} | options
    with NetFtServer(PlaybackWrench(feed, Playback(feed), to_sensor), SimClock(), **options) as server:
        yield server


@contextmanager
def asking(server, command, count=0):
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as udp:
        udp.settimeout(2.0)
        udp.connect((server.host, server.port))
        udp.send(struct.pack(">HHI", 0x1234, command, count))
        yield lambda: struct.unpack(">III6i", udp.recv(100))


@contextmanager
def client(server, **options):
    config = pynetft.Config(
        sensor_host=server.host, rdt_port=server.port, http_port=server.http_port, **options
    )
    with pynetft.Client(config, queue_size=5000) as opened:
        yield opened


def test_records_by_hand():
    with netft_server() as server, asking(server, 2) as receive:
        records = [receive() for _ in range(50)]
    rdt = [record[0] for record in records]
    ft = np.array([record[1] for record in records])
    assert rdt == list(range(1, 51))
    assert np.all(np.diff(ft) == 1)
    assert all(record[2] == 0 for record in records)
    # 1000 readings a second from 500 samples: every other one lies between two samples.
    expected = np.column_stack([np.interp(ft / 1000.0, SECONDS, WRENCH[:, i]) for i in range(6)])
    assert np.allclose([record[3:] for record in records], 1e6 * expected, atol=1)


def test_a_count_of_records_then_silence():
    with netft_server() as server, asking(server, 2, 3) as receive:
        for _ in range(3):
            receive()
        assert until(lambda: server.clients == 0)


def test_stop():
    with netft_server() as server, asking(server, 2) as receive:
        receive()
        assert server.clients == 1
        with asking(server, 0):
            pass  # somebody else's stop does not concern us
        receive()
        assert server.clients == 1


def test_nonsense_is_ignored():
    with netft_server() as server, socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as udp:
        udp.sendto(b"nonsense", (server.host, server.port))
        udp.sendto(b"", (server.host, server.port))
        with asking(server, 2) as receive:
            assert receive()[0] == 1


def test_configuration_page():
    with netft_server() as server:
        base = f"http://{server.host}:{server.http_port}"
        with urllib.request.urlopen(f"{base}/netftapi2.xml") as answer:
            assert b"<cfgcpf>1000000.0</cfgcpf>" in answer.read()
        with pytest.raises(urllib.error.HTTPError) as refused:
            urllib.request.urlopen(f"{base}/other")
        refused.value.close()
        assert refused.value.code == 404


@pytest.mark.parametrize(
    ("configuration", "force_unit", "torque_unit", "per_metre"),
    [
        (Configuration(), "N", "N-m", 1.0),
        (Configuration(1e4, 250.0, "N", "Nmm"), "N", "N-mm", 1000.0),
    ],
)
def test_pynetft_reads_it(configuration, force_unit, torque_unit, per_metre):
    with netft_server(configuration=configuration) as server, client(server) as sensor:
        samples = sensor.samples(30.0)
        got = [next(samples) for _ in range(300)]
        health = sensor.health()
    assert health.lost_count == health.duplicate_count == health.malformed_count == 0
    assert (got[0].force_unit.value, got[0].torque_unit.value) == (force_unit, torque_unit)
    ticks = np.array([sample.ft_sequence for sample in got])
    expected = np.column_stack([np.interp(ticks / 1000.0, SECONDS, WRENCH[:, i]) for i in range(6)])
    expected[:, 3:] *= per_metre
    assert np.allclose([sample.wrench for sample in got], expected, atol=1e-2 * per_metre)


def test_bias_makes_the_present_reading_zero():
    with netft_server() as server, client(server) as sensor:
        samples = sensor.samples(30.0)
        assert next(samples).force[2] == pytest.approx(-200.0)
        sensor.bias()
        assert until(lambda: abs(next(samples).force[2]) < 1e-6)


def test_mute_sensor_and_recovery():
    with netft_server() as server:
        server.mute = True
        with client(server, receive_timeout=0.1, reconnect_initial_delay=0.05) as sensor:
            assert until(lambda: sensor.health().timeout_count > 0)
            assert sensor.latest_sample() is None
            server.mute = False
            assert sensor.wait_for_first_sample(5.0)


def test_readings_beyond_the_range_are_marked():
    with netft_server(limits=(100.0, 50.0)) as server, asking(server, 2) as receive:
        assert receive()[2] == SATURATED
    with netft_server(limits=(300.0, 50.0)) as server, asking(server, 2) as receive:
        assert receive()[2] == 0
        server.status = 0x80000004
        assert until(lambda: receive()[2] == 0x80000004)


def test_the_sensor_may_stand_otherwise_than_the_base():
    turned = np.diag([1.0, -1.0, -1.0, 1.0, -1.0, -1.0])
    with netft_server(to_sensor=turned) as server, asking(server, 2) as receive:
        counts = receive()[3:]
        assert counts[2] == 200_000_000
        assert counts[5] == -3_000_000


def test_delay_and_a_fast_clock():
    clock = waiting_clock()
    with (
        NetFtServer(READINGS, clock, port=0, http_port=0, delay=0.1, clock_scale=1.5) as server,
        asking(server, 2) as receive,
    ):
        assert until(lambda: server.clients == 1)
        clock.start()
        assert receive()[1] == 0
        assert time.monotonic_ns() - clock.start_ns >= 100_000_000
        record = receive()
        assert record[3] == pytest.approx(1e6 * record[1] / 1500.0, abs=1)
