"""A port that is taken is told with its option, as a person would write the address."""

import socket
from collections.abc import Iterator
from pathlib import Path

import pytest
from click.testing import CliRunner

from contactsense.service.cli.mock import mock
from contactsense.service.cli.serve import serve
from contactsense.service.free_ports import PortError, Wanted, check, reason

IN_USE = "Address already in use"


@pytest.fixture
def taken() -> Iterator[int]:
    """A port, TCP and UDP, that is in use during the test."""
    with socket.create_server(("127.0.0.1", 0)) as server:
        port = server.getsockname()[1]
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as datagrams:
            datagrams.bind(("127.0.0.1", port))
            yield port


@pytest.mark.parametrize(
    "option",
    [
        "--rtde-port", "--ft-port", "--ft-http-port", "--dashboard-port", "--primary-port",
        "--secondary-port", "--realtime-port",
    ],
)  # fmt: skip
def test_the_mock_names_the_option(option: str, taken: int) -> None:
    free = [
        x for name in ("--rtde-port", "--ft-port", "--ft-http-port") if name != option for x in (name, "0")
    ]
    result = CliRunner().invoke(mock, [*free, option, str(taken)])
    assert result.exit_code == 1
    assert result.output == f"Error: {option}: cannot listen at 127.0.0.1:{taken}: {IN_USE}\n"


def test_serve_writes_the_address_as_a_person_would(taken: int, tmp_path: Path) -> None:
    told = f"cannot serve at 127.0.0.1:{taken}: {IN_USE}; --port 0 takes a free port\n"
    result = CliRunner().invoke(serve, ["--port", str(taken), "--journal", str(tmp_path / "events.db")])
    assert result.exit_code == 1
    assert result.output.endswith(told)


def test_two_options_with_one_port() -> None:
    with socket.create_server(("127.0.0.1", 0)) as probe:
        port = probe.getsockname()[1]
    with pytest.raises(PortError, match=rf"^--b: cannot listen at 127\.0\.0\.1:{port}: {IN_USE}$"):
        check("127.0.0.1", [Wanted("--a", port), Wanted("--b", port)])


def test_a_host_that_is_unknown_or_elsewhere() -> None:
    for host, expected in (("192.0.2.1", "Cannot assign requested address"), ("no.such.host.invalid", "")):
        with pytest.raises(OSError) as caught:  # noqa: PT011
            socket.create_server((host, 0))
        assert expected in reason(caught.value)
        assert "(" not in reason(caught.value)
        assert "rrno" not in reason(caught.value)
        assert "Unknown error" not in reason(caught.value)
