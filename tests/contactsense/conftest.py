"""Localizers of the plain arm that several files ask for; whoever runs a stream starts it anew."""

import pytest

from contactsense import Localizer, Scene
from tests.contactsense.precise import PRECISE
from tests.plain_arm import plain_ur5e


@pytest.fixture(scope="session")
def precise() -> Localizer:
    return Localizer(PRECISE)


@pytest.fixture(scope="session")
def ordinary() -> Localizer:
    return Localizer(Scene(robot=plain_ur5e()))
