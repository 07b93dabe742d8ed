"""`contactsense view` that is started before its service waits for it."""

import contextlib
import socket
from collections.abc import Iterator
from types import SimpleNamespace

import click
import pytest
from click.testing import CliRunner

from contactsense.service.cli import view as command
from tests.service.viewer.test_live_source import PUSH, service


@pytest.fixture
def reserved() -> Iterator[socket.socket]:
    """A socket at a port of this host where nobody listens yet."""
    with socket.socket() as made:
        made.bind(("127.0.0.1", 0))
        yield made


def test_it_waits_and_is_interrupted(reserved: socket.socket, monkeypatch: pytest.MonkeyPatch) -> None:
    pauses: list[float] = []

    def sleep(seconds: float) -> None:
        pauses.append(seconds)
        if len(pauses) == 3:
            raise KeyboardInterrupt

    monkeypatch.setattr(command, "time", SimpleNamespace(sleep=sleep))
    url = f"http://127.0.0.1:{reserved.getsockname()[1]}"
    result = CliRunner().invoke(command.view, ["--url", url, "--port", "0"])
    told = f"{url} cannot be reached: Connection refused; waiting for the service, Ctrl-C ends"
    assert result.stderr == f"{told}\n\nAborted!\n"
    assert result.exit_code == 1
    assert pauses == [command.RETRY] * 3


def test_a_port_that_is_taken_is_told_before_the_service_comes(
    reserved: socket.socket, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(command, "time", SimpleNamespace(sleep=lambda _: pytest.fail("it waits")))
    url = f"http://127.0.0.1:{reserved.getsockname()[1]}"
    with socket.create_server(("127.0.0.1", 0)) as taken:
        port = taken.getsockname()[1]
        result = CliRunner().invoke(command.view, ["--url", url, "--port", str(port)])
    told = f"Error: cannot serve at 127.0.0.1:{port}: Address already in use; --port 0 takes a free port\n"
    assert result.stderr == told


def test_it_shows_the_service_that_comes(reserved: socket.socket, monkeypatch: pytest.MonkeyPatch) -> None:
    with contextlib.ExitStack() as stack:

        def start(_: float) -> None:
            stack.enter_context(service(PUSH, listener=reserved))

        def page(*_: object) -> None:
            raise click.ClickException("a page is served")

        monkeypatch.setattr(command, "time", SimpleNamespace(sleep=start))
        monkeypatch.setattr(command, "_page", page)
        url = f"http://127.0.0.1:{reserved.getsockname()[1]}"
        result = CliRunner().invoke(command.view, ["--url", url, "--port", "0"])
    assert result.stderr.endswith("waiting for the service, Ctrl-C ends\nError: a page is served\n")
