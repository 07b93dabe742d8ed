"""Each action against a scripted peer."""

import base64
import http.server
import json
import os
import socket
import sys
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import pytest

from contactsense.service.reactions.actions.base import ActionError
from contactsense.service.reactions.actions.command import CommandAction
from contactsense.service.reactions.actions.dashboard import DashboardAction
from contactsense.service.reactions.actions.polyscope_x import PolyscopeXAction
from contactsense.service.reactions.actions.registers import RegistersAction
from contactsense.service.reactions.actions.stop_program import StopProgramAction
from contactsense.service.reactions.actions.ur_rtde_stop import UrRtdeStopAction
from contactsense.service.reactions.actions.webhook import decode_secret, sign
from contactsense.service.reactions.decision import Decision
from contactsense.service.reactions.executor_client import ExecutorClient
from tests.service.loopback import until

HOST = "127.0.0.1"
DECISION = Decision(
    "arm", "collision", "begin", ("stop",), 1.5, 0.97, 4, "forearm", 3, (0.1, 0.0, 0.0), (0.5, 0.0, 0.4),
    (0.0, -60.0, 0.0), 60.0,
)  # fmt: skip
TOLD = DECISION.as_dict()


@contextmanager
def line_server(greeting: bytes, answers: bytes | None) -> Iterator[tuple[int, list[bytes]]]:
    """A TCP server that greets, notes what comes, and answers the first bytes; None: never."""
    listener = socket.create_server((HOST, 0))
    heard: list[bytes] = []

    def serve() -> None:
        try:
            connection, _ = listener.accept()
        except OSError:
            return
        with connection:
            connection.sendall(greeting)
            while chunk := connection.recv(4096):
                heard.append(chunk)
                if answers is not None:
                    connection.sendall(answers)

    thread = threading.Thread(target=serve, daemon=True)
    thread.start()
    try:
        yield listener.getsockname()[1], heard
    finally:
        listener.shutdown(socket.SHUT_RDWR)
        listener.close()
        thread.join(5.0)


def test_a_stop_program() -> None:
    with line_server(b"", None) as (port, heard):
        action = StopProgramAction(type="stop_program", deceleration=4.0, port=port)
        action.perform(TOLD, HOST)
        assert until(lambda: b"".join(heard) == b"def contactsense_stop():\n  stopj(4)\nend\n")


@pytest.mark.parametrize(
    ("command", "line"), [("pause", b"pause\n"), ("stop", b"stop\n"), ("popup", b"popup 60 N on forearm\n")]
)
def test_dashboard_commands(command: Any, line: bytes) -> None:
    with line_server(b"Connected: Universal Robots Dashboard Server\n", b"Pausing program\n") as (
        port,
        heard,
    ):
        action = DashboardAction(type="dashboard", command=command, text="{force} N on {link}", port=port)
        assert action.perform(TOLD, HOST) == "Pausing program"
        assert heard == [line]


def test_a_line_break_in_a_name_begins_no_other_command() -> None:
    told = {**TOLD, "rule": "arm\nplay", "link": "grip\r\nunlock protective stop"}
    with line_server(b"Connected\n", b"showing popup\n") as (port, heard):
        DashboardAction(type="dashboard", command="popup", port=port).perform(told, HOST)
        assert len(heard) == 1
        assert heard[0].count(b"\n") == 1
        assert heard[0].startswith(b"popup arm play: ")


@pytest.mark.parametrize("answer", [b"Failed to execute: pause\n", b"could not understand: 'pause'\n"])
def test_a_dashboard_that_refuses(answer: bytes) -> None:
    with (
        line_server(b"Connected\n", answer) as (port, _),
        pytest.raises(ActionError, match=r"answered .* to 'pause'"),
    ):
        DashboardAction(type="dashboard", command="pause", port=port).perform(TOLD, HOST)


def test_a_dashboard_that_is_mute() -> None:
    with line_server(b"Connected\n", None) as (port, _), pytest.raises(ActionError, match=r"within 0\.2 s"):
        DashboardAction(type="dashboard", command="stop", port=port, timeout=0.2).perform(TOLD, HOST)


def test_nobody_there() -> None:
    with socket.create_server((HOST, 0)) as taken:
        port = taken.getsockname()[1]
    with pytest.raises(ActionError, match="Connection refused"):
        StopProgramAction(type="stop_program", port=port).perform(TOLD, HOST)


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
def test_polyscope_x(status: int) -> None:
    heard: list[tuple[str, bytes]] = []
    handler = type("Handler", (_Rest,), {"status": status, "heard": heard})
    with http.server.HTTPServer((HOST, 0), handler) as server:
        thread = threading.Thread(target=server.handle_request)
        thread.start()
        action = PolyscopeXAction(type="polyscope_x", action="stop", port=server.server_port)
        if status == 200:
            action.perform(TOLD, HOST)
        else:
            with pytest.raises(ActionError, match="answered 403"):
                action.perform(TOLD, HOST)
        thread.join(5.0)
    assert [(path, json.loads(body)) for path, body in heard] == [
        ("/universal-robots/robot-api/program/v1/state", {"action": "stop"})
    ]


def test_a_command_gets_the_decision(tmp_path: Path) -> None:
    out = tmp_path / "out"
    script = f"import sys; open({str(out)!r}, 'w').write(sys.stdin.read())"
    CommandAction(type="command", command=(sys.executable, "-c", script)).perform(TOLD, HOST)
    assert json.loads(out.read_text())["link"] == "forearm"


@pytest.mark.parametrize(
    ("script", "complaint"),
    [
        ("import sys; sys.exit('no such thing')", "exit status 1: no such thing"),
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
    with pytest.raises(ActionError, match="/no/such/program: No such file"):
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
    assert action.values(None, 0.0, False, True)[0] == 0


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
    action = UrRtdeStopAction(type="ur_rtde_stop", timeout=1.0 if mood == "hang" else 3.0)
    try:
        if not complaint:
            assert action.perform(TOLD, HOST) == "stopJ is done"
            assert action.perform(TOLD, HOST) == "stopJ is done"
        else:
            with pytest.raises(ActionError, match=complaint):
                action.perform(TOLD, HOST)
    finally:
        action.close()


def test_the_signature_is_that_of_standard_webhooks() -> None:
    """The example of the specification's own libraries."""
    key = decode_secret("whsec_MfKQ9r8GKYqrTwjUPD8ILPZIo2LaLaSw")
    signature = sign(key, "msg_p5jXN8AQM9LWM0D4loKWxJek", 1614265330, b'{"test": 2432232314}')
    assert signature == "v1,g0hM9SsE+OTPJTGt/tmIKtSyZlE3uFJELVlNIOLJ1OE="


def test_a_secret_has_a_length() -> None:
    with pytest.raises(ValueError, match="24 to 64 bytes"):
        decode_secret("whsec_" + base64.b64encode(b"short").decode())


def results_of(client: ExecutorClient, count: int, timeout: float = 20.0) -> list[dict[str, Any]]:
    results: list[dict[str, Any]] = []

    def enough() -> bool:
        results.extend(client.poll(time.monotonic()))
        return len(results) >= count

    assert until(enough, timeout), results
    return results


def test_an_action_that_hangs_holds_up_no_other() -> None:
    slow = CommandAction(type="command", command=("sleep", "60"), timeout=1.5)
    quick = CommandAction(type="command", command=("true",))
    client = ExecutorClient({"slow": slow, "quick": quick}, HOST)
    try:
        client.start("quick", TOLD, time.monotonic())
        results_of(client, 1)  # it has started
        now = time.monotonic()
        assert client.start("slow", TOLD, now) == ""
        assert client.start("quick", TOLD, now) == ""
        first, second = results_of(client, 2)
        assert (first["action"], first["ok"]) == ("quick", True)
        assert (second["action"], second["ok"], "killed" in second["reason"]) == ("slow", False, True)
    finally:
        client.close()


def test_an_executor_that_dies_is_told_and_started_again() -> None:
    client = ExecutorClient({"a": CommandAction(type="command", command=("sleep", "60"))}, HOST)
    try:
        client.start("a", TOLD, time.monotonic())
        pid = client.pid
        assert pid is not None
        os.kill(pid, 9)
        (result,) = results_of(client, 1)
        assert (result["ok"], result["reason"]) == (False, "the executor's process died")

        def again() -> bool:
            client.poll(time.monotonic())
            return client.pid not in (None, pid)

        assert until(again)
    finally:
        client.close()


def test_an_executor_that_hangs_is_told() -> None:
    client = ExecutorClient({"a": CommandAction(type="command", command=("true",), timeout=0.1)}, HOST)
    try:
        pid = client.pid
        assert pid is not None
        os.kill(pid, 19)  # SIGSTOP
        begin = time.monotonic()
        client.start("a", TOLD, begin)
        (result,) = results_of(client, 1)
        assert "hangs: no result after 1.1 s" in result["reason"]
    finally:
        client.close()


class ScriptedExecutor:
    """In place of the executor's process: it reports what a test says."""

    started = 0

    def __init__(self, *_: object, **__: object) -> None:
        type(self).started += 1
        read, self._write = os.pipe()
        self.stdin, self.stdout = (
            os.fdopen(os.open(os.devnull, os.O_WRONLY), "wb", 0),
            os.fdopen(read, "rb", 0),
        )

    def report(self, task: str, ok: bool = True) -> None:
        result = {"action": "a", "ok": ok, "reason": "", "took": 0.0, "task": task}
        os.write(self._write, json.dumps(result).encode() + b"\n")

    def kill(self) -> None:
        if self._write >= 0:
            os.close(self._write)
        self._write = -1

    def wait(self) -> None:
        pass


@pytest.fixture
def scripted(monkeypatch: pytest.MonkeyPatch) -> Iterator[tuple[ExecutorClient, ScriptedExecutor]]:
    """A client of one action with a limit of 2 s, one of which is grace."""
    monkeypatch.setattr("contactsense.service.reactions.executor_client.subprocess.Popen", ScriptedExecutor)
    client = ExecutorClient({"a": CommandAction(type="command", command=("true",), timeout=1.0)}, HOST)
    process: Any = client._process
    try:
        yield client, process
    finally:
        client.close()


@pytest.mark.parametrize("task", ["newest", "none"])
def test_what_is_reported_of_another_decision_ends_no_waiting(
    scripted: tuple[ExecutorClient, ScriptedExecutor], task: str
) -> None:
    """One that was skipped, or a preparation that failed: the decision that hangs hangs all the same."""
    client, process = scripted
    client.start("a", TOLD, 0.0)
    if task == "newest":
        client.start("a", TOLD, 1.9)
    process.report(task, False)
    assert [result["task"] for result in client.poll(1.95)] == [task]
    (late,) = client.poll(2.1)
    assert late["reason"] == "hangs: no result after 2 s"
    assert late["took"] == pytest.approx(2.1)
    process.report(task, False)
    assert len(client.poll(2.2)) == 1  # it is not reported twice


def test_a_decision_that_has_waited_for_another_does_not_hang(
    scripted: tuple[ExecutorClient, ScriptedExecutor],
) -> None:
    client, process = scripted
    client.start("a", TOLD, 0.0)
    client.start("a", TOLD, 0.0)
    process.report("oldest")
    assert len(client.poll(1.9)) == 1
    assert client.poll(3.8) == []
    (late,) = client.poll(4.0)
    assert "hangs" in late["reason"]


def test_an_executor_that_keeps_dying_is_started_once_a_second(
    scripted: tuple[ExecutorClient, ScriptedExecutor],
) -> None:
    client, process = scripted
    now, before = time.monotonic(), ScriptedExecutor.started
    process.kill()
    for later in (0.1, 0.5, 0.9):
        client.poll(now + later)
    assert ScriptedExecutor.started == before
    client.poll(now + 1.1)
    client.poll(now + 1.2)
    assert ScriptedExecutor.started == before + 1
