"""Names that a user may have meant, for messages about unknown ones."""

from collections.abc import Iterable
from difflib import get_close_matches


def did_you_mean(name: str, known: Iterable[str]) -> str:
    """End of a message about an unknown `name`: the known one that is nearest; empty if none is near."""
    near = nearest(name, known)
    return f" (did you mean {near[0]}?)" if near else ""


def nearest(name: str, known: Iterable[str]) -> list[str]:
    """The known name that is nearest to `name`; empty if none is near."""
    return get_close_matches(name, list(known), 1)
