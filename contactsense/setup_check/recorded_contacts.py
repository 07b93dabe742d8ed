"""Contacts in recordings that no lines of a scene explain: `contactsense.calibration` finds them."""

from typing import NamedTuple

import numpy as np

from contactsense.calibration.contact_free_fit import (
    CalibrationError,
    TooMuchContactError,
    fit_without_contacts,
)
from contactsense.calibration.contacts.contact_test import SuspectedContact
from contactsense.calibration.free_motion import FreeMotion
from contactsense.scene import Scene

_MIN_SAMPLES = 3
"""A recording has at least so many."""


class Untouched(NamedTuple):
    """Recordings without contacts."""

    recordings: list[FreeMotion]
    """What is left of them; empty: too little."""
    contacts: tuple[SuspectedContact, ...]
    """Where something seems to push on the arm."""


def used_samples(recordings: list[FreeMotion]) -> list[FreeMotion]:
    """The recordings with gaps in place of the samples that are not used; without those of which next to
    nothing is left."""
    used = [(part, np.flatnonzero(part.usable)) for part in recordings]
    return [part.part(rows) for part, rows in used if len(rows) >= _MIN_SAMPLES]


def without_contacts(scene: Scene, recordings: list[FreeMotion]) -> Untouched:
    """The recordings without what `contactsense.calibration.calibrate` leaves out as a contact.

    A wrong line hardly looks like one: calibration fits what it can, and where it cannot, residuals are large
    throughout the motion.
    """
    try:
        found = fit_without_contacts(scene, recordings)
    except TooMuchContactError as error:
        return Untouched([], error.contacts)
    except CalibrationError:  # such as too short a motion: nothing is known
        return Untouched(recordings, ())
    return Untouched(used_samples(found.recordings), found.contacts)
