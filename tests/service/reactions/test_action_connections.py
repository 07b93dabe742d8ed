"""Where actions connect to, and what becomes of those whose peer is slow, silent or not there."""

import http.server
import socket
import threading
from contextlib import nullcontext
from typing import Any

import pytest
from pydantic import ValidationError

from contactsense.service.reactions.actions import base, polyscope_x
from contactsense.service.reactions.actions.base import ActionError
from contactsense.service.reactions.actions.dashboard import DashboardAction
from contactsense.service.reactions.actions.http_request import request
from contactsense.service.reactions.actions.polyscope_x import PolyscopeXAction
from contactsense.service.reactions.actions.stop_program import StopProgramAction
from contactsense.service.reactions.actions.time_limit import TimeLimit
from tests.service.loopback import until
from tests.service.reactions.peers import HOST, TOLD, dripping, line_server

STOP = DashboardAction(type="dashboard", command="stop")


def test_a_dashboard_that_is_mute() -> None:
    with line_server(b"Connected\n", None) as (port, _), pytest.raises(ActionError, match=r"within 0\.2 s"):
        DashboardAction(type="dashboard", command="stop", port=port, timeout=0.2).perform(TOLD, HOST)


def test_nothing_is_sent_after_the_time_limit(monkeypatch: pytest.MonkeyPatch) -> None:
    """Looking up a name takes as long as the resolver wants; a robot that is stopped later than told, or a
    program that is replaced by then, surprises people."""
    look_up = socket.getaddrinfo

    def late(*args: Any) -> Any:
        assert until(lambda: all(limit.expired for limit in limits))
        return look_up(*args)

    limits: list[TimeLimit] = []
    enter = TimeLimit.__enter__
    monkeypatch.setattr(TimeLimit, "__enter__", lambda limit: limits.append(limit) or enter(limit))
    monkeypatch.setattr(socket, "getaddrinfo", late)
    with line_server(b"", None) as (port, heard):
        action = StopProgramAction(type="stop_program", port=port, timeout=0.1)
        with pytest.raises(ActionError, match=r"no answer within 0\.1 s"):
            action.perform(TOLD, HOST)
    assert limits
    assert heard == []


def test_nobody_there() -> None:
    with socket.create_server((HOST, 0)) as taken:
        port = taken.getsockname()[1]
    with pytest.raises(ActionError, match="Connection refused"):
        StopProgramAction(type="stop_program", port=port).perform(TOLD, HOST)


@pytest.mark.parametrize(
    ("action", "line"),
    [
        (DashboardAction(type="dashboard", command="stop", timeout=0.2), b"Connected"),
        (DashboardAction(type="dashboard", command="stop", timeout=0.2), b"\n" + 50 * b"S"),
        (PolyscopeXAction(type="polyscope_x", timeout=0.2), b"HTTP/1.1 200 OK\r\nX: x"),
    ],
)
def test_the_time_limit_is_for_the_whole_answer(action: Any, line: bytes) -> None:
    """A peer that sends a byte now and then would keep the action from every later decision."""
    with dripping(line) as port, pytest.raises(ActionError, match=r"no answer within 0\.2 s"):
        action.model_copy(update={"port": port}).perform(TOLD, HOST)


@pytest.mark.parametrize("status", [b"200 OK", b"410 Gone"])
def test_a_head_that_does_not_end_in_time_is_no_answer(status: bytes) -> None:
    """Nothing is delivered, nor is a webhook disabled, by what was cut off."""
    with (
        dripping(b"X: x\r\n", b"HTTP/1.1 " + status + b"\r\n") as port,
        pytest.raises(ActionError, match=r"no answer within 0\.2 s"),
    ):
        request(f"http://{HOST}:{port}/hook", "POST", b"", {}, 0.2)


def test_a_slow_answer_within_the_time_limit_is_taken() -> None:
    with dripping(b"Connected\nStopped\n") as port:
        action = STOP.model_copy(update={"port": port, "timeout": 60.0})
        assert action.perform(TOLD, HOST) == "Stopped"


def test_nothing_watches_a_connection_that_has_ended() -> None:
    with line_server(b"Connected\n", b"Stopped\n") as (port, _):
        STOP.model_copy(update={"port": port, "timeout": 60.0}).perform(TOLD, HOST)
    assert until(lambda: all(thread.name != "time limit" for thread in threading.enumerate()))


def test_a_server_that_hangs_up_is_told() -> None:
    with socket.create_server((HOST, 0)) as server:

        def hang_up() -> None:
            server.accept()[0].close()

        threading.Thread(target=hang_up, daemon=True).start()
        port = server.getsockname()[1]
        with pytest.raises(ActionError) as told:
            STOP.model_copy(update={"port": port, "timeout": 60.0}).perform(TOLD, HOST)
    assert str(told.value) == f"{HOST}:{port}: expected a greeting, the server hung up"


def test_what_a_server_says_is_one_line_without_control_characters() -> None:
    assert str(ActionError("no:\n\x1b[31mRobot is in\tlocal control")) == "no: ?[31mRobot is in local control"


@pytest.mark.parametrize(
    ("action", "port"),
    [
        (STOP, 29999),
        (StopProgramAction(type="stop_program"), 30002),
        (StopProgramAction(type="stop_program", interface="primary"), 30001),
        (StopProgramAction(type="stop_program", interface="realtime"), 30003),
    ],
)
def test_ports_are_those_of_universal_robots(action: Any, port: int, monkeypatch: pytest.MonkeyPatch) -> None:
    """As their support pages list them, "Overview of client interfaces" and "Dashboard server"."""
    asked: list[tuple[str, int]] = []

    def refuse(address: tuple[str, int], _: float) -> None:
        asked.append(address)
        raise ConnectionRefusedError

    monkeypatch.setattr(base.socket, "create_connection", refuse)
    with pytest.raises(ActionError):
        action.perform(TOLD, HOST)
    assert asked == [(HOST, port)]


def test_the_interface_of_polyscope_x_is_at_the_port_of_http(monkeypatch: pytest.MonkeyPatch) -> None:
    asked: list[str] = []
    monkeypatch.setattr(polyscope_x, "request", lambda url, *_, **__: asked.append(url) or 200)
    PolyscopeXAction(type="polyscope_x").perform(TOLD, HOST)
    assert asked == [f"http://{HOST}:80/universal-robots/robot-api/program/v1/state"]


@pytest.mark.parametrize(("port", "there"), [(0, False), (1, True), (65535, True), (65536, False)])
@pytest.mark.parametrize(
    ("kind", "fields"),
    [
        (DashboardAction, {"type": "dashboard", "command": "stop"}),
        (StopProgramAction, {"type": "stop_program"}),
    ],
)
def test_a_port_that_there_is_not_is_refused(kind: Any, fields: Any, port: int, there: bool) -> None:
    with nullcontext() if there else pytest.raises(ValidationError, match="port"):
        assert kind.model_validate({**fields, "port": port}).port == port


def test_a_request_goes_through_the_proxy_of_the_environment(monkeypatch: pytest.MonkeyPatch) -> None:
    """As a webhook out of the network of a company must."""
    heard: list[str] = []

    class Proxy(http.server.BaseHTTPRequestHandler):
        def do_POST(self) -> None:
            heard.append(self.path)
            self.send_response(204)
            self.end_headers()

        def log_message(self, *_: object) -> None:
            pass

    monkeypatch.delenv("no_proxy", raising=False)
    with http.server.HTTPServer((HOST, 0), Proxy) as server:
        monkeypatch.setenv("http_proxy", f"http://{HOST}:{server.server_port}")
        thread = threading.Thread(target=server.handle_request, daemon=True)
        thread.start()
        assert request("http://contacts.invalid/hook", "POST", b"", {}, 60.0) == 204
        thread.join(5.0)
    assert heard == ["http://contacts.invalid/hook"]


def test_an_address_with_other_letters_is_told() -> None:
    with pytest.raises(ActionError, match="ordinal not in range"):
        request(f"http://{HOST}:1/t\u00fcr", "POST", b"", {}, 60.0)


def test_a_connection_that_is_not_open_yet_does_not_keep_another_from_being_ended() -> None:
    ours, theirs = socket.socketpair()
    with ours, theirs, TimeLimit(0.01, lambda: [None, ours]) as limit:
        ours.settimeout(20.0)
        assert ours.recv(1) == b""
        assert limit.expired
