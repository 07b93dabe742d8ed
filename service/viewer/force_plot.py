"""The forces of the last seconds as a plot in the panel."""

import numpy as np
import viser
from viser import uplot

from contactsense.service.drawing.palette import ON_ANY_GROUND
from contactsense.service.viewer.frame import HISTORY, Forces

INTERVAL = 0.1
"""Shortest time between two drawings [s]."""
_UNKNOWN = "rgba(128, 128, 128, 0.4)"
"""Fills the times for which no force is known."""
_PADDING = (10, 16, 0, 0)
"""Margin at the top, right, bottom and left: the labels of the last ticks reach beyond the axes [px]."""


class ForcePlot:
    """Force over time: the contact's, or those of the contacts that act at the same time."""

    def __init__(self, gui: viser.GuiApi, contacts: int) -> None:
        """Add a plot for up to `contacts` simultaneous contacts, hidden until there are forces over time."""
        self._contacts = contacts
        self._title = "Force of the contact" if contacts == 1 else "Forces of the contacts"
        empty = np.array([-HISTORY, 0.0])
        self._plot = gui.add_uplot(
            (empty, *(np.zeros(2) for _ in range(1 + contacts))),
            (
                uplot.Series(label="time / s"),
                uplot.Series(
                    label="degraded", fill=_UNKNOWN, width=0, points=uplot.Series_Points(show=False)
                ),
                *(
                    uplot.Series(label=f"contact {i + 1} / N", stroke=colour, width=2)
                    for i, colour in enumerate(ON_ANY_GROUND[:contacts])
                ),
            ),
            title=self._title,
            scales={"x": uplot.Scale(time=False, range=(-HISTORY, 0.0)), "y": uplot.Scale(auto=True)},
            axes=(
                uplot.Axis(label="time / s", labelSize=18, size=32),
                uplot.Axis(label="force / N", labelSize=18, size=44),
            ),
            legend=uplot.Legend(show=False),
            height=190,
            padding=_PADDING,
            visible=False,
        )
        self._drawn = -float("inf")

    def draw(self, forces: Forces, now: float) -> None:
        """Draw these forces, unless others were drawn a moment ago.

        Args:
            forces: Of the last seconds.
            now: Time on any clock that does not go back [s].
        """
        if now - self._drawn < INTERVAL or len(forces.t) < 2:
            return
        self._drawn = now
        self._plot.visible = True
        unknown = np.isnan(forces.force[:, 0])
        title = f"{self._title} (grey: degraded)" if unknown.any() else self._title
        if self._plot.title != title:
            self._plot.title = title
        force = np.nan_to_num(forces.force[:, : self._contacts])
        height = force.max() if force.any() else 1.0
        self._plot.data = (
            forces.t - forces.t[-1],
            np.where(unknown, height, 0.0),
            *(force[:, i].copy() for i in range(self._contacts)),
        )
