"""The Net F/T codec."""

from contextlib import suppress

import pytest
from hypothesis import given
from hypothesis import strategies as st

from contactsense.service.wire import netft as wire

u32 = st.integers(0, 2**32 - 1)


def test_bytes_by_hand():
    assert wire.Request(wire.Command.START_REALTIME).encode() == bytes.fromhex("1234 0002 00000000")
    assert wire.Request(wire.Command.SET_BIAS, 1).encode() == bytes.fromhex("1234 0042 00000001")
    record = wire.Record(1, 2, 0, (1, -1, 0, 3, 4, 5))
    assert record.encode() == bytes.fromhex(
        "00000001 00000002 00000000 00000001 ffffffff 00000000 00000003 00000004 00000005"
    )


@given(st.sampled_from(wire.Command), u32)
def test_requests_round_trip(command, count):
    request = wire.Request(command, count)
    assert wire.parse_request(request.encode()) == request


@given(st.binary(max_size=60))
def test_any_datagram_is_read_or_refused(noise):
    with suppress(wire.RdtProtocolError):
        wire.parse_request(noise)


@pytest.mark.parametrize(
    ("datagram", "complaint"),
    [
        (b"", "expected a request of 8 bytes, got 0"),
        (bytes.fromhex("4321 0002 00000000"), "expected a request that begins with 0x1234, got 0x4321"),
        (bytes.fromhex("1234 0009 00000000"), "expected one of the commands 0x0000, .*, got 0x0009"),
    ],
)
def test_bad_requests_are_named(datagram, complaint):
    with pytest.raises(wire.RdtProtocolError, match=complaint):
        wire.parse_request(datagram)


def test_counts_are_clipped_to_what_32_bits_hold():
    assert wire.to_counts([1.5, -2.0], 10.0) == ([15, -20], False)
    assert wire.to_counts([1e6, -1e6], 1e6) == ([2**31 - 1, -(2**31)], True)
