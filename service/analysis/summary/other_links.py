"""The links that a contact may be on instead, in words."""

from collections.abc import Sequence

from contactsense.service.percent import in_percent


def other_links(names: Sequence[str], link_index: int, link_probability: Sequence[float]) -> list[str]:
    """Links with 1 % or more and their probabilities, most probable first.

    Args:
        names: Of all links.
        link_index: The most probable one, which is left out; -1 for none.
        link_probability: Of each link, shape (links,).
    """
    others = [
        (name, float(p))
        for i, (name, p) in enumerate(zip(names, link_probability, strict=True))
        if i != link_index and p >= 0.01
    ]
    return [f"{name} ({in_percent(p)})" for name, p in sorted(others, key=lambda item: -item[1])]
