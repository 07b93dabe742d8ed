"""Analysing recordings: contacts, residuals, reports, fleets.

`analysis` runs a recording through the localizer and keeps the `samples` of each contact. After its end,
`smoothing` estimates it from all of them, and `summary` says what happened, which `contact_table`,
`contact_arrows` and `report` write. `residuals` and `health` judge the model. `fleet` does all this for many
recordings.
"""

from typing import TYPE_CHECKING

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach(
    __name__,
    submod_attrs={
        "analysis": ["Analysis", "analyze"],
        "summary.contact_summary": ["ContactSummary"],
        "summary.force_limits": ["ForceLimits", "LimitsError"],
    },
)

if TYPE_CHECKING:
    from contactsense.service.analysis.analysis import Analysis as Analysis
    from contactsense.service.analysis.analysis import analyze as analyze
    from contactsense.service.analysis.summary.contact_summary import ContactSummary as ContactSummary
    from contactsense.service.analysis.summary.force_limits import ForceLimits as ForceLimits
    from contactsense.service.analysis.summary.force_limits import LimitsError as LimitsError
