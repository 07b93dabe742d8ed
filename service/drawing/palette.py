"""Colours of links."""

LINK_COLOURS = (
    "#5a6473", "#4285f4", "#db4437", "#e0a100", "#0f9d58", "#ab47bc", "#00acc1", "#795548", "#607d8b",
)  # fmt: skip
"""One colour per link, repeated cyclically."""
UNKNOWN = "#9e9e9e"
"""For contacts whose link is unknown."""


def link_colour(index: int) -> str:
    """Colour of a link as a hexadecimal code; index -1: no link."""
    return UNKNOWN if index < 0 else LINK_COLOURS[index % len(LINK_COLOURS)]
