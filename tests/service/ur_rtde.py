"""Whether ur_rtde can be tested here."""

import importlib.util

import pytest

ur_rtde_installed = pytest.mark.skipif(
    importlib.util.find_spec("rtde_receive") is None,
    reason="ur-rtde has no wheels for this Python or platform",
)
"""Skips a test that reads with ur_rtde where it cannot be installed."""
