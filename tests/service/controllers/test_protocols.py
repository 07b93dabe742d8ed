"""XML-RPC, its HTTP and the line protocol: bytes in, calls out, bytes back."""

import contextlib
import math
import re
import xmlrpc.client

import pytest
from hypothesis import given
from hypothesis import strategies as st

from contactsense.service.controllers.http_calls import HttpError, HttpReader, HttpRequest
from contactsense.service.controllers.line_protocol import (
    MAX_LINE,
    LineError,
    LineReader,
    parse_line,
    reply,
)
from contactsense.service.controllers.robot_program import MAX_NUMBERS
from contactsense.service.controllers.xmlrpc import MAX_BODY, XmlRpcError, parse_call, response

finite = st.floats(allow_nan=False, allow_infinity=False)
words = st.text(st.characters(codec="ascii", exclude_categories=["C"]), max_size=10)


@given(arguments=st.lists(st.integers(-(2**31), 2**31 - 1) | finite | words | st.booleans(), max_size=16))
def test_calls_of_pythons_client(arguments: list[int | float | str | bool]) -> None:
    body = xmlrpc.client.dumps(tuple(arguments), "contactsense_expect").encode()
    assert parse_call(body) == ("contactsense_expect", arguments)


@given(numbers=st.lists(st.floats(-1e12, 1e12), max_size=30))
def test_answers_to_pythons_client(numbers: list[float]) -> None:
    body = response(numbers)
    assert b"e" not in b"".join(re.findall(rb"<double>(.*?)</double>", body))
    (answer,), _ = xmlrpc.client.loads(body)
    assert answer == pytest.approx(numbers, abs=1e-9, rel=1e-15)


CALL = b"<methodCall><methodName>a</methodName>%s</methodCall>"


@pytest.mark.parametrize(
    "body",
    [
        b"",
        b"hello",
        b"<methodCall/>",
        b"<methodResponse/>",
        CALL[:-4] % b"",
        CALL % b"<params><param><value><array><data/></array></value></param></params>",
        CALL % b"<params><param><value><struct/></value></param></params>",
        CALL % b"<params><param><value><double>nan</double></value></param></params>",
        CALL % b"<params><param><value><int>x</int></value></param></params>",
        CALL % (b"<params>" + b"<param><value>1</value></param>" * 17 + b"</params>"),
        CALL % b"<methodName>b</methodName>",
        b"<!DOCTYPE a [<!ENTITY x 'y'>]>" + CALL % b"",
        b"<?xml version='1.0' encoding='no-such'?>" + CALL % b"",
        b"<a>" * 10_000,
        b" " * (MAX_BODY + 1),
    ],
)
def test_what_is_no_call(body: bytes) -> None:
    with pytest.raises(XmlRpcError):
        parse_call(body)


@given(body=st.binary(max_size=300) | st.text("<>/&;![]'\"=? avlue", max_size=300).map(str.encode))
def test_a_body_is_a_call_or_an_error(body: bytes) -> None:
    with contextlib.suppress(XmlRpcError):
        parse_call(body)


def post(body: bytes, head: bytes = b"") -> bytes:
    return b"POST /RPC2 HTTP/1.1\r\nHost: a\r\n%sContent-Length: %d\r\n\r\n%s" % (head, len(body), body)


@given(bodies=st.lists(st.binary(max_size=50), max_size=5), cut=st.integers(1, 300))
def test_requests_survive_any_cut(bodies: list[bytes], cut: int) -> None:
    stream, reader = b"".join(map(post, bodies)), HttpReader()
    arrived = [r for i in range(0, len(stream), cut) for r in reader.feed(stream[i : i + cut])]
    assert arrived == [HttpRequest(b"POST", b"/RPC2", body, True) for body in bodies]
    assert not reader.begun


@pytest.mark.parametrize(
    ("stream", "status"),
    [
        (b"\x00\x01\x02", "400"),
        (b"POST /RPC2 HTTP/1.1\r\nContent-Length: -1\r\n\r\n", "400"),
        (b"POST /RPC2 HTTP/1.1\r\nA: " + b"a" * 40_000, "431"),
        (b"POST /" + b"a" * 40_000, "431"),
        (post(b"a" * (MAX_BODY + 1)), "413"),
        (b"GET / HTTP/1.1\r\nHost: a\r\nConnection: Upgrade\r\nUpgrade: websocket\r\n\r\n", "400"),
    ],
)
def test_what_is_no_request(stream: bytes, status: str) -> None:
    with pytest.raises(HttpError) as caught:
        HttpReader().feed(stream)
    assert caught.value.status.startswith(status)


def test_a_client_that_waits_to_be_told_to_go_on() -> None:
    reader = HttpReader()
    reader.feed(b"POST / HTTP/1.1\r\nHost: a\r\nExpect: 100-continue\r\nContent-Length: 2\r\n\r\n")
    assert reader.take_continue()
    assert not reader.take_continue()
    assert [request.body for request in reader.feed(b"ok")] == [b"ok"]


@given(chunks=st.lists(st.binary(max_size=100), max_size=5))
def test_a_stream_is_requests_or_an_error(chunks: list[bytes]) -> None:
    reader = HttpReader()
    try:
        for chunk in chunks:
            reader.feed(chunk)
    except HttpError:
        pass


@pytest.mark.parametrize(
    ("line", "request_"),
    [
        (b"status", ("status", [])),
        (b"  contactsense_status \r", ("status", [])),
        (b"expect 3", ("expect", [3.0])),
        (b"expect door", ("expect", ["door"])),
        (b"expect nan", ("expect", ["nan"])),
    ],
)
def test_lines(line: bytes, request_: tuple[str, list[float | str]]) -> None:
    assert parse_line(line) == request_


@given(stream=st.binary(max_size=600), cut=st.integers(1, 600))
def test_any_bytes_are_lines_or_errors_however_they_are_cut(stream: bytes, cut: int) -> None:
    whole = [str(request) for request in LineReader().feed(stream + b"\n")]
    reader = LineReader()
    pieces = [str(r) for i in range(0, len(stream), cut) for r in reader.feed(stream[i : i + cut])]
    pieces += [str(request) for request in reader.feed(b"\n")]
    assert len(pieces) == len(whole)


def test_a_line_too_long_is_told_once_and_the_next_is_read() -> None:
    reader = LineReader()
    answers = [r for _ in range(10) for r in reader.feed(b"a" * MAX_LINE)]
    assert len(answers) == 1
    assert isinstance(answers[0], LineError)
    assert reader.feed(b"aaa\nstatus\n") == [("status", [])]


def test_a_clock_since_1970_is_told_in_full() -> None:
    assert reply([1.0, 1764374400.25]) == b"( 1.000000, 1764374400.250000 )\n"


@given(numbers=st.lists(finite, min_size=1, max_size=40))
def test_replies_are_what_urscript_reads(numbers: list[float]) -> None:
    text = reply(numbers)
    assert len(text) <= 1000  # URScript reads about 1 kB at a time
    assert re.fullmatch(rb"\( -?\d+\.\d+(, -?\d+\.\d+)* \)\n", text)
    read = [float(word) for word in text[1:-2].split(b",")]
    expected = [min(max(number, -1e12), 1e12) for number in numbers[:MAX_NUMBERS]]
    assert all(math.isclose(a, b, abs_tol=1e-6) for a, b in zip(read, expected, strict=True))
