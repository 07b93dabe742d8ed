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


def test_it_is_hidden_until_there_are_forces_over_time() -> None:
    shown = SimpleNamespace()

    def add_uplot(*_: Any, **settings: Any) -> SimpleNamespace:
        shown.visible = settings["visible"]
        return shown

    plot = ForcePlot(cast(viser.GuiApi, SimpleNamespace(add_uplot=add_uplot)), contacts=1)
    plot.draw(Forces(np.zeros(1), np.full((1, 1), 39.8)), now=0.0)
    assert not shown.visible  # a contact of a table has one force, and no time
    plot.draw(Forces(np.array([0.0, 0.5]), np.array([[np.nan], [20.0]])), now=1.0)
    assert shown.visible
    np.testing.assert_array_equal(shown.data[0], [-0.5, 0.0])
    np.testing.assert_array_equal(shown.data[1], [0.0, 20.0])
