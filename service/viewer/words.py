"""An estimate in words, as Markdown."""

import math

import numpy as np

from contactsense.service.percent import in_percent
from contactsense.service.viewer.literal_text import literal
from contactsense.solvers.posterior.region import REGION_90
from contactsense.types import Contact, Estimate


def in_words(estimate: Estimate | None, note: str = "") -> str:
    """What an estimate says; None: there is none. Its reason is left out if `note`, the Markdown shown above,
    has it."""
    if estimate is None:
        return "**No current estimate.**"
    if estimate.contacts:
        lines = [_headline(estimate), "", *_table(estimate)]
    elif estimate.other > 0.0:
        lines = ["**Something acts on the arm; no single push explains it.**"]
    elif estimate.status == "degraded":
        lines = ["**No contact detected, but one may be missed.**"]
    else:
        lines = ["**No contact detected.**"]
        if math.isfinite(estimate.detectable):
            lines += ["", f"A held push of {estimate.detectable:.1f} N would be detected anywhere."]
    if estimate.status == "degraded":
        lines[0] = f"**Degraded.** {lines[0]}"
    reason = literal(estimate.reason)
    if reason and reason not in note:
        lines += ["", reason]
    return "\n".join(lines)


def _headline(estimate: Estimate) -> str:
    best = estimate.contacts[0]
    if estimate.status == "multiple":
        return f"**{len(estimate.contacts)} contacts at the same time.**"
    if estimate.status == "ambiguous":
        count = len(estimate.contacts)
        if count == 1:
            return "**Ambiguous:** one explanation, which is not certain."
        return f"**Ambiguous:** {count} explanations, none clearly the best."
    return f"**{literal(best.link)}** is touched."


def _table(estimate: Estimate) -> list[str]:
    rows = ["| link | force | place within | probability |", "| --- | --- | --- | --- |"]
    rows += [
        f"| {literal(c.link)} | {np.linalg.norm(c.force_base):.1f} N | {_within(c)} | "
        f"{in_percent(c.probability)} |"
        for c in estimate.contacts
    ]
    if estimate.other >= 0.005:  # less would read 0 %
        rows.append(f"| none of these | | | {in_percent(estimate.other)} |")
    return rows


def _within(contact: Contact) -> str:
    """Longer half axis of the 90 % region in the surface [mm]."""
    tangential = np.eye(3) - np.outer(contact.normal_base, contact.normal_base)
    if not np.isfinite(contact.covariance).all():
        return "unknown"
    largest = np.linalg.eigvalsh(tangential @ contact.covariance @ tangential)[-1]
    radius = 1e3 * math.sqrt(REGION_90 * max(largest, 0.0))
    return f"{radius:.0f} mm" if radius >= 9.5 else f"{radius:.1f} mm"
