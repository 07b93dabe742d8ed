"""What protocol version 1 of RTDE does otherwise: no frequency is asked for, and the outputs' recipe has no
number.

Source: Universal Robots, "Real-Time Data Exchange (RTDE)". A client that has not asked for version 2 speaks
this one.
"""

from contactsense.service.wire import rtde
from contactsense.service.wire.recipe import HEADER

FREQUENCY = 125.0
"""Packages a second [Hz]."""


def parse_output_setup(payload: bytes) -> rtde.OutputSetup:
    """What a client of version 1 asks for: names alone."""
    names = [name.strip() for name in payload.decode("ascii", "replace").split(",")]
    return rtde.OutputSetup(FREQUENCY, tuple(name for name in names if name))


def without_recipe_number(frame: bytes) -> bytes:
    """A setup reply or data package of version 2 as version 1 has it."""
    size, kind = HEADER.unpack_from(frame)
    return HEADER.pack(size - 1, kind) + frame[HEADER.size + 1 :]
