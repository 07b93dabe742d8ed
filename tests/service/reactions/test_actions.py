"""Each action against a scripted peer."""

import base64
import contextlib
import http.client
import http.server
import json
import os
import signal
import socket
import sys
import threading
import time
import urllib.error
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from contactsense.service.reactions.actions import ur_rtde_stop
from contactsense.service.reactions.actions.base import ActionError
from contactsense.service.reactions.actions.command import CommandAction
from contactsense.service.reactions.actions.dashboard import DashboardAction
from contactsense.service.reactions.actions.http_request import no_answer
from contactsense.service.reactions.actions.polyscope_x import PolyscopeXAction
from contactsense.service.reactions.actions.registers import RegistersAction
from contactsense.service.reactions.actions.stop_program import StopProgramAction
from contactsense.service.reactions.actions.ur_rtde_stop import UrRtdeStopAction
from contactsense.service.reactions.actions.webhook import WebhookAction, decode_secret, sign
from tests.service.loopback import until
from tests.service.reactions.peers import DECISION, HOST, TOLD, line_server


def test_a_stop_program() -> None:
    with line_server(b"", None) as (port, heard):
        action = StopProgramAction(type="stop_program", deceleration=4.0, port=port)
        assert action.perform(TOLD, HOST) == f"sent to {HOST}:{port}"
        assert until(lambda: b"".join(heard) == b"def contactsense_stop():\n  stopj(4)\nend\n")


@pytest.mark.parametrize(
    ("action", "words"),
    [
        (DashboardAction(type="dashboard", command="pause"), "dashboard: pause"),
        (PolyscopeXAction(type="polyscope_x", action="stop"), "PolyScope X: stop the program"),
        (
            RegistersAction(
                type="registers", force=None, contact=None, collision=None, degraded=None, period=0.05
            ),
            "write input_int_register_47, input_bit_register_64 (heartbeat every 50 ms)",
        ),
        (
            StopProgramAction(type="stop_program", interface="realtime"),
            "replace the robot's program by stopj(8), sent to port 30003",
        ),
        (UrRtdeStopAction(type="ur_rtde_stop", deceleration=0.5), "ur_rtde: stopJ(0.5)"),
        (
            WebhookAction(type="webhook", url="http://h/", secret_file=Path("key")),
            "post to http://h/, with retries",
        ),
    ],
)
def test_an_action_in_words(action: Any, words: str) -> None:
    assert action.describe() == words


@pytest.mark.parametrize(
    ("command", "line", "answer"),
    [
        ("pause", b"pause\n", "Pausing program"),
        ("stop", b"stop\n", "Stopped"),
        ("popup", b"popup 60 N on forearm\n", "showing popup"),
    ],
)
def test_dashboard_commands(command: Any, line: bytes, answer: str) -> None:
    with line_server(b"Connected: Universal Robots Dashboard Server\n", answer.encode() + b"\n") as (
        port,
        heard,
    ):
        action = DashboardAction(type="dashboard", command=command, text="{force} N on {link}", port=port)
        assert action.perform(TOLD, HOST) == answer
        assert heard == [line]


def test_a_line_break_in_a_name_begins_no_other_command() -> None:
    told = {**TOLD, "rule": "arm\nplay", "link": "grip\r\nunlock protective stop"}
    with line_server(b"Connected\n", b"showing popup\n") as (port, heard):
        DashboardAction(type="dashboard", command="popup", port=port).perform(told, HOST)
        assert len(heard) == 1
        assert heard[0].count(b"\n") == 1
        assert heard[0].startswith(b"popup arm play: ")


@pytest.mark.parametrize(
    "answer",
    [
        b"Failed to execute: pause\n",
        b"could not understand: 'pause'\n",
        b"Invalid SSH identification string.\n",
        b"\x00\xff\n",
    ],
)
def test_a_dashboard_that_refuses(answer: bytes) -> None:
    with (
        line_server(b"Connected\n", answer) as (port, _),
        pytest.raises(ActionError, match=r"answered .* to 'pause'"),
    ):
        DashboardAction(type="dashboard", command="pause", port=port).perform(TOLD, HOST)


class _Rest(http.server.BaseHTTPRequestHandler):
    status = 200
    heard: list[tuple[str, bytes]]

    def do_PUT(self) -> None:
        body = self.rfile.read(int(self.headers["Content-Length"]))
        self.heard.append((self.path, body))
        self.send_response(self.status)
        self.end_headers()

    def log_message(self, *_: object) -> None:
        pass


@pytest.mark.parametrize("status", [200, 403])
def test_polyscope_x(status: int, monkeypatch: pytest.MonkeyPatch) -> None:
    """It is on the robot's network, to which the proxy of a company leads nowhere."""
    monkeypatch.setenv("http_proxy", f"http://{HOST}:1")
    monkeypatch.delenv("no_proxy", raising=False)
    heard: list[tuple[str, bytes]] = []
    handler = type("Handler", (_Rest,), {"status": status, "heard": heard})
    with http.server.HTTPServer((HOST, 0), handler) as server:
        thread = threading.Thread(target=server.handle_request, daemon=True)
        thread.start()
        action = PolyscopeXAction(type="polyscope_x", action="stop", port=server.server_port)
        if status == 200:
            assert action.perform(TOLD, HOST) == "answered 200"
        else:
            with pytest.raises(ActionError, match="answered 403"):
                action.perform(TOLD, HOST)
        thread.join(5.0)
    assert [(path, json.loads(body)) for path, body in heard] == [
        ("/universal-robots/robot-api/program/v1/state", {"action": "stop"})
    ]


def test_a_request_without_answer_is_told_like_a_connection_without_one() -> None:
    """In words instead of numbers of the system, and with the time limit."""
    where = f"{HOST}:{{}}/universal-robots/robot-api/program/v1/state: {{}}"
    with socket.create_server((HOST, 0)) as silent:
        port = silent.getsockname()[1]
        with pytest.raises(ActionError) as told:
            PolyscopeXAction(type="polyscope_x", port=port, timeout=0.1).perform(TOLD, HOST)
        assert str(told.value) == where.format(port, "no answer within 0.1 s")
    with pytest.raises(ActionError) as told:
        PolyscopeXAction(type="polyscope_x", port=port).perform(TOLD, HOST)
    assert str(told.value) == where.format(port, "Connection refused")
    assert no_answer(urllib.error.URLError(TimeoutError("timed out")), 20.0) == "no answer within 20 s"
    assert no_answer(http.client.BadStatusLine("SSH-2.0"), 20.0) == "expected HTTP, got SSH-2.0"


def test_a_command_gets_the_decision(tmp_path: Path) -> None:
    out = tmp_path / "out"
    script = f"import sys; open({str(out)!r}, 'w').write(sys.stdin.read())"
    CommandAction(type="command", command=(sys.executable, "-c", script)).perform(TOLD, HOST)
    assert json.loads(out.read_text())["link"] == "forearm"


@pytest.mark.parametrize(("redirection", "is_over"), [("2> /dev/null", True), ("", False)])
def test_a_program_is_over_once_nobody_can_write_to_its_standard_error(
    redirection: str, is_over: bool
) -> None:
    """What it leaves in the background, too."""
    command = ("/bin/sh", "-c", f"sleep 5 {redirection} &")
    action = CommandAction(type="command", command=command, timeout=0.5)
    with contextlib.nullcontext() if is_over else pytest.raises(ActionError, match="killed after"):
        action.perform(TOLD, HOST)


@pytest.mark.parametrize(
    ("script", "complaint"),
    [
        (
            "import sys; sys.stderr.write('a warning\\n'); sys.exit('no such thing')",
            "status 1: no such thing",
        ),
        ("raise SystemExit(3)", "exit status 3: it printed nothing"),
        ("import time; time.sleep(60)", "killed after 0.5 s"),
    ],
)
def test_a_command_that_fails(script: str, complaint: str) -> None:
    action = CommandAction(type="command", command=(sys.executable, "-c", script), timeout=0.5)
    if "exit" in script:
        action = action.model_copy(update={"timeout": 10.0})
    begin = time.monotonic()
    with pytest.raises(ActionError, match=complaint):
        action.perform(TOLD, HOST)
    assert time.monotonic() - begin < 30.0


def test_a_command_that_is_not_there() -> None:
    with pytest.raises(ActionError, match=r"^/no/such/program: expected a program that can be run"):
        CommandAction(type="command", command=("/no/such/program",)).perform(TOLD, HOST)


def test_registers() -> None:
    action = RegistersAction(type="registers", link=40, point=(44, 45, 46), time=43)
    named = dict(zip(action.names, action.values(DECISION, 1.5, True, False), strict=True))
    assert named == {
        "input_int_register_47": 42,  # collision on link 3
        "input_double_register_47": 60.0,
        "input_int_register_40": 3,
        "input_double_register_44": 0.5,
        "input_double_register_45": 0.0,
        "input_double_register_46": 0.4,
        "input_double_register_43": 1.5,
        "input_bit_register_64": True,
        "input_bit_register_65": True,
        "input_bit_register_66": True,
        "input_bit_register_67": False,
    }
    assert action.values(None, 2.5, False, True) == (
        0,
        0.0,
        -1,
        0.0,
        0.0,
        0.0,
        2.5,
        False,
        False,
        False,
        True,
    )
    # A contact that no single push explains: it is on no link.
    unexplained = replace(DECISION, level="contact", link_index=-1, point_base=())
    assert action.values(unexplained, 2.5, False, False) == (
        *(1, 60.0, -1, 0.0, 0.0, 0.0, 2.5), *(False, True, False, False)
    )  # fmt: skip


@pytest.mark.parametrize(
    ("left_out", "kinds"),
    [
        ("force", {"double_register_47"}),
        ("link", {"int_register_40"}),
        ("point", {f"double_register_{i}" for i in (44, 45, 46)}),
        ("time", {"double_register_43"}),
        *((bit, {f"bit_register_{64 + i}"}) for i, bit in enumerate(["heartbeat", "contact", "collision"])),
        ("degraded", {"bit_register_67"}),
    ],
)
def test_a_register_that_is_left_out_changes_no_other(left_out: str, kinds: set[str]) -> None:
    fields: dict[str, Any] = {"type": "registers", "link": 40, "point": (44, 45, 46), "time": 43}
    every, some = (
        dict(zip(action.names, action.values(DECISION, 1.5, True, False), strict=True))
        for action in map(RegistersAction.model_validate, (fields, {**fields, left_out: None}))
    )
    assert some == {name: value for name, value in every.items() if name.removeprefix("input_") not in kinds}


FAKE_UR_RTDE = """
import os, sys, time
class RTDEControlInterface:
    def __init__(self, host, frequency):
        if os.environ["FAKE"] == "refuse":
            raise RuntimeError("no robot here")
    def stopJ(self, deceleration):
        if os.environ["FAKE"] == "abort":
            os.abort()
        if os.environ["FAKE"] == "hang":
            time.sleep(60)
"""


@pytest.mark.parametrize(
    ("mood", "complaint"),
    [("", ""), ("refuse", "no robot here"), ("abort", "has died"), ("hang", "not stopped within 1 s")],
)
def test_ur_rtde_in_a_child(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, mood: str, complaint: str
) -> None:
    (tmp_path / "rtde_control.py").write_text(FAKE_UR_RTDE)
    monkeypatch.setenv("FAKE", mood)
    monkeypatch.setenv("PYTHONPATH", os.pathsep.join([str(tmp_path), *sys.path]))
    action = UrRtdeStopAction(type="ur_rtde_stop", timeout=60.0)
    try:
        if mood == "hang":  # the limit is for the stop, not for a child that starts slowly
            action.prepare(HOST)
            action = action.model_copy(update={"timeout": 1.0})
        if not complaint:
            assert action.perform(TOLD, HOST) == "stopJ is done"
            assert action.perform(TOLD, HOST) == "stopJ is done"
        else:
            with pytest.raises(ActionError, match=complaint):
                action.perform(TOLD, HOST)
            assert action._child is None  # a late answer would be taken for that to the next decision
    finally:
        action.close()


def test_ur_rtde_keeps_its_child_until_it_dies(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A new one takes a second to connect, during which the arm moves on."""
    (tmp_path / "rtde_control.py").write_text(FAKE_UR_RTDE)
    monkeypatch.setenv("FAKE", "")
    monkeypatch.setenv("PYTHONPATH", os.pathsep.join([str(tmp_path), *sys.path]))
    action = UrRtdeStopAction(type="ur_rtde_stop", timeout=60.0)
    try:
        action.prepare(HOST)
        child = action._child
        assert child is not None
        action.perform(TOLD, HOST)
        assert action._child is child
        child.kill()
        child.wait()
        assert action.perform(TOLD, HOST) == "stopJ is done"
        assert action._child is not child
    finally:
        action.close()


def test_ur_rtde_disconnects_before_its_child_ends(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Without being killed: the robot is told. A second close has nothing to do."""
    told = tmp_path / "told"
    (tmp_path / "rtde_control.py").write_text(
        FAKE_UR_RTDE + f"    def __del__(self):\n        open({str(told)!r}, 'w').close()\n"
    )
    monkeypatch.setenv("FAKE", "")
    monkeypatch.setenv("PYTHONPATH", os.pathsep.join([str(tmp_path), *sys.path]))
    monkeypatch.setattr(ur_rtde_stop, "_END", 30.0)  # a busy computer ends a process slowly
    action = UrRtdeStopAction(type="ur_rtde_stop", timeout=60.0)
    action.prepare(HOST)
    assert not told.exists()
    child = action._child
    assert child is not None
    assert child.poll() is None
    action.close()
    assert child.returncode == 0
    assert told.exists()
    action.close()


def test_ur_rtde_that_does_not_end_is_killed(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "rtde_control.py").write_text(
        FAKE_UR_RTDE + "    def __del__(self):\n        time.sleep(60)\n"
    )
    monkeypatch.setenv("FAKE", "")
    monkeypatch.setenv("PYTHONPATH", os.pathsep.join([str(tmp_path), *sys.path]))
    action = UrRtdeStopAction(type="ur_rtde_stop", timeout=60.0)
    action.prepare(HOST)
    child = action._child
    assert child is not None
    action.close()
    assert child.returncode == -signal.SIGKILL


def test_the_signature_is_that_of_standard_webhooks() -> None:
    """The example of the specification's own libraries."""
    key = decode_secret("whsec_MfKQ9r8GKYqrTwjUPD8ILPZIo2LaLaSw")
    signature = sign(key, "msg_p5jXN8AQM9LWM0D4loKWxJek", 1614265330, b'{"test": 2432232314}')
    assert signature == "v1,g0hM9SsE+OTPJTGt/tmIKtSyZlE3uFJELVlNIOLJ1OE="


@pytest.mark.parametrize(
    "secret",
    [
        f"whsec_{31 * 'A'}\u00e4",
        f"whsec_{32 * 'A'}!",
        32 * "A",
        *(f"whsec_{base64.b64encode(bytes(length)).decode()}" for length in (23, 65)),
    ],
)
def test_what_is_no_secret_is_refused_by_its_field(tmp_path: Path, secret: str) -> None:
    told = "secret: expected whsec_ and 24 to 64 bytes in base64, got something else"
    with pytest.raises(ValueError, match=told):
        decode_secret(secret)
    (tmp_path / "key").write_text(f"{secret}\n", encoding="utf-8")
    webhook = WebhookAction(type="webhook", url="http://h/", secret_file=tmp_path / "key")
    assert webhook.missing() == f"secret_file: {tmp_path}/key: {told}"


@pytest.mark.parametrize("length", [24, 64])
def test_a_secret_may_have_a_line_break_behind_it(tmp_path: Path, length: int) -> None:
    """As editors write it into a file."""
    key = bytes(range(length))
    (tmp_path / "key").write_text(f"whsec_{base64.b64encode(key).decode()}\n")
    assert WebhookAction(type="webhook", url="http://h/", secret_file=tmp_path / "key").key() == key
