"""ur_rtde in its child process: whatever becomes of the child, the parent goes on and says so."""

import os
import subprocess
import sys
import time
from unittest.mock import Mock

import pytest

from contactsense.service.mock.interfaces.wire_faults import Fault
from contactsense.service.sensors.clients.robot_stream import Backoff, SensorError
from contactsense.service.sensors.clients.ur_rtde_client import UrRtdeStream
from tests.service.loopback import FEED, own_address, rtde_server, until
from tests.service.ur_rtde import ur_rtde_installed

pytestmark = ur_rtde_installed

FIELDS = ("actual_q", "actual_qd", "actual_current", "robot_mode")


def open_stream(host, **options):
    return UrRtdeStream(
        host, FIELDS, **({"timeout": 1.5, "silence": 0.3, "backoff": Backoff(0.05, 0.1)} | options)
    )


def collect(stream, n, timeout=15.0):
    records = []
    end = time.monotonic() + timeout
    while len(records) < n and time.monotonic() < end:
        records += stream.poll(0.1)
    assert len(records) >= n, stream.health
    return records


def assert_right(stream, records):
    for record in records:
        row = round(record.timestamp * FEED.rate) % FEED.n
        assert record.values[stream.slices["actual_q"]] == pytest.approx(FEED.q[row])
        assert record.values[stream.slices["actual_qd"]] == pytest.approx(FEED.qd[row])
        assert record.values[stream.slices["robot_mode"]] == (7,)


@pytest.mark.slow
def test_records_and_losses():
    host = own_address()
    with rtde_server(host=host, port=30004):
        stream = open_stream(host)
        records = collect(stream, 200)
        stream.close()
    assert_right(stream, records)
    stamps = [record.timestamp for record in records]
    assert stamps == sorted(set(stamps))
    assert stream.health.lost == round((stamps[-1] - stamps[0]) * 500) + 1 - len(stamps)
    assert stream._child is None
    assert stream.poll(0.0) == []


@pytest.mark.slow
@pytest.mark.parametrize(
    ("fault", "complaint"),
    [
        (Fault.CLOSE, "the connection to the robot was lost"),
        (Fault.MUTE, "delivered nothing new"),
        (Fault.GARBAGE, ""),
        (Fault.HALF, "delivered nothing new"),
        (Fault.SPLIT, "delivered nothing new"),
        (Fault.ZERO_LENGTH, "the process of ur_rtde ended with status -"),
        (Fault.LOST_BYTE, ""),
    ],
)
def test_the_parent_outlives_every_fault(fault, complaint):
    host = own_address()
    with rtde_server(host=host, port=30004) as server:
        stream = open_stream(host)
        before = collect(stream, 20)
        first = stream._child
        server.fault = fault
        got = []
        assert until(lambda: got.extend(stream.poll(0.05)) or stream.health.failures)
        assert complaint in stream.health.error
        assert host in stream.health.error
        assert stream.health.state == "waiting"
        server.fault = Fault.NONE
        after = collect(stream, 20)
        assert stream.health.state == "streaming"
        assert stream.health.connections == 2
        assert stream._child is not first
        if fault not in (
            Fault.LOST_BYTE,
            Fault.GARBAGE,
        ):  # what it makes of shifted bytes before it breaks is its secret
            assert_right(stream, before + got + after)
            span = after[-1].timestamp - before[0].timestamp
            assert stream.health.lost == round(span * 500) + 1 - stream.health.received
        stream.close()


def test_a_mute_robot_hangs_the_child_not_the_parent():
    host = own_address()
    with rtde_server(host=host, port=30004) as server:
        server.fault = Fault.MUTE
        stream = open_stream(host, timeout=0.8)
        begin = time.monotonic()
        while not stream.health.failures and time.monotonic() - begin < 10.0:
            assert stream.poll(0.05) == []
        assert "delivered nothing new" in stream.health.error
        server.fault = Fault.NONE
        assert collect(stream, 5)
        stream.close()


def test_nobody_there():
    host = own_address()
    stream = open_stream(host)
    assert until(lambda: stream.poll(0.05) or stream.health.failures >= 2)
    assert f"Could not connect to: {host} at 30004" in stream.health.error
    stream.close()


SLOW_UR_RTDE = """
import time
time.sleep(1.0)
class RTDEReceiveInterface:
    def __init__(self, *_):
        raise RuntimeError("no robot here")
"""


def test_a_child_may_start_slowly(tmp_path, monkeypatch):
    """The limit is one for the robot, not for a computer that is busy."""
    (tmp_path / "rtde_receive.py").write_text(SLOW_UR_RTDE)
    monkeypatch.setenv("PYTHONPATH", os.pathsep.join([str(tmp_path), *sys.path]))
    stream = open_stream("127.0.0.1", timeout=0.2)
    assert until(lambda: stream.poll(0.05) or stream.health.failures, 30.0)
    assert "no robot here" in stream.health.error
    stream.close()


def test_a_child_that_cannot_be_started_is_tried_again_and_leaves_nothing_open(monkeypatch):
    refusal = BlockingIOError(11, "Resource temporarily unavailable")
    host = own_address()
    stream = open_stream(host)
    opened = len(os.listdir("/proc/self/fd"))
    with monkeypatch.context() as patch:
        patch.setattr(subprocess, "Popen", Mock(side_effect=refusal))
        assert until(lambda: stream.poll(0.1) or stream.health.failures >= 3)
    assert "cannot be started: Resource temporarily unavailable" in stream.health.error
    assert len(os.listdir("/proc/self/fd")) == opened
    with rtde_server(host=host, port=30004):
        collect(stream, 20)
        stream.close()


def test_a_killed_child_is_replaced():
    host = own_address()
    with rtde_server(host=host, port=30004):
        stream = open_stream(host)
        collect(stream, 5)
        stream._child.kill()
        assert until(lambda: stream.poll(0.05) and stream.health.connections == 2)
        assert "the process of ur_rtde ended with status -9" in stream.health.error
        stream.close()


def test_time_that_jumps_back_and_values_that_are_no_numbers_pass_through():
    host = own_address()
    with rtde_server(host=host, port=30004) as server:
        stream = open_stream(host)
        collect(stream, 5)
        server.fault = Fault.TIME_BACK
        assert until(lambda: stream.poll(0.05) and stream.health.jumps == 1)
        server.fault = Fault.NAN
        assert until(lambda: any(r.values[1] != r.values[1] for r in stream.poll(0.05)))
        assert stream.health.failures == 0
        stream.close()


def test_fields_without_a_getter_are_named():
    with pytest.raises(SensorError, match=r"no getter for actual_current_as_torque; expected .* actual_q, "):
        UrRtdeStream("127.0.0.1", ("actual_q", "actual_current_as_torque"))
