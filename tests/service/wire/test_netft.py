"""The Net F/T codec."""

from contextlib import suppress

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from contactsense.service.wire import netft as wire

i32 = st.integers(-(2**31), 2**31 - 1)
u32 = st.integers(0, 2**32 - 1)


def test_bytes_by_hand():
    assert wire.Request(wire.Command.START_REALTIME).encode() == bytes.fromhex("1234 0002 00000000")
    assert wire.Request(wire.Command.SET_BIAS, 1).encode() == bytes.fromhex("1234 0042 00000001")
    record = wire.Record(1, 2, 0, (1, -1, 0, 3, 4, 5))
    assert record.encode() == bytes.fromhex(
        "00000001 00000002 00000000 00000001 ffffffff 00000000 00000003 00000004 00000005"
    )


@settings(derandomize=True, deadline=None)
@given(st.sampled_from(wire.Command), u32)
def test_requests_round_trip(command, count):
    request = wire.Request(command, count)
    assert wire.parse_request(request.encode()) == request


@settings(derandomize=True, deadline=None)
@given(u32, u32, u32, st.tuples(i32, i32, i32, i32, i32, i32))
def test_records_round_trip(rdt, ft, status, counts):
    record = wire.Record(rdt, ft, status, counts)
    assert wire.parse_record(record.encode()) == record


@settings(derandomize=True, deadline=None)
@given(st.binary(max_size=60))
def test_any_datagram_is_read_or_refused(noise):
    for parse in (wire.parse_request, wire.parse_record, wire.parse_configuration):
        with suppress(wire.RdtProtocolError):
            parse(noise)


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


@settings(derandomize=True, deadline=None)
@given(st.floats(1e-3, 1e9), st.floats(1e-3, 1e9))
def test_configuration_round_trip(force, torque):
    configuration = wire.Configuration(force, torque, "N", "Nmm", "Delta & <more>")
    assert wire.parse_configuration(configuration.encode()) == configuration


@pytest.mark.parametrize(
    ("page", "complaint"),
    [
        (b"<netft", "expected the sensor's configuration as XML, got b'<netft'"),
        (b"<netft/>", "expected an entry cfgcpf"),
        (b"<netft><cfgcpf>-1</cfgcpf></netft>", "cfgcpf: expected a positive number, got '-1'"),
        (b"<netft><cfgcpf>many</cfgcpf></netft>", "cfgcpf: expected a positive number, got 'many'"),
    ],
)
def test_bad_configurations_are_named(page, complaint):
    with pytest.raises(wire.RdtProtocolError, match=complaint):
        wire.parse_configuration(page)


def test_counts_are_clipped_to_what_32_bits_hold():
    assert wire.to_counts([1.5, -2.0], 10.0) == ([15, -20], False)
    assert wire.to_counts([1e6, -1e6], 1e6) == ([2**31 - 1, -(2**31)], True)
