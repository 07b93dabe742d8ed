"""One look of all Matplotlib figures: colours for the colour-blind, sizes that can be read on a projector.

An axis is labelled `quantity / unit`, as in the viewer and in reports.
"""

from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

from contactsense.service.drawing.palette import SERIES

STYLE = {
    "font.size": 11.0,
    "axes.labelsize": 11.0,
    "axes.titlesize": 11.0,
    "figure.labelsize": 11.0,
    "figure.titlesize": 12.0,
    "legend.fontsize": 10.0,
    "axes.grid": True,
    "axes.axisbelow": True,
    "grid.color": "#dddddd",
    "axes.spines.top": False,
    "axes.spines.right": False,
    "lines.linewidth": 1.6,
    "savefig.dpi": 100.0,
}
"""Matplotlib's parameters, but for the colours of curves."""


@contextmanager
def figure_style() -> Iterator[None]:
    """Figures that are made and saved within have this look, and `SERIES` as colours C0 to C5."""
    import matplotlib as mpl
    from cycler import cycler

    look: Any = {**STYLE, "axes.prop_cycle": cycler(color=SERIES)}
    with mpl.rc_context(look):
        yield
