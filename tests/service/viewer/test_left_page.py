"""A page that the browser of the tests has left is gone for the viewer too."""

from pathlib import Path

import pytest

from contactsense.benchmarks.browser import browser_page
from contactsense.service.viewer.viewer import serve_page
from tests.browser import require_browser
from tests.service.loopback import until

pytestmark = pytest.mark.slow
PATIENCE = 60.0
"""Longest time for a page to be loaded on a busy computer [s]."""


def test_a_page_that_was_left_does_not_stay_connected(tmp_path: Path) -> None:
    require_browser()
    server = serve_page("127.0.0.1", 0)
    address = f"http://127.0.0.1:{server.get_port()}/?fixedDpr=1"
    try:
        with browser_page(address, tmp_path) as (page, _):
            assert until(lambda: len(server.get_clients()) == 1, PATIENCE)
            before = set(server.get_clients())
            page.call("Page.navigate", url=f"{address}&again")
            assert until(lambda: set(server.get_clients()) - before, PATIENCE)
            assert until(lambda: not before & set(server.get_clients()), PATIENCE)
    finally:
        server.stop()
