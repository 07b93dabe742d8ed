"""Tests that belong together run in one worker (`tests/conftest.py`)."""

import pytest


def test_groups_are_told_apart(request: pytest.FixtureRequest) -> None:
    if not getattr(request.config.option, "loadgroup", False):
        pytest.skip("needs pytest -n 2 --dist loadgroup")
    # pytest-xdist marks the group there; with some versions of pytest it silently does not.
    assert request.node.nodeid.endswith("@test_groups.py")
