"""The panel of actions that failed: closed at first, so that it hides nothing of the estimate on a phone."""

import viser

from contactsense.service.viewer.literal_text import literal


class FailurePanel:
    """Lists what is wrong with each action; hidden while nothing is listed."""

    def __init__(self, gui: viser.GuiApi) -> None:
        """Add it to a page, hidden."""
        self._folder = gui.add_folder("Failed actions", expand_by_default=False, visible=False)
        self._shown: tuple[str, ...] = ()
        with self._folder:
            self._text = gui.add_markdown("")

    def update(self, failures: tuple[str, ...]) -> None:
        """Show these."""
        if failures == self._shown:
            return
        self._shown = failures
        self._text.content = "\n".join(f"- {literal(each)}" for each in failures)
        self._folder.visible = bool(failures)
