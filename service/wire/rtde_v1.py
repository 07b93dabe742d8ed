"""Differences of RTDE protocol version 1: the client requests no frequency, and the recipe of the outputs has
no number.

Source: Universal Robots, "Real-Time Data Exchange (RTDE)". A client that has not requested version 2 uses
version 1.
"""

from contactsense.service.wire import rtde
from contactsense.service.wire.recipe import HEADER

FREQUENCY = 125.0
"""Packages per second [Hz]."""


def parse_output_setup(payload: bytes) -> rtde.OutputSetup:
    """Parse the output setup of a client of version 1, which contains only names."""
    names = [name.strip() for name in payload.decode("ascii", "replace").split(",")]
    return rtde.OutputSetup(FREQUENCY, tuple(name for name in names if name))


def without_recipe_number(frame: bytes) -> bytes:
    """Convert a setup reply or data package of version 2 to version 1."""
    size, kind = HEADER.unpack_from(frame)
    return HEADER.pack(size - 1, kind) + frame[HEADER.size + 1 :]
