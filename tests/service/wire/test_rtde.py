"""The RTDE codec: one list of frames drives encoder and parsers, whole, byte by byte, and damaged."""

import struct

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from contactsense.service.wire import rtde as wire
from contactsense.service.wire.rtde_fields import INPUTS, OUTPUTS, TYPE_CODES, WIDTHS, available

NAMES = ("timestamp", "actual_q", "robot_mode")
TYPES = ("DOUBLE", "VECTOR6D", "INT32")

# (side, message, bytes on the wire): written out by hand from the protocol's description.
REQUESTS = [
    (wire.ProtocolVersionRequest(2), "00 05 56 00 02"),
    (wire.ControllerVersionRequest(), "00 03 76"),
    (
        wire.OutputSetup(500.0, ("timestamp", "actual_q")),
        "00 1d 4f 40 7f 40 00 00 00 00 00 " + b"timestamp,actual_q".hex(" "),
    ),
    (wire.InputSetup(("input_int_register_0",)), "00 17 49 " + b"input_int_register_0".hex(" ")),
    (wire.Start(), "00 03 53"),
    (wire.Pause(), "00 03 50"),
    (wire.TextMessage("hi", "me", 3), "00 0a 4d 02 68 69 02 6d 65 03"),
    (wire.Data(b"\x01\x00\x00\x00\x2a"), "00 08 55 01 00 00 00 2a"),
]
REPLIES = [
    (wire.ProtocolVersionReply(True), "00 04 56 01"),
    (wire.ProtocolVersionReply(False), "00 04 56 00"),
    (wire.ControllerVersion(5, 23, 1, 7), "00 13 76 00 00 00 05 00 00 00 17 00 00 00 01 00 00 00 07"),
    (
        wire.SetupReply(False, 1, ("DOUBLE", "VECTOR6D")),
        "00 13 4f 01 " + b"DOUBLE,VECTOR6D".hex(" "),
    ),
    (wire.SetupReply(True, 3, ("IN_USE",)), "00 0a 49 03 " + b"IN_USE".hex(" ")),
    (wire.StartReply(True), "00 04 53 01"),
    (wire.PauseReply(True), "00 04 50 01"),
    (wire.TextMessage("no", "robot", 0), "00 0d 4d 02 6e 6f 05 72 6f 62 6f 74 00"),
    (wire.Data(b"\x01\x05"), "00 05 55 01 05"),
]
CASES = [(wire.parse_request, m, b) for m, b in REQUESTS] + [(wire.parse_reply, m, b) for m, b in REPLIES]


def frames(decoder: wire.FrameDecoder) -> list[wire.Frame]:
    found = []
    while (frame := decoder.next_frame()) is not None:
        found.append(frame)
    return found


@pytest.mark.parametrize(("parse", "message", "octets"), CASES)
def test_messages_and_bytes(parse, message, octets):
    raw = bytes.fromhex(octets)
    assert wire.encode(message) == raw
    decoder = wire.FrameDecoder()
    decoder.feed(raw)
    assert [parse(frame) for frame in frames(decoder)] == [message]


@pytest.mark.parametrize("side", [REQUESTS, REPLIES])
@pytest.mark.parametrize("step", [1, 2, 3, 7, 10_000])
def test_pieces_of_any_size(side, step):
    stream = b"".join(bytes.fromhex(octets) for _, octets in side)
    parse = wire.parse_request if side is REQUESTS else wire.parse_reply
    decoder, got = wire.FrameDecoder(), []
    for start in range(0, len(stream), step):
        decoder.feed(stream[start : start + step])
        got += [parse(frame) for frame in frames(decoder)]
    assert got == [message for message, _ in side]


def test_name_lists_as_clients_write_them():
    # ur_rtde ends its list with a comma, people put blanks after commas.
    frame = wire.Frame(ord("O"), struct.pack(">d", 125.0) + b"timestamp, actual_q,")
    assert wire.parse_request(frame) == wire.OutputSetup(125.0, ("timestamp", "actual_q"))


text = st.text(st.characters(min_codepoint=32, max_codepoint=126), max_size=60)
name = st.text(st.characters(min_codepoint=97, max_codepoint=122), min_size=1, max_size=20)
names = st.lists(name, max_size=20).map(tuple)
u32 = st.integers(0, 2**32 - 1)
request = st.one_of(
    st.builds(wire.ProtocolVersionRequest, st.integers(0, 65535)),
    st.just(wire.ControllerVersionRequest()),
    st.builds(wire.OutputSetup, st.floats(allow_nan=False), names),
    st.builds(wire.InputSetup, names),
    st.just(wire.Start()),
    st.just(wire.Pause()),
    st.builds(wire.TextMessage, text, text, st.integers(0, 255)),
    st.builds(wire.Data, st.binary(min_size=1, max_size=300)),
)
reply = st.one_of(
    st.builds(wire.ProtocolVersionReply, st.booleans()),
    st.builds(wire.ControllerVersion, u32, u32, u32, u32),
    st.builds(wire.SetupReply, st.booleans(), st.integers(0, 255), names),
    st.builds(wire.StartReply, st.booleans()),
    st.builds(wire.PauseReply, st.booleans()),
    st.builds(wire.TextMessage, text, text, st.integers(0, 255)),
    st.builds(wire.Data, st.binary(min_size=1, max_size=300)),
)


@pytest.mark.parametrize(("messages", "parse"), [(request, wire.parse_request), (reply, wire.parse_reply)])
@given(data=st.data())
def test_round_trip_in_random_pieces(messages, parse, data):
    sent = data.draw(st.lists(messages, max_size=8))
    stream = b"".join(wire.encode(message) for message in sent)
    decoder, got, position = wire.FrameDecoder(), [], 0
    while position < len(stream):
        size = data.draw(st.integers(1, 40))
        decoder.feed(stream[position : position + size])
        position += size
        got += [parse(frame) for frame in frames(decoder)]
    assert got == sent


@settings(max_examples=300)
@given(st.binary(max_size=200), st.booleans())
def test_any_bytes_give_frames_or_an_error_and_an_end(noise, from_client):
    decoder = wire.FrameDecoder()
    decoder.expect_data_size(20)
    decoder.feed(noise)
    parse = wire.parse_request if from_client else wire.parse_reply
    for _ in range(len(noise) + 1):
        try:
            frame = decoder.next_frame()
            if frame is None:
                return
            parse(frame)
        except wire.RtdeProtocolError:
            return
    pytest.fail("the decoder does not come to an end")


@pytest.mark.parametrize(
    ("octets", "complaint"),
    [
        ("00 00 55 01", "expected a frame of at least 3 bytes, got 0: 00 00 55 01"),
        ("00 02 55", "expected a frame of at least 3 bytes, got 2"),
        ("00 09 58 00", "expected a package type out of V v O I S P U M, got 0x58"),
        ("00 09 55 01 00", "expected data frames of 20 bytes, got 9"),
    ],
)
def test_bad_frames_are_named_and_stay_bad(octets, complaint):
    decoder = wire.FrameDecoder()
    decoder.expect_data_size(20)
    good = wire.encode(wire.StartReply(True))
    decoder.feed(good + bytes.fromhex(octets))
    assert decoder.next_frame() == wire.Frame(ord("S"), b"\x01")
    for _ in range(2):
        with pytest.raises(wire.RtdeProtocolError, match=complaint):
            decoder.next_frame()
        decoder.feed(good)


@pytest.mark.parametrize(
    ("parse", "letter", "payload", "complaint"),
    [
        (wire.parse_request, "V", b"\x02", "expected 2 bytes, got 1: 02"),
        (wire.parse_request, "O", b"\x00\x00", "expected a frequency of 8 bytes, got 2"),
        (wire.parse_request, "S", b"\x00", "start: expected 0 bytes, got 1"),
        (wire.parse_request, "U", b"", "expected a recipe number, got no bytes"),
        (wire.parse_reply, "v", b"\x00" * 15, "expected 16 bytes, got 15"),
        (wire.parse_reply, "O", b"", "expected a recipe number, got no bytes"),
        (wire.parse_reply, "S", b"", "reply to start: expected 1 bytes, got 0"),
        (wire.parse_reply, "M", b"\x05ab", "expected a length and a message, got 05 61 62"),
        (wire.parse_reply, "M", b"\x01a", "expected a length and a source, got"),
    ],
)
def test_bad_payloads_are_named(parse, letter, payload, complaint):
    with pytest.raises(wire.RtdeProtocolError, match=complaint):
        parse(wire.Frame(ord(letter), payload))


def test_too_long_lists_of_names_are_refused():
    with pytest.raises(wire.RtdeProtocolError, match="at most 2048 bytes of field names"):
        wire.encode(wire.InputSetup(("x" * 50,) * 50))


def value(kind: str) -> st.SearchStrategy:
    return {
        "?": st.booleans(),
        "B": st.integers(0, 255),
        "I": u32,
        "Q": st.integers(0, 2**64 - 1),
        "i": st.integers(-(2**31), 2**31 - 1),
        "d": st.floats(allow_nan=False),
    }[TYPE_CODES[kind][-1]]


@given(st.data())
def test_recipes_round_trip(data):
    types = data.draw(st.lists(st.sampled_from(sorted(TYPE_CODES)), min_size=1, max_size=30))
    number = data.draw(st.integers(0, 255))
    recipe = wire.Recipe(number, [f"f{i}" for i in range(len(types))], types)
    values = tuple(data.draw(value(kind)) for kind in types for _ in range(WIDTHS[kind]))
    raw = recipe.pack(values)
    decoder = wire.FrameDecoder()
    decoder.expect_data_size(recipe.size)
    decoder.feed(raw)
    frame = decoder.next_frame()
    assert frame is not None
    assert recipe.unpack(frame.payload) == values
    assert wire.Data(frame.payload).recipe_id == number
    for i, kind in enumerate(types):
        assert len(values[recipe.slices[f"f{i}"]]) == WIDTHS[kind]


def test_recipe_by_hand():
    recipe = wire.Recipe(1, NAMES, TYPES)
    raw = recipe.pack([2.0, 1, 2, 3, 4, 5, 6, 7])
    assert raw == struct.pack(">HBB7di", 3 + 1 + 60, ord("U"), 1, 2.0, 1, 2, 3, 4, 5, 6, 7)
    assert recipe.size == 64
    assert recipe.slices["actual_q"] == slice(1, 7)


def test_recipes_complain_by_name():
    with pytest.raises(wire.RtdeFieldError, match="does not know actual_x, actual_y") as caught:
        wire.Recipe(0, ("actual_x", "timestamp", "actual_y"), ("NOT_FOUND", "DOUBLE", "NOT_FOUND"))
    assert caught.value.not_found == ("actual_x", "actual_y")
    with pytest.raises(wire.RtdeFieldError, match="another client already writes speed_slider_mask"):
        wire.Recipe(0, ("speed_slider_mask",), ("IN_USE",))
    with pytest.raises(wire.RtdeProtocolError, match="expected 1 types for 1 fields, got 2"):
        wire.Recipe(0, ("timestamp",), ("DOUBLE", "DOUBLE"))
    with pytest.raises(wire.RtdeProtocolError, match=r"expected one of the types BOOL.*got 'DUBBLE'"):
        wire.Recipe(0, ("timestamp",), ("DUBBLE",))
    recipe = wire.Recipe(1, NAMES, TYPES)
    with pytest.raises(wire.RtdeProtocolError, match="expected a data package of 61 bytes, got 60"):
        recipe.unpack(bytes(60))
    with pytest.raises(wire.RtdeProtocolError, match="expected data of recipe 1, got recipe 9"):
        recipe.unpack(b"\x09" + bytes(60))


def test_fields():
    assert OUTPUTS["actual_q"] == "VECTOR6D"
    assert OUTPUTS["joint_mode"] == "VECTOR6INT32"
    assert OUTPUTS["output_double_register_47"] == "DOUBLE"
    assert OUTPUTS["input_int_register_0"] == INPUTS["input_int_register_0"] == "INT32"
    assert "actual_q" not in INPUTS
    assert set(OUTPUTS.values()) | set(INPUTS.values()) <= set(TYPE_CODES)


@pytest.mark.parametrize(
    ("field", "version", "there"),
    [
        ("actual_q", (3, 1, 0), True),
        ("actual_current_as_torque", (5, 22, 9), False),
        ("actual_current_as_torque", (5, 23, 0), True),
        ("actual_current_as_torque", (10, 10, 0), False),
        ("actual_current_as_torque", (10, 11, 0), True),
        ("actual_current_as_torque", (3, 15, 8), False),
        ("ft_raw_wrench", (10, 7, 0), True),
        ("payload", (5, 5, 0), False),
        ("payload", (5, 5, 1), True),
        ("no_such_field", (5, 23, 0), False),
    ],
)
def test_versions_bring_fields(field, version, there):
    assert available(field, version) is there
