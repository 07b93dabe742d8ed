"""Calibration of friction, payload, sensors and noise from contact-free motion. No input or output."""

from contactsense.calibration.calibrate import calibrate
from contactsense.calibration.contact_free_fit import CalibrationError, Settings, default_groups
from contactsense.calibration.contacts.contact_test import SuspectedContact
from contactsense.calibration.free_motion import FreeMotion
from contactsense.calibration.result import Calibration, ResidualStatistics, Value

__all__ = [
    "Calibration",
    "CalibrationError",
    "FreeMotion",
    "ResidualStatistics",
    "Settings",
    "SuspectedContact",
    "Value",
    "calibrate",
    "default_groups",
]
