"""What the options of `contactsense serve` change in the service that it starts."""

import logging
import shlex
import subprocess
import sys
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest
from click.testing import CliRunner
from fastapi import FastAPI

from contactsense.service.cli import serve
from contactsense.service.live.hub import Hub
from tests.service import http
from tests.service.serving import serving

Start = Callable[..., FastAPI]


@pytest.fixture
def start(monkeypatch: pytest.MonkeyPatch) -> Iterator[Start]:
    """Starts the command with options, and returns its application instead of running it."""
    made: list[FastAPI] = []

    class Server:
        def __init__(self, config: Any) -> None:
            made.append(config.app)

        def run(self, sockets: object) -> None:
            pass

    monkeypatch.setattr(serve, "_Server", Server)
    for name in ("prioritize", "prefer_low_latency"):  # of the command's own process
        monkeypatch.setattr(serve, name, lambda: None)
    root = logging.getLogger()
    handlers, level = root.handlers[:], root.level

    def started(*options: str) -> FastAPI:
        done = CliRunner().invoke(serve.serve, ["--port", "0", *options])
        assert done.exit_code == 0, done.output
        return made.pop()

    yield started
    for handler in root.handlers:
        handler.close()
    root.handlers[:], root.level = handlers, level


def test_a_body_is_limited(start: Start) -> None:
    with serving(start("--max-body", "100")) as place:
        assert http.post(f"http://{place}/v1/locate", content=b" " * 100).status_code == 422
        refused = http.post(f"http://{place}/v1/locate", content=b" " * 101)
    assert refused.status_code == 413
    assert "at most 100 bytes, got 101" in refused.text


def test_hosts_and_pages_are_allowed_by_name(start: Start) -> None:
    hosts = ("--allowed-host", "robot.cell", "--allowed-host", "Rübe")
    pages = ("--allowed-origin", "https://a.cell", "--allowed-origin", "https://b.cell:443")
    with serving(start(*hosts, *pages)) as place:

        def status(**headers: str) -> int:
            return http.get(f"http://{place}/v1/robot", headers=headers).status_code

        assert [status(Host=host) for host in ("robot.cell:8000", "xn--rbe-hoa", "c.cell")] == [200, 200, 400]
        origins = ("https://a.cell", "https://b.cell", "http://a.cell")
        assert [status(Host="robot.cell", Origin=origin) for origin in origins] == [200, 200, 403]


def test_a_slow_reader_keeps_as_many_estimates(start: Start) -> None:
    hub: Hub = start("--queue", "3").state.service.hub
    with hub.subscribe() as reader:
        for i in range(10):
            hub.publish(0.002 * i, b"{}")
        assert reader.lost == 7


@pytest.mark.parametrize(("level", "written"), [("debug", 4), ("info", 3), ("warning", 2), ("error", 1)])
def test_the_log_begins_at_its_level(
    start: Start, level: str, written: int, tmp_path_factory: pytest.TempPathFactory
) -> None:
    file = tmp_path_factory.mktemp("logs") / "Zelle Süd.log"
    start("--log-level", level, "--log-file", str(file))
    log = logging.getLogger("contactsense")
    for severity in (logging.DEBUG, logging.INFO, logging.WARNING, logging.ERROR):
        log.log(severity, "of the test")
    assert file.read_text(encoding="utf-8").count("of the test") == written


@pytest.mark.parametrize("option", ["--queue", "--max-body"])
@pytest.mark.parametrize("value", ["0", "-1", "1.5", "", "many"])
def test_numbers_that_cannot_be_are_refused(option: str, value: str) -> None:
    done = CliRunner().invoke(serve.serve, ["--port", "0", option, value])
    assert done.exit_code == 2
    assert option in done.output


@pytest.mark.slow
def test_a_key_with_a_pass_phrase_is_named_where_nobody_can_enter_it(tmp_path: Path) -> None:
    made = subprocess.run(
        shlex.split(
            "openssl req -x509 -newkey rsa:2048 -passout pass:secret -days 2 -subj /CN=localhost "
            "-keyout key.pem -out cert.pem"
        ),
        cwd=tmp_path,
        check=False,
        capture_output=True,
    )
    if made.returncode != 0:
        pytest.skip("openssl is not at hand, or too old")
    command = "from contactsense.service.cli.main import main; main()"
    options = shlex.split("serve --port 0 --tls-certificate cert.pem --tls-key key.pem")
    # OpenSSL asks on the terminal of the session.
    ended = subprocess.run(
        [sys.executable, "-c", command, *options],
        cwd=tmp_path,
        stdin=subprocess.DEVNULL,
        capture_output=True,
        text=True,
        start_new_session=True,
        timeout=60,
    )
    assert ended.returncode == 1
    assert "cert.pem, key.pem: cannot be used for TLS: expected a key without pass phrase" in ended.stderr
