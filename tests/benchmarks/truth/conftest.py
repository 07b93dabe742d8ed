"""The arm of most tests."""

import pytest

from contactsense.benchmarks.truth.arm import Arm, read


@pytest.fixture(scope="session")
def arm() -> Arm:
    return read("ur5e")
