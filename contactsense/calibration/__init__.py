"""Calibration: what contact-free motion tells of friction, payload, sensors and noise. No input or output."""

from contactsense.calibration.calibrate import (
    CalibrationError,
    Settings,
    calibrate,
    default_groups,
)
from contactsense.calibration.result import Calibration, Level, Value
from contactsense.calibration.stretch import Stretch

__all__ = [
    "Calibration",
    "CalibrationError",
    "Level",
    "Settings",
    "Stretch",
    "Value",
    "calibrate",
    "default_groups",
]
