"""The file with the token: what it has is a token that a header can carry, and is never shown."""

from pathlib import Path

import click
import pytest
from click.testing import CliRunner

from contactsense.service.api.http.token_file import read_token
from contactsense.service.api.settings import Settings, SettingsError
from contactsense.service.cli.record import record
from contactsense.service.cli.view import view

SECRET = b"of sixteen and more"


def test_white_space_around_the_token_does_not_belong_to_it(tmp_path: Path) -> None:
    file = tmp_path / "token"
    file.write_bytes(b"  " + SECRET + b"\r\n")
    assert read_token(file) == SECRET.decode()


@pytest.mark.parametrize("command", [view, record])
@pytest.mark.parametrize(
    ("content", "told"),
    [
        (b"", "expected a token of at least 16 characters, got 0"),
        (SECRET + b"\xa0\xff", "expected a token as text, got other bytes"),
        (SECRET + "ä".encode(), "expected a token of letters, digits and signs of ASCII in one line"),
        (SECRET + b"\n" + SECRET, "expected a token of letters, digits and signs of ASCII in one line"),
    ],
)
def test_what_is_no_token_is_told(command: click.Command, content: bytes, told: str, tmp_path: Path) -> None:
    file = tmp_path / "token"
    file.write_bytes(content)
    result = CliRunner().invoke(command, ["--url", "http://127.0.0.1:9", "--token-file", str(file)])
    assert result.exit_code == 1
    (line,) = result.output.splitlines()
    assert line.endswith(f"--token-file: {file}: {told}")
    assert SECRET.decode() not in line


@pytest.mark.parametrize("token", ["of sixteen and more ä", "of sixteen and more\nlines", "too short"])
def test_a_token_of_the_environment_that_cannot_be_used_is_refused_unseen(token: str) -> None:
    with pytest.raises(SettingsError, match="expected a token of") as caught:
        Settings.checked({"token": token})
    assert token not in str(caught.value)
