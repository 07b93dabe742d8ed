"""The methods for robot programs, by themselves and through their ports."""

import asyncio
import ctypes
import re
import socket
import subprocess
import sys
import threading
import time
import xmlrpc.client
from collections.abc import Iterator
from contextlib import contextmanager
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from pydantic import ValidationError

from contactsense import Estimate
from contactsense.service.api.app import create_app
from contactsense.service.api.settings import Settings
from contactsense.service.controllers.line_protocol import reply
from contactsense.service.controllers.robot_program import (
    BAD_ARGUMENT,
    BAD_REQUEST,
    CONTACT,
    INTERFACE,
    NO_ESTIMATE,
    NONE,
    NOT_POSSIBLE,
    UNKNOWN_METHOD,
    NewestEstimate,
    RobotProgramMethods,
)
from contactsense.service.controllers.robot_program_servers import RobotProgramServers
from contactsense.service.controllers.settings import ControllerSettings
from contactsense.service.free_ports import PortError
from contactsense.service.live.estimate_json import estimate_json
from contactsense.service.live.hub import Hub
from contactsense.service.reactions.rules import ReactionRules
from contactsense.service.reactions.state import Reactions
from contactsense.types import Contact
from tests.service import http
from tests.service.controllers import xmlrpc_c
from tests.service.serving import serving

TOUCH = Contact(
    link="forearm", link_index=3, primitive=0, probability=0.9, point=np.array([0.1, 0.2, 0.3]),
    point_base=np.array([0.4, 0.5, 0.6]), normal_base=np.array([0.0, 0.0, 1.0]),
    force_base=np.array([3.0, 0.0, -4.0]), torsion=0.25, covariance=np.eye(3), id=7, phase="hold",
)  # fmt: skip
LENGTHS = {"version": 5, "status": 5, "contact": 15, "link": 6, "wrench": 7}
"""Kept for ever: programs take numbers by their place."""


def estimate(*contacts: Contact) -> bytes:
    link_probability = np.array([0.0, 0.0, 0.0, 0.8, 0.1, 0.0, 0.0])
    wrench = np.array([3.0, 0.0, -4.0, 0.1, np.nan, 0.3])
    status = "contact" if contacts else "none"
    return estimate_json(Estimate(2.5, status, contacts, link_probability, wrench, np.eye(6)))


def rules() -> ReactionRules:
    return ReactionRules.model_validate(
        {
            "actions": {"tell": {"type": "registers"}},
            "rules": [{"name": "all", "links": ["any"], "contact": {"force": 9.0, "actions": ["tell"]}}],
            "expected": [{"name": "door", "links": ["any"], "force": 50.0, "value": 3}],
        }
    )


@pytest.fixture
def hub(monkeypatch: pytest.MonkeyPatch) -> Hub:
    """For which time stands still: an estimate is as new as it was, however slow the computer is."""
    standing = SimpleNamespace(monotonic=lambda: 1000.0)
    monkeypatch.setattr("contactsense.service.live.hub.time", standing)
    monkeypatch.setattr("contactsense.service.controllers.robot_program.time", standing)
    return Hub()


@pytest.fixture
def sent() -> list[dict[str, Any]]:
    return []


@pytest.fixture
def methods(hub: Hub, sent: list[dict[str, Any]]) -> RobotProgramMethods:
    reactions = Reactions(rules(), "192.0.2.1", lambda command: sent.append(command) is None)
    return RobotProgramMethods(NewestEstimate(hub, lambda: True), reactions)


def test_a_contact(hub: Hub, methods: RobotProgramMethods) -> None:
    hub.publish(2.5, estimate(TOUCH))
    assert methods.call("contact", []) == pytest.approx(
        [CONTACT, 7, 3, 0.9, 0.4, 0.5, 0.6, 3.0, 0.0, -4.0, 5.0, 0.0, 0.0, 1.0, 0.25]
    )
    assert methods.call("link", []) == pytest.approx([CONTACT, 3, 0.8, 0.1, 0.2, 0.3])
    assert methods.call("wrench", []) == pytest.approx([CONTACT, 3.0, 0.0, -4.0, 0.1, 0.0, 0.3])
    code, contacts, latched, age, t = methods.call("status", [])
    assert (code, contacts, latched, age, t) == (CONTACT, 1, 0, 0.0, 2.5)
    assert methods.call("version", [])[:2] == [CONTACT, INTERFACE]


def test_nothing_touches(hub: Hub, methods: RobotProgramMethods) -> None:
    hub.publish(2.5, estimate())
    assert methods.call("contact", []) == [NONE, 0.0, -1.0, *[0.0] * 12]
    assert methods.call("link", []) == [NONE, -1.0, 0.0, 0.0, 0.0, 0.0]


@pytest.mark.parametrize("touched", [True, False])
def test_answers_keep_their_length(hub: Hub, methods: RobotProgramMethods, touched: bool) -> None:
    unknown = {name: methods.call(name, []) for name in LENGTHS}
    hub.publish(0.0, estimate(TOUCH) if touched else estimate())
    known = {name: methods.call(name, []) for name in LENGTHS}
    for answers in (known, unknown):
        assert {name: len(answer) for name, answer in answers.items()} == LENGTHS
    assert {answer[0] for answer in unknown.values()} == {NO_ESTIMATE}


def test_an_old_estimate_is_none(hub: Hub, methods: RobotProgramMethods) -> None:
    hub.publish(2.5, estimate(TOUCH))
    hub.last_arrival -= 0.2
    assert methods.call("contact", [])[0] == NO_ESTIMATE
    assert methods.call("status", [])[3] == pytest.approx(0.2)


def test_without_a_pipeline_there_is_no_estimate(hub: Hub) -> None:
    methods = RobotProgramMethods(NewestEstimate(hub, lambda: False), Reactions(None, None, lambda _: False))
    hub.publish(2.5, estimate(TOUCH))
    assert methods.call("contact", [])[0] == NO_ESTIMATE
    assert methods.call("expect", [3.0]) == [NOT_POSSIBLE]
    assert methods.call("acknowledge", []) == [NOT_POSSIBLE]


def test_commands(hub: Hub, methods: RobotProgramMethods, sent: list[dict[str, Any]]) -> None:
    hub.publish(0.0, estimate())
    for argument in (3.0, "door"):
        assert methods.call("expect", [argument]) == [NONE]
        assert sent.pop() == {"type": "announce", "name": "door"}
    assert methods.call("expect", [0.0]) == [NONE]
    assert sent.pop() == {"type": "withdraw", "name": None}
    assert methods.call("acknowledge", []) == [NONE]
    assert sent.pop()["type"] == "acknowledge"
    assert methods.call("expect", [4.0]) == [BAD_ARGUMENT]
    assert methods.call("expect", []) == [BAD_ARGUMENT]
    assert methods.call("status", [1.0]) == [BAD_ARGUMENT]
    assert methods.call("unknown", []) == [UNKNOWN_METHOD]
    assert sent == []


@contextmanager
def ports(methods: RobotProgramMethods, **settings: Any) -> Iterator[dict[str, tuple[str, int]]]:
    """Both ports open, in an event loop of their own."""
    servers = RobotProgramServers(
        ControllerSettings.model_validate({"xmlrpc_port": 0, "line_port": 0, **settings}), methods
    )
    loop = asyncio.new_event_loop()
    thread = threading.Thread(target=loop.run_forever)
    thread.start()
    try:
        asyncio.run_coroutine_threadsafe(servers.start(), loop).result(10)
        yield dict(servers.addresses)
    finally:
        asyncio.run_coroutine_threadsafe(servers.stop(), loop).result(10)
        loop.call_soon_threadsafe(loop.stop)
        thread.join()
        loop.close()


def test_a_controller_that_is_switched_off_is_noticed(methods: RobotProgramMethods) -> None:
    """It says nothing, and after sixteen times no program could connect until the next start."""

    async def options() -> tuple[int, int]:
        servers = RobotProgramServers(ControllerSettings.model_validate({"line_port": 0}), methods)
        await servers.start()
        reader, writer = await asyncio.open_connection(*servers.addresses["--line-port"])
        writer.write(b"version\n")
        await reader.readline()
        (connection,) = servers.connections.popitem()[1]
        ours = connection.transport.get_extra_info("socket")
        found = ours.getsockopt(socket.SOL_SOCKET, socket.SO_KEEPALIVE)
        idle = ours.getsockopt(socket.IPPROTO_TCP, socket.TCP_KEEPIDLE) if sys.platform == "linux" else 30
        writer.close()
        await servers.stop()
        return found, idle

    keep_alive, idle = asyncio.run(options())
    assert keep_alive
    assert idle <= 60


def test_pythons_xmlrpc_client(hub: Hub, methods: RobotProgramMethods) -> None:
    hub.publish(2.5, estimate(TOUCH))
    with ports(methods) as places:
        host, port = places["--xmlrpc-port"]
        with xmlrpc.client.ServerProxy(f"http://{host}:{port}/RPC2") as client:
            for _ in range(3):  # over one connection
                assert client.contactsense_contact()[:3] == [CONTACT, 7, 3]
            assert client.contactsense_expect("door") == [CONTACT]
            assert client.contactsense_expect(3) == [CONTACT]
            assert client.contactsense_expect([1, 2]) == [BAD_REQUEST]
            assert client.system.listMethods() == [UNKNOWN_METHOD]


@pytest.mark.parametrize(
    ("call", "expected"),
    [
        (["contactsense_link"], [CONTACT, 3, 0.8, 0.1, 0.2, 0.3]),
        (["contactsense_expect", "3"], [CONTACT]),
        (["contactsense_expect", "4"], [BAD_ARGUMENT]),
        (["contactsense_no_such_method"], [UNKNOWN_METHOD]),
    ],
)
def test_a_client_that_is_not_pythons(
    hub: Hub, methods: RobotProgramMethods, call: list[str], expected: list[float]
) -> None:
    try:
        for name in xmlrpc_c.LIBRARIES:
            ctypes.CDLL(name)
    except OSError as error:
        pytest.skip(f"the C client of XML-RPC is absent (Debian: libxmlrpc-core-c3): {error}")
    hub.publish(2.5, estimate(TOUCH))
    with ports(methods) as places:
        host, port = places["--xmlrpc-port"]
        url = f"http://{host}:{port}/RPC2"
        script = [sys.executable, xmlrpc_c.__file__, url, *call]
        done = subprocess.run(script, capture_output=True, text=True, timeout=60)
    assert done.returncode == 0, done.stderr
    assert [float(line) for line in done.stdout.split()] == pytest.approx(expected)


def test_http_that_is_no_call(methods: RobotProgramMethods) -> None:
    with ports(methods) as places:
        host, port = places["--xmlrpc-port"]
        url = f"http://{host}:{port}"
        assert http.get(f"{url}/RPC2").status_code == 405
        assert http.post(f"{url}/other").status_code == 404
        assert http.post(f"{url}/RPC2", content=b"x" * 70_000).status_code == 413
        (numbers,), _ = xmlrpc.client.loads(http.post(f"{url}/RPC2", content=b"<no/>").content)
        assert numbers == [BAD_REQUEST]


def test_the_line_socket(hub: Hub, methods: RobotProgramMethods) -> None:
    hub.publish(2.5, estimate(TOUCH))
    with ports(methods) as places, socket.create_connection(places["--line-port"], timeout=10) as client:
        stream = client.makefile("rb")
        for piece in (b"con", b"tact\nlink\r\n", b"nonsense\n\xff\n", b"a" * 500 + b"\n\n \r\nexpect 3\n"):
            client.sendall(piece)
            time.sleep(0.02)
        lines = [stream.readline() for _ in range(8)]
        stream.close()
    assert re.fullmatch(rb"\( 1\.000000, 7\.000000, 3\.000000, 0\.900000, .*\)\n", lines[0])
    assert [line.count(b",") + 1 for line in lines] == [15, 6, 1, 1, 1, 1, 1, 1]
    bad = [BAD_REQUEST] * 4  # no ASCII, too long, twice nothing
    assert lines[2:] == [reply([code]) for code in (UNKNOWN_METHOD, *bad, CONTACT)]


def test_the_log_says_what_is_at_which_port(
    methods: RobotProgramMethods, caplog: pytest.LogCaptureFixture
) -> None:
    caplog.set_level("INFO", "contactsense")
    with ports(methods) as places:
        expected = {
            f"robot programs: {kind} at 127.0.0.1:{places[option][1]}"
            for kind, option in (("XML-RPC", "--xmlrpc-port"), ("line socket", "--line-port"))
        }
    assert expected <= {record.getMessage() for record in caplog.records}


def test_connections_are_limited(methods: RobotProgramMethods, caplog: pytest.LogCaptureFixture) -> None:
    with (
        ports(methods, connections=1) as places,
        socket.create_connection(places["--line-port"], timeout=10) as first,
    ):
        first.sendall(b"version\n")
        assert first.recv(100).startswith(b"( ")
        with socket.create_connection(places["--line-port"], timeout=10) as second:
            assert _ended(second)
    assert "connection from 127.0.0.1 is refused: 1 are open already" in caplog.text


def test_strangers_are_refused(methods: RobotProgramMethods, caplog: pytest.LogCaptureFixture) -> None:
    with (
        ports(methods, clients="192.0.2.1") as places,
        socket.create_connection(places["--line-port"], timeout=10) as stranger,
    ):
        assert _ended(stranger)
    assert "connection from 127.0.0.1 is refused: it is not one of --controller-clients" in caplog.text


def test_a_client_that_takes_no_answers_is_dropped(
    methods: RobotProgramMethods, caplog: pytest.LogCaptureFixture
) -> None:
    def flood(client: socket.socket) -> None:
        for _ in range(10_000):
            client.sendall(b"contact\n" * 1000)

    with (
        ports(methods) as places,
        socket.create_connection(places["--line-port"], timeout=10) as client,
        pytest.raises((BrokenPipeError, ConnectionResetError)),
    ):
        flood(client)
    assert "a robot program does not read its answers: its connection is closed" in caplog.text


@pytest.mark.parametrize(
    ("values", "complaint"),
    [
        ({"host": "0.0.0.0", "line_port": 0}, r"expected the addresses of the robots .*--controller-clients"),
        ({"host": "robot"}, r"(?s)host.*expected an IP address, got 'robot'"),
        ({"clients": "127.0.0.1,x"}, r"(?s)clients.*expected an IP address, got 'x'"),
        ({"source": "file"}, "source"),
        ({"line_port": 70_000}, "line_port"),
    ],
)
def test_settings_that_cannot_be_used(values: dict[str, Any], complaint: str) -> None:
    with pytest.raises(ValidationError, match=complaint):
        ControllerSettings.model_validate(values)


def test_a_port_that_is_taken(methods: RobotProgramMethods) -> None:
    why = r"^--line-port: cannot listen at 127\.0\.0\.1:\d+: Address already in use$"
    with socket.create_server(("127.0.0.1", 0)) as taken:
        settings = ControllerSettings(line_port=taken.getsockname()[1])
        with pytest.raises(PortError, match=why):
            RobotProgramServers(settings, methods).check()
        port = taken.getsockname()[1]
    both = ControllerSettings(xmlrpc_port=port, line_port=port)
    with pytest.raises(PortError, match=why):
        RobotProgramServers(both, methods).check()


def test_the_services_own_port_answers_too() -> None:
    with serving(create_app(Settings())) as place:
        with xmlrpc.client.ServerProxy(f"http://{place}/RPC2") as client:
            assert client.contactsense_status()[0] == NO_ESTIMATE
            assert client.contactsense_acknowledge() == [NOT_POSSIBLE]
        assert http.post(f"http://{place}/RPC2", content=b"x" * 70_000).status_code == 413


def _ended(connection: socket.socket) -> bool:
    try:
        return connection.recv(100) == b""
    except ConnectionResetError:
        return True
