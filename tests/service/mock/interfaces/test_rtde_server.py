"""The mock controller, read by UR's own order of messages (bytes by hand) and by the unmodified ur_rtde."""

import json
import socket
import struct
import subprocess
import sys
import time

import numpy as np
import pytest

from contactsense.service.mock.arm.cell import TORQUE_CONSTANTS
from contactsense.service.mock.interfaces.playback_fields import PlaybackController
from contactsense.service.mock.interfaces.rtde_server import RtdeServer
from contactsense.service.mock.interfaces.sent_log import SentLog
from contactsense.service.mock.interfaces.wire_faults import Fault
from contactsense.service.mock.playback import Playback
from tests.service.loopback import FEED, SmallFeed, own_address, rtde_server, until, waiting_clock
from tests.service.ur_rtde import ur_rtde_installed


class PlainClient:
    """RTDE by hand, without our codec."""

    def __init__(self, server):
        self.socket = socket.create_connection((server.host, server.port), 5.0)
        self.buffer = b""

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self.socket.close()

    def send(self, kind, payload=b""):
        self.socket.sendall(struct.pack(">HB", 3 + len(payload), ord(kind)) + payload)

    def receive(self):
        while len(self.buffer) < 3 or len(self.buffer) < struct.unpack_from(">H", self.buffer)[0]:
            chunk = self.socket.recv(65536)
            if not chunk:
                raise ConnectionError("closed")
            self.buffer += chunk
        size, kind = struct.unpack_from(">HB", self.buffer)
        payload, self.buffer = self.buffer[3:size], self.buffer[size:]
        return chr(kind), payload

    def ask(self, kind, payload=b""):
        self.send(kind, payload)
        while True:
            answer, body = self.receive()
            if answer == kind:
                return body

    def start(self, names, frequency=500.0):
        assert self.ask("V", b"\x00\x02") == b"\x01"
        reply = self.ask("O", struct.pack(">d", frequency) + names.encode())
        assert self.ask("S") == b"\x01"
        return reply

    def data(self, layout):
        while True:
            kind, body = self.receive()
            if kind == "U" and len(body) == struct.calcsize(layout):
                return struct.unpack(layout, body)


def row(timestamp):
    return round(timestamp * FEED.rate) % FEED.n


def test_the_order_of_messages_of_urs_own_client():
    # As in UR's RTDE_Python_Client_Library: example_control_loop.py.
    with rtde_server(version=(5, 23, 0, 1234)) as server, PlainClient(server) as client:
        assert client.ask("V", struct.pack(">H", 2)) == b"\x01"
        assert client.ask("v") == struct.pack(">4I", 5, 23, 0, 1234)
        outputs = b"timestamp,actual_q,output_int_register_0,input_double_register_3,robot_mode"
        reply = client.ask("O", struct.pack(">d", 500.0) + outputs)
        assert reply == b"\x01DOUBLE,VECTOR6D,INT32,DOUBLE,INT32"
        setpoint = client.ask("I", b"input_double_register_3,input_int_register_0")
        assert setpoint[1:] == b"DOUBLE,INT32"
        assert client.ask("S") == b"\x01"
        stamp, *q, register, echo, mode = client.data(">B7didi")[1:]
        assert q == pytest.approx(FEED.q[row(stamp)])
        assert (register, echo, mode) == (0, 0.0, 7)
        client.send("U", setpoint[:1] + struct.pack(">di", 2.5, 42))
        server.controller.set_output("output_int_register_0", [9])
        assert until(lambda: client.data(">B7didi")[8:] == (9, 2.5, 7))
        assert server.controller.inputs["input_int_register_0"] == (42,)
        assert client.ask("P") == b"\x01"


def test_an_input_has_one_writer_at_a_time():
    with rtde_server() as server, PlainClient(server) as first, PlainClient(server) as second:
        assert first.ask("I", b"input_int_register_0,input_int_register_1")[1:] == b"INT32,INT32"
        assert second.ask("I", b"input_int_register_1,input_int_register_2") == b"\x00IN_USE,INT32"
        first.socket.close()
        assert until(lambda: second.ask("I", b"input_int_register_1") == b"\x01INT32")


def test_every_sample_once_and_right():
    with rtde_server() as server, PlainClient(server) as client:
        client.start("timestamp,actual_q,actual_qd,actual_current,actual_current_as_torque,target_qdd")
        got = np.array([client.data(">B31d")[1:] for _ in range(200)])
    stamps = got[:, 0]
    assert np.allclose(np.diff(stamps), 0.002)
    rows = [row(stamp) for stamp in stamps]
    assert np.allclose(got[:, 1:7], FEED.q[rows])
    assert np.allclose(got[:, 7:13], FEED.qd[rows])
    assert np.allclose(got[:, 13:19] * TORQUE_CONSTANTS, FEED.joint_torque[rows])
    assert np.allclose(got[:, 19:25], FEED.joint_torque[rows])


def test_several_clients_each_with_its_own_recipe_and_rate():
    with rtde_server() as server, PlainClient(server) as fast, PlainClient(server) as slow:
        fast.start("timestamp,actual_q")
        slow.start("timestamp,robot_mode", 125.0)
        quick = [fast.data(">B7d")[1] for _ in range(40)]
        tardy = [slow.data(">Bdi")[1] for _ in range(10)]
        assert server.clients == 2
        slow.socket.close()
        assert until(lambda: server.clients == 1)
    assert np.allclose(np.diff(quick), 0.002)
    assert np.allclose(np.diff(tardy), 0.008)


def test_a_frequency_that_does_not_divide_500_is_kept_on_average():
    with rtde_server() as server, PlainClient(server) as client:
        client.start("timestamp", 300.0)
        stamps = np.array([client.data(">Bd")[1] for _ in range(301)])
    assert stamps[-1] - stamps[0] == pytest.approx(1.0, abs=0.002)
    assert set(np.round(np.diff(stamps), 6)) == {0.002, 0.004}


def test_protocol_version_1():
    with rtde_server() as server, PlainClient(server) as client:
        # Not asked for: it is the one that clients speak that ask for nothing.
        assert client.ask("O", b"timestamp,robot_mode") == b"DOUBLE,INT32"
        assert client.ask("S") == b"\x01"
        rows = [client.data(">di") for _ in range(20)]
        assert client.ask("V", b"\x00\x01") == b"\x01"
    assert np.allclose(np.diff([stamp for stamp, _ in rows]), 0.008)
    assert {mode for _, mode in rows} == {7}


@pytest.mark.parametrize(
    ("version", "reply"),
    [
        ((5, 23, 0, 0), b"\x01DOUBLE,VECTOR6D,VECTOR6D"),
        ((5, 22, 0, 0), b"\x00DOUBLE,NOT_FOUND,VECTOR6D"),
        ((3, 15, 0, 0), b"\x00DOUBLE,NOT_FOUND,NOT_FOUND"),
    ],
)
def test_fields_that_a_version_lacks_are_not_found(version, reply):
    with rtde_server(version=version) as server, PlainClient(server) as client:
        assert client.ask("V", b"\x00\x02") == b"\x01"
        names = b"timestamp,actual_current_as_torque,ft_raw_wrench"
        assert client.ask("O", struct.pack(">d", 125.0) + names) == reply


def test_refusals():
    with rtde_server() as server, PlainClient(server) as client:
        assert client.ask("V", b"\x00\x03") == b"\x00"
        assert client.ask("V", b"\x00\x02") == b"\x01"
        assert client.ask("S") == b"\x00"
        assert client.ask("O", struct.pack(">d", 1000.0) + b"timestamp")[0] == 0
        assert client.ask("I", b"no_such_input") == b"\x00NOT_FOUND"


@pytest.mark.parametrize(
    "noise",
    [
        b"\x00\x00V",
        b"\x00\x06V\x00\x02\x00",
        b"GET / HTTP/1.1\r\n\r\n",
        b"\x00\x05U\x09\x00",
        b"\x00\x04S\x00",
    ],
)
def test_clients_that_talk_nonsense_are_told_and_dropped_and_the_others_live(noise):
    with rtde_server() as server, PlainClient(server) as good, PlainClient(server) as bad:
        good.start("timestamp")
        bad.socket.sendall(noise + b"\xff\xff\xff\xff")
        kind, body = bad.receive()
        assert kind == "M"
        assert b"expected" in body
        with pytest.raises(ConnectionError):
            bad.receive()
        assert good.data(">Bd")


def test_a_client_that_does_not_read_is_dropped():
    with rtde_server(drop_after=0.3) as server, PlainClient(server) as good:
        lazy = PlainClient(server)
        lazy.socket.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 2048)
        # Much per packet, so that the buffers of the system fill up soon.
        lazy.start("timestamp," + ",".join(["actual_q"] * 150))
        good.start("timestamp")
        stamps = []

        def dropped():
            stamps.append(good.data(">Bd")[1])
            return server.clients == 1

        assert until(dropped, 20.0)
        assert np.allclose(np.diff(stamps), 0.002)
        lazy.socket.close()


def test_text_messages_and_the_log_of_departures(tmp_path):
    log = SentLog(tmp_path / "sent", rate=500.0)
    with rtde_server(sent=log) as server, PlainClient(server) as client:
        client.start("timestamp")
        stamp = client.data(">Bd")[1]
        arrived = time.monotonic_ns()
        elsewhere = SentLog(tmp_path / "sent", rate=500.0)  # as another process would open it
        assert 0 <= arrived - elsewhere.left_ns(stamp) < 1_000_000_000
        server.say("hello", source="mock", level=2)
        while (frame := client.receive())[0] != "M":
            pass
        assert frame[1] == b"\x05hello\x04mock\x02"


def test_simulated_time_may_begin_later_and_packets_may_leave_late():
    clock = waiting_clock()
    controller = PlaybackController(FEED, Playback(FEED))
    with RtdeServer(controller, clock, port=0, delay=0.05) as server, PlainClient(server) as client:
        client.start("timestamp")
        clock.start()
        stamp = client.data(">Bd")[1]
        assert stamp == 0.0
        assert time.monotonic_ns() - clock.start_ns >= 50_000_000


def test_playback_stays_or_begins_anew():
    stay, loop = Playback(FEED), Playback(FEED, loop=True)
    assert stay.index(0.0) == loop.index(0.0) == 0
    assert stay.index(1.0) == loop.index(1.0) == 500
    assert stay.index(11.0) == 4999
    assert loop.index(11.0) == 500
    assert stay.index(-1.0) == 0


def test_further_fields_and_their_checks():
    registers = np.arange(FEED.n, dtype=float)
    fields = {"output_double_register_24": registers, "target_moment": np.ones(6), "robot_mode": np.array(5)}
    with rtde_server(fields=fields) as server, PlainClient(server) as client:
        client.start("timestamp,output_double_register_24,target_moment,robot_mode")
        stamp, register, *moment, mode = client.data(">B8di")[1:]
        assert register == row(stamp)
        assert moment == [1.0] * 6
        assert mode == 5
    with pytest.raises(ValueError, match=r"expected shape \(6,\) or \(5000, 6\), got \(3,\)"):
        PlaybackController(FEED, Playback(FEED), fields={"target_moment": np.ones(3)})
    with pytest.raises(ValueError, match="expected names of RTDE outputs, got 'torque'"):
        PlaybackController(FEED, Playback(FEED), fields={"torque": np.ones(6)})


# ur_rtde may abort its process: it is run in one of its own.
UR_RTDE = """
import json, sys, time
from rtde_receive import RTDEReceiveInterface
robot = RTDEReceiveInterface(sys.argv[1])
time.sleep(0.1)
while True:  # the getters are not of one instant: take a set between two equal time stamps
    stamp = robot.getTimestamp()
    values = dict(
        actual_q=robot.getActualQ(), actual_qd=robot.getActualQd(), target_q=robot.getTargetQ(),
        actual_current=robot.getActualCurrent(), target_moment=robot.getTargetMoment(),
        robot_mode=robot.getRobotMode(), runtime_state=robot.getRuntimeState(),
        speed_scaling=robot.getSpeedScaling(), safety=robot.getSafetyStatusBits(),
        joint_mode=robot.getJointMode(), digital=robot.getActualDigitalInputBits(),
        register=robot.getOutputDoubleRegister(12),
        int_register=robot.getOutputIntRegister(19),
    )
    if robot.getTimestamp() == stamp:
        break
end = time.monotonic() + 10.0
while (later := robot.getTimestamp()) == stamp and time.monotonic() < end:
    time.sleep(0.01)
print(json.dumps(dict(values, timestamp=stamp, alive=later > stamp, connected=robot.isConnected())))
"""


@ur_rtde_installed
@pytest.mark.parametrize("version", [(5, 23, 0, 0), (5, 11, 0, 0), (10, 11, 0, 0), (3, 15, 8, 0)])
def test_the_unmodified_ur_rtde_reads_it(version):
    host = own_address()
    fields = {
        "output_double_register_12": np.array(1.25),
        "output_int_register_19": np.array(-7),
        "target_moment": np.arange(6.0),
        "actual_digital_input_bits": np.array(2**40, dtype=np.uint64),
    }
    with rtde_server(host=host, port=30004, version=version, fields=fields):
        done = subprocess.run(
            [sys.executable, "-c", UR_RTDE, host], capture_output=True, text=True, timeout=30, check=False
        )
    assert done.returncode == 0, done.stderr
    got = json.loads(done.stdout)
    i = row(got["timestamp"])
    assert got["connected"]
    assert got["alive"]
    assert got["actual_q"] == pytest.approx(FEED.q[i])
    assert got["actual_qd"] == pytest.approx(FEED.qd[i])
    assert got["target_q"] == pytest.approx(FEED.q[i])
    assert got["actual_current"] == pytest.approx(FEED.joint_torque[i] / TORQUE_CONSTANTS)
    assert got["target_moment"] == [0.0, 1.0, 2.0, 3.0, 4.0, 5.0]
    assert got["joint_mode"] == [253] * 6
    assert (got["robot_mode"], got["runtime_state"], got["safety"]) == (7, 2, 1)
    assert (got["speed_scaling"], got["digital"]) == (1.0, 2**40)
    assert (got["register"], got["int_register"]) == (1.25, -7)


def test_only_arms_of_six_joints():
    feed = SmallFeed()
    bad = type("Bad", (), {"q": feed.q[:, :4]})()
    with pytest.raises(ValueError, match="expected a motion of 6 joints"):
        PlaybackController(bad, Playback(feed))


def test_close_fault_hangs_up_on_old_and_new_clients():
    with rtde_server() as server, PlainClient(server) as client:
        client.start("timestamp")
        server.fault = Fault.CLOSE
        with pytest.raises(ConnectionError):
            client.data(">B")
        with PlainClient(server) as late, pytest.raises(ConnectionError):
            late.ask("V", b"\x00\x02")
        server.fault = Fault.NONE
        with PlainClient(server) as again:
            assert again.ask("V", b"\x00\x02") == b"\x01"
