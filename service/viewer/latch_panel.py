"""The panel of latched collisions, with a button to acknowledge them where that is permitted."""

from collections.abc import Callable

import viser

from contactsense.service.viewer.frame import Latch
from contactsense.service.viewer.literal_text import literal


class LatchPanel:
    """Lists latched collisions; hidden while there are none."""

    def __init__(self, gui: viser.GuiApi, acknowledge: Callable[[], str] | None) -> None:
        """Add the controls.

        Args:
            gui: Where.
            acknowledge: Acknowledges all of them and returns what went wrong, empty if nothing did; None: it
                is not permitted from here.
        """
        self._folder = gui.add_folder("Latched collisions", visible=False)
        self._acknowledge = acknowledge
        self._shown: tuple[Latch, ...] = ()
        with self._folder:
            self._text = gui.add_markdown("")
            self._error = gui.add_markdown("", visible=False)
            if acknowledge is not None:
                gui.add_button("Acknowledge", color="orange").on_click(lambda _: self._press())

    def update(self, latches: tuple[Latch, ...]) -> None:
        """Show these collisions."""
        if latches == self._shown:
            return
        self._shown = latches
        self._text.content = "\n".join(f"- {literal(latch.text)}" for latch in latches)
        self._error.visible = False
        self._folder.visible = bool(latches)

    def _press(self) -> None:
        assert self._acknowledge is not None
        wrong = self._acknowledge()
        self._error.content, self._error.visible = literal(wrong), bool(wrong)
