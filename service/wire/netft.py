"""Raw Data Transfer (RDT) of ATI Net F/T sensors over UDP, and the sensor's configuration page; no sockets.

pynetft reads real sensors; this codec implements the sensor's side. Source: ATI, "Network Force/Torque Sensor
System, Installation and Operation Manual" (9620-05-NET FT).
"""

import struct
from collections.abc import Sequence
from dataclasses import dataclass
from enum import IntEnum
from xml.etree import ElementTree

_REQUEST = struct.Struct(">HHI")
_RECORD = struct.Struct(">III6i")
_MAGIC = 0x1234

CONFIGURATION_PATH = "/netftapi2.xml"
"""Page of the sensor's web server with the counts per unit."""

SATURATED = 0x80020000
"""Status of a record whose reading is out of the transducer's range."""

COUNTS_LIMIT = 2**31 - 1
"""Largest count: a signed 32-bit integer."""


class RdtProtocolError(Exception):
    """The datagram is not an RDT request; the text states what was expected and received."""


class Command(IntEnum):
    """Commands of a client."""

    STOP = 0x0000
    START_REALTIME = 0x0002
    START_BUFFERED = 0x0003
    SET_BIAS = 0x0042


@dataclass(frozen=True, slots=True)
class Request:
    """Client to sensor: a command, and the number of requested records (0: unlimited)."""

    command: Command
    count: int = 0

    def encode(self) -> bytes:
        """Encode the request as 8 bytes."""
        return _REQUEST.pack(_MAGIC, self.command, self.count)


@dataclass(frozen=True, slots=True)
class Record:
    """Sensor to client: one reading in counts, force then torque."""

    rdt_sequence: int
    """Number of the record within the stream, modulo 2^32."""
    ft_sequence: int
    """Number of the reading on the sensor's own clock, modulo 2^32."""
    status: int
    """Status word; 0: healthy."""
    counts: tuple[int, int, int, int, int, int]

    def encode(self) -> bytes:
        """Encode the record as 36 bytes."""
        return _RECORD.pack(self.rdt_sequence, self.ft_sequence, self.status, *self.counts)


@dataclass(frozen=True, slots=True)
class Configuration:
    """Counts per unit from the sensor's web page, and units as it spells them (`N`, `Nm`, `Nmm`, ...)."""

    counts_per_force: float = 1e6
    counts_per_torque: float = 1e6
    force_unit: str = "N"
    torque_unit: str = "Nm"
    product: str = "ATI Net F/T"

    def encode(self) -> bytes:
        """Encode the page as XML."""
        root = ElementTree.Element("netft")
        for tag, value in (
            ("prodname", self.product),
            ("cfgcpf", repr(self.counts_per_force)),
            ("cfgcpt", repr(self.counts_per_torque)),
            ("scfgfu", self.force_unit),
            ("scfgtu", self.torque_unit),
        ):
            ElementTree.SubElement(root, tag).text = value
        page: bytes = ElementTree.tostring(root, encoding="us-ascii", xml_declaration=True)
        return page


def parse_request(datagram: bytes) -> Request:
    """Parse a request of a client.

    Raises:
        RdtProtocolError: Not an RDT request.
    """
    if len(datagram) != _REQUEST.size:
        raise RdtProtocolError(f"expected a request of {_REQUEST.size} bytes, got {len(datagram)}")
    magic, command, count = _REQUEST.unpack(datagram)
    if magic != _MAGIC:
        raise RdtProtocolError(f"expected a request that begins with {_MAGIC:#06x}, got {magic:#06x}")
    try:
        return Request(Command(command), count)
    except ValueError:
        known = ", ".join(f"{c:#06x}" for c in Command)
        raise RdtProtocolError(f"expected one of the commands {known}, got {command:#06x}") from None


def to_counts(values: Sequence[float], counts_per_unit: float) -> tuple[list[int], bool]:
    """Convert values to counts, clipped to the range of a count; also returns whether any was clipped."""
    exact = [round(value * counts_per_unit) for value in values]
    clipped = [max(-COUNTS_LIMIT - 1, min(COUNTS_LIMIT, count)) for count in exact]
    return clipped, clipped != exact
