"""The commands as their users run them, in processes of their own."""

import os
import signal
import socket
import subprocess
import sys
import time
from pathlib import Path

import pytest

from contactsense.service.cli.main import main
from contactsense.service.demo.child_process import ChildError, child
from tests.service import http
from tests.service.loopback import until
from tests.service.seven_joints import seven_joints

SHORT = """
robot: ur5e
noise: {base_force: 0.25, base_moment: 0.05, joint_torque: 1.0}
trajectory: {start: [0.0, -1.3, 1.6, -1.9, -1.57, 0.0], dwell: 4.5}
contacts:
  - link: forearm
    point: [-0.1747, 0.0373, 0.0095]
    normal: [-0.0008, 0.9931, 0.1174]
    PUSH
    start: 3.0
    duration: 1.0
"""


def contactsense(*arguments: str) -> subprocess.Popen[str]:
    return subprocess.Popen(
        [sys.executable, "-m", "contactsense", *arguments],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        start_new_session=True,
        # Shells start background jobs with SIGINT ignored, and children inherit that.
        preexec_fn=lambda: signal.signal(signal.SIGINT, signal.SIG_DFL),
    )


def test_commands_use_one_thread_for_linear_algebra(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv("OPENBLAS_NUM_THREADS", raising=False)
    script = """
import os, sys
from contactsense.service.cli.main import main
assert "numpy" not in sys.modules  # the number is read when it is imported
try:
    main()
finally:
    print(os.environ["OPENBLAS_NUM_THREADS"])
"""
    result = subprocess.run(
        [sys.executable, "-c", script, "--version"], capture_output=True, text=True, timeout=250, check=True
    )
    assert result.stdout.splitlines()[-1] == "1"


def run(*arguments: str) -> tuple[int, str, str]:
    process = contactsense(*arguments)
    out, err = process.communicate(timeout=250)
    return process.returncode, out, err


@pytest.mark.long
@pytest.mark.realtime
def test_the_demo_finds_a_push(tmp_path: Path) -> None:
    script = tmp_path / "push.yaml"
    script.write_text(SHORT.replace("PUSH", "push: 25"))
    status, out, err = run("demo", "--script", str(script))
    assert "1 of 1 contacts on 1 links found on the right link" in out, out + err
    assert "forearm" in out
    assert "share: of the samples under full force" in out
    assert status == 0
    assert err == ""


@pytest.mark.slow
@pytest.mark.realtime
def test_the_demo_fails_where_the_truth_is_out_of_reach(tmp_path: Path) -> None:
    script = tmp_path / "breath.yaml"
    script.write_text(SHORT.replace("PUSH", "push: 0.1"))  # far below the noise
    status, out, err = run("demo", "--script", str(script))
    assert "0 of 1 contacts" in out, out + err
    assert status == 1


@pytest.mark.long
@pytest.mark.realtime
def test_the_whole_demo() -> None:
    status, out, err = run("demo")
    assert "8 of 8 contacts on 5 links found on the right link" in out, out + err
    assert status == 0


@pytest.mark.slow
@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_the_demo_can_be_interrupted(number: signal.Signals) -> None:
    process = contactsense("demo")
    assert process.stdout is not None
    process.stdout.readline()
    time.sleep(1.0)
    process.send_signal(number)
    out, err = process.communicate(timeout=120)
    assert process.returncode == 1
    assert err == "contactsense: interrupted\n", out
    assert "Traceback" not in out + err


@pytest.mark.parametrize("number", [pytest.param(signal.SIGINT, marks=pytest.mark.slow), signal.SIGTERM])
def test_serve_tells_where_it_is_and_ends_when_told(number: signal.Signals) -> None:
    process = contactsense("serve", "--port", "0")
    assert process.stdout is not None
    line = process.stdout.readline()
    assert line.startswith("serving at http://127.0.0.1:")
    url = line.removeprefix("serving at ").strip()
    second = process.stdout.readline()
    assert second == f"interface: {url}/docs; viewer: contactsense view --url {url}\n"
    assert http.get(f"{url}/v1/health", timeout=60).json()["status"] == "idle"
    process.send_signal(number)
    _, err = process.communicate(timeout=120)
    assert process.returncode == 0
    assert err.count(f"the service ends: it received {number.name}\n") == 1
    assert "Traceback" not in err


@pytest.mark.slow
def test_serve_ends_in_order_when_it_is_interrupted_twice() -> None:
    """A request whose body has not come keeps the shutdown open until the second interrupt is there."""
    process = contactsense("serve", "--port", "0")
    assert process.stdout is not None
    url = process.stdout.readline().removeprefix("serving at ").strip()
    assert http.get(f"{url}/v1/health", timeout=60).json()["status"] == "idle"
    host, _, port = url.removeprefix("http://").partition(":")

    def closed() -> bool:
        with socket.socket() as probe:
            return probe.connect_ex((host, int(port))) != 0

    with socket.create_connection((host, int(port))) as slow:
        slow.sendall(
            f"POST /v1/locate HTTP/1.1\r\nHost: {host}:{port}\r\nContent-Type: application/json\r\n"
            "Content-Length: 2\r\nExpect: 100-continue\r\n\r\n".encode()
        )
        assert slow.recv(100).startswith(b"HTTP/1.1 100")  # the body is being waited for
        process.send_signal(signal.SIGINT)
        assert until(closed)
        process.send_signal(signal.SIGINT)
    _, err = process.communicate(timeout=120)
    assert process.returncode == 0
    assert "Traceback" not in err


@pytest.mark.parametrize(
    ("arguments", "complaint"),
    [
        (("serve", "--robot", "ur7"), "unknown robot 'ur7'"),
        (("serve", "--scene", "none.yaml"), "none.yaml"),
        (("serve", "--robot-host", "192.0.2.1"), "expected either its address (--ft-host)"),
        (
            ("serve", "--ft-host", "192.0.2.2"),
            "--ft-host is read together with the robot: expected --robot-h",
        ),
        (
            ("serve", "--ft-counts", "5"),
            "serve: --ft-counts: expected two numbers, counts per N and per Nm, such",
        ),
        (("serve", "--port", "70000"), "serve: --port: expected a number of at most 65535, got 70000"),
        (("serve", "--xmlrpc-port", "-2"), "serve: --xmlrpc-port: expected a number of at least 0, got -2"),
        (
            ("serve", "--source", "push", "--ft-host", "192.0.2.2"),
            "--ft-host is for samples that are read from",
        ),
        (
            ("serve", "--robot-client", "rtde"),
            "--robot-client is read together with the robot: expected --ro",
        ),
        (
            ("serve", "--controller-host", "0.0.0.0", "--line-port", "0"),
            "expected the addresses of the robots that may connect (--controller-clients), got none",
        ),
        (("serve", "--controller-clients", "x"), "--controller-clients: expected an IP address, got 'x'"),
        (("serve", "--tls-key", "key.pem"), "expected both --tls-certificate and --tls-key"),
        (("mock", "--script", "none.yaml"), "none.yaml"),
        (("mock", "--rtde-port", "70000"), "'--rtde-port': 70000 is not in the range"),
        (("view", "--port", "70000"), "'--port': 70000 is not in the range"),
        (("demo", "--script", "none.yaml"), "none.yaml"),
    ],
)
def test_what_cannot_be_used_is_one_line_on_stderr(
    arguments: tuple[str, ...],
    complaint: str,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    """In this process, as starting one for each takes three seconds."""
    monkeypatch.setattr(sys, "argv", ["contactsense", *arguments])
    with pytest.raises(SystemExit) as ended:
        main()
    out, err = capsys.readouterr()
    # Wrong use of the command line, or an input that cannot be used.
    assert ended.value.code == (1 if complaint in ("none.yaml", "unknown robot 'ur7'") else 2)
    assert out == ""
    assert complaint in err
    assert err.count("\n") == 1


@pytest.mark.parametrize(
    ("file", "reason"),
    [("none.pem", "No such file or directory"), (__file__, "expected a certificate and its key in PEM")],
)
def test_tls_files_that_cannot_be_used(
    file: str, reason: str, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    arguments = ["serve", "--port", "0", "--tls-certificate", file, "--tls-key", file]
    monkeypatch.setattr(sys, "argv", ["contactsense", *arguments])
    with pytest.raises(SystemExit, match="1"):
        main()
    out, err = capsys.readouterr()
    assert out == ""
    assert f"contactsense: {file}, {file}: cannot be used for TLS: {reason}" in err.splitlines()[-1]


@pytest.mark.slow
def test_a_signal_to_the_whole_group_is_no_failure(tmp_path: Path) -> None:
    """Service managers send SIGTERM to all processes of a service at once."""
    log = tmp_path / "log"
    sensors = (
        "--robot-host",
        "127.0.0.1",
        "--robot-port",
        "1",
        "--ft-host",
        "127.0.0.1",
        "--ft-counts",
        "1,1",
    )
    with child("serve", "--port", "0", "--log-file", str(log), *sensors) as service:
        url = service.wait_for("serving at ")
        waiting = lambda: http.get(f"{url}/v1/health").json()["status"] == "waiting"  # noqa: E731
        assert until(waiting, 280.0, step=0.1)  # kernels may have to be compiled
        os.killpg(service.pid, signal.SIGTERM)
        with pytest.raises(ChildError, match="exit status 0"):
            assert until(lambda: service.check(), 20.0)
    told = log.read_text()
    assert "retrying" in told
    assert "failing" not in told, told
    assert "exit code" not in told, told


def test_commands_are_listed_in_the_order_of_their_use(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(sys, "argv", ["contactsense", "--help"])
    with pytest.raises(SystemExit):
        main()
    out = capsys.readouterr().out
    order = ["First steps:", " demo ", "Your cell:", " scene ", " check ", " calibrate ", "Live:", " serve "]
    places = [
        out.index(name) for name in (*order, " mock ", "Recordings:", " record ", " analyze ", " bench ")
    ]
    assert places == sorted(places)


@pytest.mark.slow
@pytest.mark.skipif(not Path("/dev/full").exists(), reason="no device that is always full")
@pytest.mark.parametrize("buffered", [True, False])
def test_output_to_a_full_disk_is_told_in_one_line(buffered: bool) -> None:
    command = [sys.executable, "-m", "contactsense", "robots"]
    environment = {**os.environ, "PYTHONUNBUFFERED": "" if buffered else "1"}
    with Path("/dev/full").open("w") as full:
        ended = subprocess.run(
            command, stdout=full, stderr=subprocess.PIPE, text=True, check=False, env=environment
        )
    assert ended.returncode == 1
    assert ended.stderr == "contactsense: cannot write the output: No space left on device\n"


@pytest.mark.slow
def test_a_taken_port_is_told() -> None:
    with child("serve", "--port", "0") as first:
        port = first.wait_for("serving at http://127.0.0.1:")
        status, _, err = run("serve", "--port", port)
    assert status == 1
    assert "--port 0 takes a free port" in err
    status, _, err = run("serve", "--port", port, "--line-port", port)
    assert status == 1
    assert f"--line-port: cannot listen at 127.0.0.1:{port}" in err
    assert "Traceback" not in err


@pytest.mark.slow
def test_the_mock_has_six_joints(tmp_path: Path) -> None:
    seven_joints(tmp_path)
    script = tmp_path / "script.yaml"
    script.write_text("robot: seven\ntrajectory: {start: [0, 0, 0, 0, 0, 0, 0]}\n")
    status, _, err = run("mock", "--scene", str(tmp_path / "seven.yaml"), "--script", str(script))
    assert (status, err.count("\n")) == (1, 1)
    assert "robot: expected an arm with 6 joints, as RTDE has them, got seven with 7" in err


@pytest.mark.slow
def test_a_mock_that_cannot_loop(tmp_path: Path) -> None:
    script = tmp_path / "away.yaml"
    script.write_text(
        "robot: ur5e\n"
        "trajectory: {start: [0, 0, 0, 0, 0, 0], moves: [{to: [1, 0, 0, 0, 0, 0], duration: 2}]}\n"
    )
    status, _, err = run("mock", "--loop", "--script", str(script))
    assert status == 1
    assert "ends where it begins" in err


@pytest.mark.slow
def test_a_child_that_does_not_come_up_is_told_with_its_last_words() -> None:
    with (
        child("serve", "--robot", "ur7") as failing,
        pytest.raises(ChildError, match=r"status 1: .*unknown robot"),
    ):
        failing.wait_for("serving at ")


@pytest.mark.slow
def test_a_child_is_gone_after_its_context() -> None:
    with child("mock", "--rtde-port", "0", "--ft-port", "0", "--ft-http-port", "0") as mock:
        mock.wait_for("mock arm at ")
        mock.check()
        pid = mock.pid
    with pytest.raises(ProcessLookupError):
        os.kill(pid, 0)
