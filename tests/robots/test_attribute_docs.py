"""Docstrings of fields in the docstring of their class, as `help` and notebooks show it."""

from typing import NamedTuple

import contactsense
from contactsense.robots.attribute_docs import with_attributes


class Part(NamedTuple):
    """Something."""

    length: float
    """Length, which
    is long [m]."""
    nameless: int
    width: float = 1.0
    """Width [m]."""


def test_fields_are_described_below_the_class() -> None:
    class Local(Part):
        """Nothing of this is at the top of a module."""

    assert with_attributes(Local).__doc__ == "Nothing of this is at the top of a module."


def test_what_users_hold_in_their_hands_says_shapes_and_units() -> None:
    for name in contactsense.__all__:
        shown = getattr(contactsense, name)
        fields = getattr(shown, "model_fields", getattr(shown, "__match_args__", ()))
        if not isinstance(shown, type) or not fields:
            continue
        for field in fields:
            assert f"\n    {field}: " in (shown.__doc__ or ""), f"{name}.{field}"
    assert "force_base: Force on the robot, base axes [N], shape (3,)." in (
        contactsense.Contact.__doc__ or ""
    )
    assert "in the frame of `link`" in (contactsense.LinkWrenchSensor.__doc__ or "")
