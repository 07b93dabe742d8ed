"""The plot of the forces in the viewer's panel."""

from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import viser

from contactsense.service.viewer.force_plot import ForcePlot
from contactsense.service.viewer.frame import Forces


def test_the_label_of_the_topmost_tick_has_room() -> None:
    chosen: dict[str, Any] = {}
    ForcePlot(
        cast(viser.GuiApi, SimpleNamespace(add_uplot=lambda *_, **settings: chosen.update(settings))), 1
    )
    top, right, *_ = chosen["padding"]
    assert top >= 8  # half the height of a label
    assert right >= 8


def shown_plot(contacts: int) -> tuple[ForcePlot, SimpleNamespace]:
    """A plot, and what it shows."""
    shown = SimpleNamespace()

    def add_uplot(*_: Any, **settings: Any) -> SimpleNamespace:
        shown.visible, shown.title = settings["visible"], settings["title"]
        return shown

    return ForcePlot(cast(viser.GuiApi, SimpleNamespace(add_uplot=add_uplot)), contacts), shown


def test_it_is_hidden_until_there_are_forces_over_time() -> None:
    plot, shown = shown_plot(contacts=1)
    plot.draw(Forces(np.zeros(1), np.full((1, 1), 39.8)), now=0.0)
    assert not shown.visible  # a contact of a table has one force, and no time
    plot.draw(Forces(np.array([0.0, 0.5]), np.array([[0.0], [20.0]])), now=1.0)
    assert shown.visible
    np.testing.assert_array_equal(shown.data[0], [-0.5, 0.0])
    np.testing.assert_array_equal(shown.data[2], [0.0, 20.0])


def test_where_no_force_is_known_it_is_grey() -> None:
    plot, shown = shown_plot(contacts=2)
    t = np.array([0.0, 0.5, 1.0])
    plot.draw(Forces(t, np.array([[0.0, 0.0, 0.0], [np.nan, np.nan, np.nan], [20.0, 5.0, 0.0]])), now=1.0)
    assert "grey: degraded" in shown.title
    np.testing.assert_array_equal(shown.data[1:], [[0.0, 20.0, 0.0], [0.0, 0.0, 20.0], [0.0, 0.0, 5.0]])
    plot.draw(Forces(t, np.full((3, 3), np.nan)), now=2.0)
    assert shown.data[1].all()  # though no force gives the scale
    plot.draw(Forces(t, np.zeros((3, 3))), now=3.0)
    assert "grey" not in shown.title
    assert not shown.data[1].any()
