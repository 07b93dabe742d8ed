"""The timeline of a recording as a Matplotlib figure, for notebooks."""

import io
from collections.abc import Sequence
from typing import Any

from contactsense.robots.extras import install_command
from contactsense.service.analysis.residuals.residual_statistics import ResidualSummary
from contactsense.service.analysis.summary.contact_summary import ContactSummary
from contactsense.service.drawing.figure_style import figure_style
from contactsense.service.drawing.palette import NOWHERE, link_colour


def timeline_figure(contacts: Sequence[ContactSummary], residuals: ResidualSummary) -> Any:
    """Forces of the contacts over time, coloured by link, above the energy of the no-contact hypothesis."""
    try:
        with figure_style():
            return _draw(contacts, residuals)
    except ModuleNotFoundError as error:
        raise ModuleNotFoundError(
            f"plots need {error.name}: {install_command('notebook')}", name=error.name
        ) from None


def _draw(contacts: Sequence[ContactSummary], residuals: ResidualSummary) -> Any:
    from matplotlib.figure import Figure

    class Shown(Figure):
        """A figure that notebooks show, also where pyplot is not in use."""

        def _repr_png_(self) -> bytes:
            with io.BytesIO() as picture:
                self.savefig(picture, format="png")
                return picture.getvalue()

    figure = Shown(figsize=(9.0, 4.5), layout="constrained")
    above, below = figure.subplots(2, 1, sharex=True, height_ratios=(2.0, 1.0))
    seen: set[int] = set()
    for contact in contacts:
        label = None if contact.link_index in seen else (contact.link or "no single place")
        seen.add(contact.link_index)
        colour = link_colour(contact.link_index)
        above.fill_between(contact.curve.t, contact.curve.force, color=colour, alpha=0.5, label=label)
    if seen:
        above.legend(loc="upper right")
    above.set_ylabel("force / N")
    below.semilogy(residuals.t, residuals.energy, color=NOWHERE, linewidth=0.8)
    below.set_ylabel('energy of "nothing\ntouches" / no unit')
    below.set_xlabel("time / s")
    return figure
