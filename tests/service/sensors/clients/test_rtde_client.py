"""Our own reader against a mock controller in good and bad health, and against peers that are no robots."""

import socket
import time

import numpy as np
import pytest

from contactsense.service.mock.interfaces.wire_faults import Fault
from contactsense.service.sensors.clients.robot_stream import Backoff, SensorError
from contactsense.service.sensors.clients.rtde_client import RtdeConnection, RtdeStream
from contactsense.service.wire import rtde as wire
from tests.service.loopback import FEED, peer, rtde_server, until

FIELDS = ("actual_q", "actual_qd", "actual_current_as_torque")


def collect(stream, n, timeout=10.0):
    records = []
    end = time.monotonic() + timeout
    while len(records) < n and time.monotonic() < end:
        records += stream.poll(0.1)
    return records


def row(timestamp):
    return round(timestamp * FEED.rate) % FEED.n


def test_every_sample_arrives_once_and_right():
    with rtde_server() as server:
        stream = RtdeStream(server.host, FIELDS, port=server.port)
        records = collect(stream, 500)
        stream.close()
    stamps = np.array([record.timestamp for record in records])
    assert np.allclose(np.diff(stamps), 0.002)
    q = np.array([record.values[stream.slices["actual_q"]] for record in records])
    torque = np.array([record.values[stream.slices["actual_current_as_torque"]] for record in records])
    rows = [row(stamp) for stamp in stamps]
    assert np.allclose(q, FEED.q[rows])
    assert np.allclose(torque, FEED.joint_torque[rows])
    arrivals = [record.arrival_ns for record in records]
    assert arrivals == sorted(arrivals)
    health = stream.health
    assert (health.received, health.lost, health.duplicates, health.jumps) == (len(records), 0, 0, 0)
    assert (health.connections, health.failures, health.error, health.state) == (1, 0, "", "closed")
    assert stream.poll(0.0) == []


def test_at_another_frequency():
    with rtde_server(version=(3, 15, 8, 0)) as server:
        stream = RtdeStream(server.host, ("actual_q",), port=server.port, frequency=125.0)
        stamps = [record.timestamp for record in collect(stream, 30)]
        stream.close()
    assert np.allclose(np.diff(stamps), 0.008)
    assert stream.health.lost == 0


def test_a_slow_reader_loses_nothing():
    with rtde_server() as server:
        stream = RtdeStream(server.host, FIELDS, port=server.port)
        collect(stream, 1)
        time.sleep(0.5)
        assert len(collect(stream, 250)) >= 250
        stream.close()
    assert stream.health.lost == 0


def test_text_messages_do_not_disturb():
    with rtde_server() as server:
        stream = RtdeStream(server.host, FIELDS, port=server.port)
        collect(stream, 1)
        server.say("a protective stop, say")
        assert len(collect(stream, 20)) >= 20
        stream.close()
    assert (stream.health.failures, stream.health.lost) == (0, 0)


@pytest.mark.parametrize(
    ("fault", "complaint"),
    [
        (Fault.MUTE, "has been silent for 0.2 s"),
        (Fault.CLOSE, "closed the connection"),
        (Fault.HALF, "has been silent for 0.2 s"),
        (Fault.GARBAGE, "expected"),
        (Fault.ZERO_LENGTH, "expected a frame of at least 3 bytes, got 0"),
        (Fault.LOST_BYTE, "expected"),
    ],
)
def test_trouble_is_told_and_outlived(fault, complaint):
    with rtde_server() as server:
        backoff = Backoff(0.05, 0.1)
        stream = RtdeStream(server.host, FIELDS, port=server.port, timeout=0.3, silence=0.2, backoff=backoff)
        before = collect(stream, 20)
        server.fault = fault
        got = []
        assert until(lambda: got.extend(stream.poll(0.02)) or stream.health.failures)
        assert complaint in stream.health.error
        assert stream.health.state == "waiting"
        server.fault = Fault.NONE
        after = collect(stream, 20)
        assert stream.health.state == "streaming"
        assert stream.health.connections == 2
        # Nothing that was delivered is wrong, and what is missing was counted.
        everything = before + got + after
        for record in everything:
            assert record.values[stream.slices["actual_q"]] == pytest.approx(FEED.q[row(record.timestamp)])
        span = everything[-1].timestamp - everything[0].timestamp
        assert stream.health.lost == round(span * 500) + 1 - len(everything)
        stream.close()


def test_packets_in_two_pieces_are_put_together():
    with rtde_server() as server:
        server.fault = Fault.SPLIT
        stream = RtdeStream(server.host, FIELDS, port=server.port)
        stamps = [record.timestamp for record in collect(stream, 100)]
        stream.close()
    assert np.allclose(np.diff(stamps), 0.002)
    assert stream.health.failures == 0


def test_time_that_jumps_back_is_counted():
    with rtde_server() as server:
        stream = RtdeStream(server.host, FIELDS, port=server.port)
        collect(stream, 10)
        server.fault = Fault.TIME_BACK
        assert until(lambda: stream.poll(0.02) and stream.health.jumps == 1)
        collect(stream, 10)
        stream.close()
    assert (stream.health.jumps, stream.health.lost, stream.health.failures) == (1, 0, 0)


def test_no_numbers_pass_through():
    with rtde_server() as server:
        server.fault = Fault.NAN
        stream = RtdeStream(server.host, FIELDS, port=server.port)
        record = collect(stream, 1)[0]
        stream.close()
    assert np.isfinite(record.timestamp)
    assert np.isnan(record.values[stream.slices["actual_q"]]).all()


def test_unknown_fields_are_named():
    with rtde_server(version=(5, 22, 0, 0)) as server:
        with pytest.raises(wire.RtdeFieldError, match=r"does not know actual_current_as_torque$"):
            RtdeConnection(server.host, FIELDS, port=server.port)
        stream = RtdeStream(server.host, FIELDS, port=server.port)
        with pytest.raises(wire.RtdeFieldError):
            stream.poll(0.1)


def test_nobody_there():
    with socket.create_server(("127.0.0.1", 0)) as free:
        port = free.getsockname()[1]
    with pytest.raises(SensorError, match=f"robot at 127.0.0.1:{port} cannot be reached: Connection refused"):
        RtdeConnection("127.0.0.1", FIELDS, port=port)
    stream = RtdeStream("127.0.0.1", FIELDS, port=port, backoff=Backoff(0.02, 0.05))
    assert until(lambda: stream.poll(0.02) or stream.health.failures >= 3)
    assert stream.health.state == "waiting"
    assert "cannot be reached" in stream.health.error
    # Somebody comes: it was worth waiting.
    with rtde_server(port=port):
        assert collect(stream, 5)
    stream.close()


def test_no_name():
    with pytest.raises(SensorError, match=r"robot at no-such-robot.invalid:30004 cannot be reached: "):
        RtdeConnection("no-such-robot.invalid", FIELDS)


OK_VERSION = wire.encode(wire.ProtocolVersionReply(True))
TYPES = ("DOUBLE", "VECTOR6D", "VECTOR6D", "VECTOR6D")


@pytest.mark.parametrize(
    ("answers", "hang_up", "error", "complaint"),
    [
        ([], False, SensorError, "gave no answer to ProtocolVersionRequest within 0.2 s"),
        ([OK_VERSION], False, SensorError, "gave no answer to OutputSetup within 0.2 s"),
        ([OK_VERSION[:2]], False, SensorError, "gave no answer to ProtocolVersionRequest"),
        ([], True, SensorError, "closed the connection upon ProtocolVersionRequest"),
        (
            [wire.encode(wire.ProtocolVersionReply(False))],
            False,
            SensorError,
            "does not speak RTDE version 2",
        ),
        ([b"SSH-2.0-OpenSSH_9.6\r\n"], False, wire.RtdeProtocolError, "expected a package type"),
        ([b"\x00\x00\x00"], False, wire.RtdeProtocolError, "expected a frame of at least 3 bytes, got 0"),
        (
            [wire.encode(wire.StartReply(True))],
            False,
            wire.RtdeProtocolError,
            "expected ProtocolVersionReply upon ProtocolVersion",
        ),
        (
            [OK_VERSION, wire.encode(wire.SetupReply(False, 1, ("DOUBLE",)))],
            False,
            wire.RtdeProtocolError,
            "expected 4 types for 4 fields, got 1",
        ),
        (
            [OK_VERSION, wire.encode(wire.SetupReply(False, 1, ("INT32", *TYPES[1:])))],
            False,
            wire.RtdeProtocolError,
            "expected the timestamp to be a DOUBLE",
        ),
        (
            [
                OK_VERSION,
                wire.encode(wire.SetupReply(False, 1, TYPES)),
                wire.encode(wire.StartReply(False)),
            ],
            False,
            SensorError,
            "refuses to start sending",
        ),
    ],
)
def test_peers_that_are_no_robots(answers, hang_up, error, complaint):
    with peer(*answers, hang_up=hang_up) as port, pytest.raises(error, match=complaint):
        RtdeConnection("127.0.0.1", FIELDS, port=port, timeout=0.2)


def test_packets_before_a_bad_one_are_delivered():
    recipe = wire.Recipe(1, ("timestamp", *FIELDS), TYPES)
    good = [recipe.pack([k * 0.002] + [0.0] * 18) for k in range(3)]
    start = wire.encode(wire.StartReply(True))
    answers = [OK_VERSION, wire.encode(wire.SetupReply(False, 1, TYPES))]
    other_recipe = good[0][:3] + b"\x07" + good[0][4:]
    for bad in (b"\x00\x00\x00", other_recipe):
        with peer(*answers, start + b"".join(good) + bad) as port:
            stream = RtdeStream("127.0.0.1", FIELDS, port=port, silence=5.0)
            assert until(lambda stream=stream: stream.poll(0.0) or stream.health.failures)
            assert stream.health.received in (0, 3)
            assert until(lambda stream=stream: stream.poll(0.05) or stream.health.failures)
            assert stream.health.received == 3
            assert "expected" in stream.health.error
            stream.close()
