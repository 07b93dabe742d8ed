"""Analysing recordings: contacts, residuals, reports, fleets."""

from typing import TYPE_CHECKING

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach(
    __name__,
    submod_attrs={
        "analysis": ["Analysis", "analyze"],
        "contact_summary": ["ContactSummary"],
        "force_limits": ["ForceLimits", "LimitsError"],
    },
)

if TYPE_CHECKING:
    from contactsense.service.analysis.analysis import Analysis as Analysis
    from contactsense.service.analysis.analysis import analyze as analyze
    from contactsense.service.analysis.contact_summary import ContactSummary as ContactSummary
    from contactsense.service.analysis.force_limits import ForceLimits as ForceLimits
    from contactsense.service.analysis.force_limits import LimitsError as LimitsError
