"""Communication faults for tests: how a mock corrupts the packets that it sends."""

import random
from enum import Enum


class Fault(Enum):
    """How the mock RTDE server misbehaves towards all its clients."""

    NONE = "none"
    MUTE = "mute"
    """Connections stay open, nothing is sent, no request is answered."""
    CLOSE = "close"
    """All connections are closed, new ones too."""
    HALF = "half"
    """Half a packet, then silence."""
    SPLIT = "split"
    """Every write ends in the middle of a packet; the rest comes with the next."""
    GARBAGE = "garbage"
    """Bytes that are not RTDE instead of packets."""
    ZERO_LENGTH = "zero_length"
    """Packets whose header gives a length of 0 bytes."""
    LOST_BYTE = "lost_byte"
    """Every packet lacks one byte in its middle."""
    NAN = "nan"
    """All floating-point values except the time stamp are NaN."""
    TIME_BACK = "time_back"
    """The time stamps are 100 s earlier."""


TIME_BACK_BY = 100.0
"""How far time jumps back with `Fault.TIME_BACK` [s]."""


def mangle(fault: Fault, packet: bytes) -> bytes:
    """Return the bytes to send instead of a packet, for faults without state; empty: nothing is sent."""
    middle = len(packet) // 2
    match fault:
        case Fault.MUTE | Fault.CLOSE | Fault.HALF:
            return b""
        case Fault.GARBAGE:
            return random.Random(0).randbytes(len(packet))
        case Fault.ZERO_LENGTH:
            return b"\x00\x00" + packet[2:]
        case Fault.LOST_BYTE:
            return packet[:middle] + packet[middle + 1 :]
        case _:
            return packet
