"""The process in which ur_rtde's receive interface runs; it may abort or hang without affecting its parent.

Started by `contactsense.service.sensors.clients.ur_rtde_client`. Arguments: a socket's descriptor, host,
frequency, field names. Sends datagrams on the socket: `S` once it has started, `R` and doubles for a record,
`E` and text for a failure.
"""

import ctypes
import signal
import socket
import struct
import sys
import time
from collections.abc import Callable, Sequence
from typing import Any

from contactsense.service.group_signals import leave_to_parent

GETTERS = {
    "actual_q": "getActualQ",
    "actual_qd": "getActualQd",
    "actual_current": "getActualCurrent",
    "target_q": "getTargetQ",
    "target_qd": "getTargetQd",
    "target_qdd": "getTargetQdd",
    "target_current": "getTargetCurrent",
    "target_moment": "getTargetMoment",
    "actual_TCP_pose": "getActualTCPPose",
    "actual_TCP_speed": "getActualTCPSpeed",
    "actual_TCP_force": "getActualTCPForce",
    "ft_raw_wrench": "getFtRawWrench",
    "joint_temperatures": "getJointTemperatures",
    "speed_scaling": "getSpeedScaling",
    "robot_mode": "getRobotMode",
    "safety_mode": "getSafetyMode",
    "safety_status_bits": "getSafetyStatusBits",
    "runtime_state": "getRuntimeState",
    "payload": "getPayload",
    "payload_cog": "getPayloadCog",
}
"""RTDE field -> the getter of ur_rtde's receive interface; fields without a getter cannot be read."""

STARTED = b"S"
"""Sent before the connection to the robot is opened."""

HEAD = struct.Struct("=cqd")
"""Header of a record: its letter, arrival on the host's monotonic clock [ns], the robot's time stamp [s]."""

_PAUSE = 0.0002
"""Interval between two checks of the time stamp [s]; the robot sends every 2 ms."""

_PR_SET_PDEATHSIG = 1


def main(arguments: Sequence[str]) -> None:
    """Read until the connection is lost, then report that and exit."""
    if sys.platform == "linux":
        # A child that hangs inside ur_rtde would not notice that its parent has exited.
        ctypes.CDLL(None).prctl(_PR_SET_PDEATHSIG, signal.SIGKILL)
    leave_to_parent()
    channel = socket.socket(fileno=int(arguments[0]))
    host, frequency, fields = arguments[1], float(arguments[2]), arguments[3:]
    from rtde_receive import RTDEReceiveInterface

    channel.send(STARTED)
    try:
        robot = RTDEReceiveInterface(host, frequency, ["timestamp", *fields])
    except RuntimeError as error:
        channel.send(b"E" + str(error).encode())
        return
    _pump(robot, [getattr(robot, GETTERS[name]) for name in fields], channel)
    channel.send(b"E" + b"the connection to the robot was lost")


def _pump(robot: Any, getters: Sequence[Callable[[], Any]], channel: socket.socket) -> None:
    last = -1.0
    while True:
        stamp = robot.getTimestamp()
        if stamp == last:
            if not robot.isConnected():
                return
            time.sleep(_PAUSE)
            continue
        arrival = time.monotonic_ns()
        values: list[float] = []
        for getter in getters:
            value = getter()
            values.extend(value if isinstance(value, list) else (value,))
        if robot.getTimestamp() != stamp:
            continue  # a packet arrived in between: the values belong to two instants
        last = stamp
        channel.send(HEAD.pack(b"R", arrival, stamp) + struct.pack(f"={len(values)}d", *values))


if __name__ == "__main__":
    main(sys.argv[1:])
