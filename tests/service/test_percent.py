"""Probabilities as people read them."""

import pytest

from contactsense.service.percent import in_percent


@pytest.mark.parametrize(
    ("probability", "text"),
    [(0.0, "0 %"), (0.456, "46 %"), (0.994, "99 %"), (0.995, "> 99 %"), (1.0, "> 99 %")],
)
def test_nothing_is_said_to_be_certain(probability: float, text: str) -> None:
    assert in_percent(probability) == text
