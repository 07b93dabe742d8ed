"""The living controller on the wire: UR's own recipe, ur_rtde's interfaces, dashboard, programs, inputs."""

import json
import socket
import struct
import subprocess
import sys
from contextlib import contextmanager

import numpy as np
import pytest

from contactsense.kinematics.forward_kinematics import forward_kinematics
from contactsense.kinematics.model import build_model, empty_motion
from contactsense.service.mock.arm.cell import Cell
from contactsense.service.mock.arm.script import Script
from contactsense.service.mock.controller.robot_controller import RobotController
from contactsense.service.mock.controller.robot_state import RuntimeState
from contactsense.service.mock.live_servers import InterfacePorts, LiveServers
from contactsense.service.mock.servers import MockSettings
from tests.service.loopback import own_address, until
from tests.service.mock.interfaces.test_rtde_server import PlainClient

FIELDS = {
    "robot": "ur5e",
    "trajectory": {
        "start": [0.0, -1.3, 1.6, -1.9, -1.57, 0.0],
        "dwell": 0.2,
        "moves": [
            {"to": [1.2, -1.3, 1.6, -1.9, -1.57, 0.0], "duration": 2.0},
            {"to": [0.0, -1.3, 1.6, -1.9, -1.57, 0.0], "duration": 2.0, "dwell": 0.2},
        ],
    },
}

# Universal Robots, RTDE_Python_Client_Library, examples/record_configuration.xml.
STOCK_RECIPE = [
    "timestamp",
    "target_q",
    "target_qd",
    "target_qdd",
    "target_current",
    "target_moment",
    "actual_q",
    "actual_qd",
    "actual_current",
    "joint_control_output",
    "actual_TCP_pose",
    "actual_TCP_speed",
    "actual_TCP_force",
    "target_TCP_pose",
    "target_TCP_speed",
    "actual_digital_input_bits",
    "joint_temperatures",
    "actual_execution_time",
    "robot_mode",
    "joint_mode",
    "safety_mode",
    "actual_tool_accelerometer",
    "speed_scaling",
    "target_speed_fraction",
    "actual_momentum",
    "actual_main_voltage",
    "actual_robot_voltage",
    "actual_robot_current",
    "actual_joint_voltage",
    "actual_digital_output_bits",
    "runtime_state",
]
FURTHER = [
    "joint_position_deviation_ratio",
    "collision_detection_ratio",
    "tool_mode",
    "tool_analog_input0",
    "tool_temperature",
    "tool_output_voltage",
    "tool_output_mode",
    "tool_digital_output0_mode",
    "euromap67_input_bits",
    "euromap67_output_bits",
    "euromap67_24V_voltage",
    "euromap67_24V_current",
    "encoder0_raw",
    "encoder1_raw",
    "ft_raw_wrench",
    "payload",
    "payload_cog",
    "time_scale_source",
    "wrench_calc_from_currents",
    "output_bit_registers0_to_31",
    "script_control_line",
]
WIDTHS = {"DOUBLE": "d", "VECTOR6D": "6d", "VECTOR3D": "3d", "INT32": "i", "UINT32": "I", "UINT64": "Q"}
WIDTHS |= {"VECTOR6INT32": "6i", "UINT8": "B"}


@contextmanager
def living(host="127.0.0.1", rtde_port=0, ports=None, loop=True, **fields):
    script = Script.model_validate(FIELDS | fields)
    robot = RobotController(Cell.of_script(script), script, loop=loop)
    settings = MockSettings(host=host, rtde_port=rtde_port, netft_port=0, http_port=0)
    with LiveServers(robot, settings, ports or InterfacePorts.free()) as servers:
        yield servers


def record(client, names, count):
    reply = client.start(",".join(names)).decode()[1:].split(",")
    assert "NOT_FOUND" not in reply, dict(zip(names, reply, strict=True))
    layout = ">B" + "".join(WIDTHS[kind] for kind in reply)
    rows = []
    for _ in range(count):
        values, row = list(client.data(layout)[1:]), {}
        for name, kind in zip(names, reply, strict=True):
            width = int(WIDTHS[kind][:-1] or 1)
            row[name] = np.array(values[:width])
            del values[:width]
        rows.append(row)
    return rows


@pytest.mark.slow
def test_urs_own_recipe_and_further_fields():
    with living() as servers, PlainClient(servers.rtde) as client:
        rows = record(client, STOCK_RECIPE + FURTHER, 300)
    row = rows[-1]
    robot = servers.robot.cell.robot
    motion = empty_motion(6)
    forward_kinematics(build_model(robot), row["actual_q"], motion)
    flange = motion.origin[-1] + motion.rotation[-1] @ robot.flange_translation
    np.testing.assert_allclose(row["actual_TCP_pose"][:3], flange, atol=1e-9)
    stamps = np.array([r["timestamp"][0] for r in rows])
    np.testing.assert_allclose(np.diff(stamps), 0.002, atol=1e-9)
    poses = np.array([r["actual_TCP_pose"][:3] for r in rows])
    speeds = np.array([r["actual_TCP_speed"][:3] for r in rows])
    np.testing.assert_allclose(np.diff(poses, axis=0) / 0.002, 0.5 * (speeds[1:] + speeds[:-1]), atol=2e-3)
    assert np.abs(speeds).max() > 0.01
    assert row["runtime_state"] == 2
    assert row["robot_mode"] == 7
    assert 0.0 <= row["joint_position_deviation_ratio"] < 0.1
    moment = row["target_moment"]
    np.testing.assert_allclose(moment / servers.robot.cell.torque_constants, row["target_current"], atol=1e-9)
    assert np.abs(moment).max() > 10.0


def ask(link, line):
    link.sendall(line.encode() + b"\n")
    answer = b""
    while not answer.endswith(b"\n"):
        answer += link.recv(4096)
    return answer.decode().strip()


def test_a_dashboard_session():
    with living() as servers, socket.create_connection(("127.0.0.1", servers.dashboard.port), 5.0) as link:
        assert link.recv(100) == b"Connected: Universal Robots Dashboard Server\n"
        assert "5.23.0.0" in ask(link, "PolyscopeVersion")
        assert ask(link, "get serial number").isdigit()
        assert ask(link, "is in remote control") == "true"
        assert ask(link, "get robot model") == "UR5"
        assert ask(link, "robotmode") == "Robotmode: RUNNING"
        assert ask(link, "safetystatus") == "Safetystatus: NORMAL"
        assert ask(link, "programState") == "PLAYING mock.urp"
        assert ask(link, "running") == "Program running: true"
        assert ask(link, "pause") == "Pausing program"
        assert until(lambda: ask(link, "programState") == "PAUSED mock.urp")
        assert ask(link, "play") == "Starting program"
        assert ask(link, "stop") == "Stopped"
        assert until(lambda: ask(link, "programState") == "STOPPED mock.urp")
        assert ask(link, "stop") == "Failed to execute: stop"
        assert ask(link, "popup Contact on the forearm") == "showing popup"
        assert servers.robot.popup == "Contact on the forearm"
        assert ask(link, "close popup") == "closing popup"
        assert servers.robot.popup == ""
        assert ask(link, "addToLog hello") == "Added log message"
        assert servers.robot.log[-1] == "hello"
        servers.robot.protective_stop("test")
        assert ask(link, "safetystatus") == "Safetystatus: PROTECTIVE_STOP"
        assert ask(link, "unlock protective stop").startswith("Cannot unlock protective stop until 5s")
        assert ask(link, "play") == "Failed to execute: play"
        assert ask(link, "dance") == "could not understand: 'dance'"
        assert ask(link, "quit") == "Disconnected"
        assert link.recv(1) == b""


def packages(link, count):
    data, found = b"", []
    while len(found) < count:
        data += link.recv(65536)
        while len(data) >= 4 and len(data) >= struct.unpack_from(">i", data)[0]:
            size = struct.unpack_from(">i", data)[0]
            found.append(data[:size])
            data = data[size:]
    return found


@pytest.mark.parametrize("name", ["primary", "secondary", "realtime"])
def test_a_stop_program_at_each_client_interface(name):
    with (
        living() as servers,
        socket.create_connection(("127.0.0.1", servers.interfaces[name].port), 5.0) as link,
    ):
        assert until(lambda: servers.robot.now > 0.8)
        states = packages(link, 3)
        if name == "realtime":
            numbers = struct.unpack(">i152d", states[-1])
            assert numbers[0] == 1220
            np.testing.assert_allclose(numbers[32:38], servers.robot.at(numbers[1]).q)
        else:
            version, *_, state = states
            assert version[4] == 20
            assert b"URControl" in version
            assert state[4] == 16
            angle = struct.unpack_from(">d", state, state.index(struct.pack(">iB", 251, 1)) + 5)[0]
            assert 0.0 < angle <= 1.2
        link.sendall(b"stopj(0)\ndef contact_stop():\n  stopj(8.0)\n  freedrive_mode()\nend\n")
        assert until(lambda: servers.robot.runtime is RuntimeState.STOPPED)
        assert until(lambda: np.abs(servers.robot.at(servers.robot.now).qd).max() < 1e-4)
        refused, unknown = servers.robot.log
        assert refused == "program line: not run: stopj: a: expected a number above 0, got 0"
        assert "freedrive_mode" in unknown


def test_inputs_act_and_read_back():
    with living() as servers, PlainClient(servers.rtde) as client:
        assert client.ask("V", b"\x00\x02") == b"\x01"
        names = b"speed_slider_mask,speed_slider_fraction,input_int_register_47,"
        names += b"standard_digital_output_mask,standard_digital_output"
        recipe = client.ask("I", names)
        assert recipe[1:] == b"UINT32,DOUBLE,INT32,UINT8,UINT8"
        outputs = "target_speed_fraction,speed_scaling,input_int_register_47,actual_digital_output_bits"
        client.start(outputs)
        client.send("U", recipe[:1] + struct.pack(">IdiBB", 1, 0.25, 42, 0b110, 0b010))
        assert until(lambda: client.data(">BddiQ")[1:] == (0.25, 0.25, 42, 0b010))


def test_messages_of_the_robot_reach_rtde_clients():
    with living() as servers, PlainClient(servers.rtde) as client:
        client.start("timestamp")
        servers.robot.send_message("look out")
        while (frame := client.receive())[0] != "M":
            pass
        assert b"look out" in frame[1]


UR_RTDE = """
import json, sys, time
from rtde_control import RTDEControlInterface
from rtde_io import RTDEIOInterface
from rtde_receive import RTDEReceiveInterface
receive = RTDEReceiveInterface(sys.argv[1])
control = RTDEControlInterface(sys.argv[1])
io = RTDEIOInterface(sys.argv[1])
running = control.isProgramRunning()
moved = control.moveJ([0.3, -1.3, 1.6, -1.9, -1.57, 0.0], 1.0, 2.0)
there = receive.getActualQ()
control.moveJ([-0.9, -1.3, 1.6, -1.9, -1.57, 0.0], 1.0, 2.0, True)
end = time.monotonic() + 20.0
while receive.getActualQ()[0] > 0.1 and time.monotonic() < end:
    time.sleep(0.002)
control.stopJ(5.0)
while max(abs(v) for v in receive.getActualQd()) > 1e-3 and time.monotonic() < end:
    time.sleep(0.002)
rest = receive.getActualQd()
io.setSpeedSlider(0.5)
while receive.getTargetSpeedFraction() != 0.5 and time.monotonic() < end:
    time.sleep(0.002)
slider = receive.getTargetSpeedFraction()
print(json.dumps(dict(running=running, moved=moved, there=there, rest=rest, slider=slider,
    pose=receive.getActualTCPPose(), q=receive.getActualQ())), flush=True)
control.stopScript()
"""


@pytest.mark.slow
def test_the_unmodified_ur_rtde_controls_it():
    pytest.importorskip("rtde_control", reason="ur_rtde has no wheel for this Python or platform")
    host = own_address()
    with living(host, 30004, InterfacePorts()) as servers:
        done = subprocess.run(
            [sys.executable, "-c", UR_RTDE, host], capture_output=True, text=True, timeout=60, check=False
        )
        said = list(servers.robot.log)
    assert done.returncode == 0, done.stderr
    got = json.loads(done.stdout.splitlines()[-1])
    assert got["running"]
    assert got["moved"]
    np.testing.assert_allclose(got["there"], [0.3, -1.3, 1.6, -1.9, -1.57, 0.0], atol=1e-3)
    np.testing.assert_allclose(got["rest"], 0.0, atol=1e-3)
    assert -0.8 < got["q"][0] < 0.1
    assert got["slider"] == 0.5
    assert not [text for text in said if "does not simulate" in text]
