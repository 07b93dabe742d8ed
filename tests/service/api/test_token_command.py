"""The token that the page on security makes: every way to send it that the page names must carry it."""

import re
import shlex
import shutil
import subprocess
from pathlib import Path
from urllib.parse import parse_qs

import pytest

from contactsense.service.api.http.token_file import check_token

PAGE = Path(__file__).parents[3] / "docs" / "security.md"


@pytest.mark.skipif(shutil.which("openssl") is None, reason="openssl is not at hand")
def test_the_token_of_the_page_can_be_sent_in_all_ways() -> None:
    command = re.search(r"^    (openssl rand .*?) > token", PAGE.read_text(), re.MULTILINE)
    assert command is not None
    made = subprocess.run(shlex.split(command[1]), check=True, capture_output=True, text=True)
    token = check_token(made.stdout.strip())
    # RFC 9110, 5.6.2: a browser's WebSocket takes no other signs in a subprotocol.
    assert re.fullmatch(r"[!#$%&'*+.^_`|~0-9A-Za-z-]+", token)
    assert parse_qs(f"token={token}") == {"token": [token]}
