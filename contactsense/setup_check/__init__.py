"""Which line of a scene is wrong, from contact-free motion. No input or output."""

from contactsense.setup_check.check import check
from contactsense.setup_check.lines import Line, lines
from contactsense.setup_check.result import Finding, Residuals, SetupCheck, Verdict
from contactsense.setup_check.usable_recordings import CheckError

__all__ = ["CheckError", "Finding", "Line", "Residuals", "SetupCheck", "Verdict", "check", "lines"]
