"""Tests with a browser."""

import pytest

from contactsense.benchmarks.browser import BrowserError, find_browser


def require_browser() -> None:
    """Skip the test where there is no browser."""
    try:
        find_browser()
    except BrowserError as error:
        pytest.skip(str(error))
