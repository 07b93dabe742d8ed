"""Analysing recordings: contacts, residuals, reports, fleets."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach(
    __name__,
    submod_attrs={
        "analysis": ["Analysis", "analyze"],
        "contact_summary": ["ContactSummary"],
        "force_limits": ["ForceLimits", "LimitsError"],
    },
)
