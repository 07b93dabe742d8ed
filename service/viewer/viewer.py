"""The viewer: a web page with the arm, fed thirty times a second from a source.

viser runs the web server in a thread and sends each browser, at its own pace, the newest state of what has
changed: a browser that hangs delays neither the others nor the source.
"""

import contextlib
import io
import socket
import threading
import time
from collections.abc import Callable

import numpy as np
import viser

from contactsense.scene import Scene
from contactsense.service.drawing.posture import usual_posture
from contactsense.service.viewer.arm_nodes import ArmNodes
from contactsense.service.viewer.camera import Cameras
from contactsense.service.viewer.contact_nodes import ContactNodes
from contactsense.service.viewer.failure_panel import FailurePanel
from contactsense.service.viewer.force_plot import ForcePlot
from contactsense.service.viewer.frame import Frame, Latch
from contactsense.service.viewer.heat import Heat
from contactsense.service.viewer.latch_panel import LatchPanel
from contactsense.service.viewer.page_style import STYLE
from contactsense.service.viewer.view_panel import MountingPanel, ViewPanel
from contactsense.service.viewer.words import in_words
from contactsense.types import Estimate

RATE = 30.0
"""Pictures per second."""
WORDS = 0.1
"""Shortest time between two changes of the text [s]."""
SILENCE = 0.1
"""Longest time between two frames of a source that announces new ones [s]."""
UNSEEN = 1.0
"""Time between two frames while nobody looks [s]; a page that is opened shows the last one at first."""
_RACE = "deque mutated during iteration"
"""What asyncio says of an event that is set from another thread while its own one waits anew."""


class PageServer(viser.ViserServer):
    """viser's server, which cannot be asked to publish itself on the internet."""

    def request_share_url(self, verbose: bool = True) -> str | None:
        """Refuse: any page that reaches the server could ask for a tunnel."""
        return None


def serve_page(host: str, port: int) -> PageServer:
    """Start the web server at an address; port 0: any free port.

    Raises:
        OSError: The address is not available.
    """
    # viser would silently take another port.
    with socket.create_server((host, port)) as probe:
        port = probe.getsockname()[1]
    with contextlib.redirect_stdout(io.StringIO()):
        page = PageServer(host, port, label="contactsense", verbose=False)
    if page.get_port() != port:
        page.stop()
        raise OSError(f"port {port} is taken")
    page.gui.configure_theme(control_width="large", show_logo=False, show_share_button=False)
    page.gui.main_panel.dock_right()
    page.scene.set_up_direction("+z")
    page.scene.configure_default_lights(cast_shadow=False)  # they tell nothing here, and cost time
    return page


class Viewer:
    """Draws frames of one arm on a page."""

    def __init__(self, page: PageServer, scene: Scene, acknowledge: Callable[[], str] | None = None) -> None:
        """Add the arm and the panels.

        Args:
            page: The web server.
            scene: The arm in its cell.
            acknowledge: As for `LatchPanel`.
        """
        self._page, self._scene = page, scene
        self._note = page.gui.add_markdown("")
        self._words = page.gui.add_markdown("The surface of the arm is being prepared.")
        self._latches = LatchPanel(page.gui, acknowledge)
        self._failures = FailurePanel(page.gui)
        self.controls = page.gui.add_folder("", visible=False)
        """Folder for the controls of a file; hidden until there are any."""
        self._plot = ForcePlot(page.gui, scene.contacts)
        self._arm = ArmNodes(page.scene, scene)
        self._arm.move(usual_posture(scene.robot))
        self._contacts = ContactNodes(page.scene, scene)
        self._heat = Heat(page.scene, scene)
        self._view = ViewPanel(page.gui, self._arm, self._heat)
        MountingPanel(page.gui, self._arm, scene)
        self._drawn = self._worded = -float("inf")
        self.cameras = Cameras(page, scene, self._arm.gravity)
        page.gui.add_html(STYLE)

    def add_controls(self, title: str, add: Callable[[viser.GuiApi], None]) -> None:
        """Show the controls of a file.

        Args:
            title: What they are for.
            add: Adds them.
        """
        self.controls.label = title
        with self.controls:
            add(self._page.gui)
        self.controls.visible = True

    def face(self, estimate: Estimate | None) -> None:
        """Have the cameras that no reader has moved see the best contact: one that is looked at for long, as
        they turn with it."""
        if estimate is not None and estimate.contacts:
            self.cameras.face(self._scene.orientation.apply(estimate.contacts[0].normal_base))

    def draw(
        self,
        frame: Frame,
        note: str = "",
        latches: tuple[Latch, ...] = (),
        failures: tuple[str, ...] = (),
    ) -> None:
        """Draw a frame, with what the source says of itself (Markdown), the latched collisions and the failed
        actions."""
        now = time.monotonic()
        if now - self._drawn < UNSEEN and not self._page.get_clients():
            return
        self._drawn = now
        with self._page.atomic():
            if frame.q is not None:
                self._arm.move(frame.q)
                self._heat.move(frame.q)
            self._contacts.draw(frame.estimate, self._arm.poses)
            if self._view.by_probability:
                links = len(self._arm.poses)
                known = np.zeros(links) if frame.estimate is None else frame.estimate.link_probability
                self._arm.colour(known.tolist())
        self._plot.draw(frame.forces, now)
        if now - self._worded >= WORDS:
            self._worded = now
            _set(self._note, note)
            _set(self._words, in_words(frame.estimate, note))
            self._latches.update(latches)
            self._failures.update(failures)
            self._view.update()
            self.cameras.update()

    def close(self) -> None:
        """End the threads and the server."""
        self._heat.close()
        with contextlib.redirect_stdout(io.StringIO()):  # viser prints that it has stopped
            self._page.stop()


def run(draw: Callable[[], None], over: threading.Event, news: threading.Event | None = None) -> None:
    """Call `draw` until `over` is set.

    Args:
        draw: Draws a frame.
        over: Ends the drawing.
        news: Set by the source when it has something new to draw; `draw` is called then, and after `SILENCE`
            without. None: `draw` is called `RATE` times a second; a late call is not made up for.
    """
    due = time.monotonic()
    while not over.is_set():
        try:
            draw()
        except RuntimeError as error:
            # viser sets an event of its own thread from ours. What is to be sent is stored by then, and goes
            # with the next message.
            if _RACE not in str(error):
                raise
        if news is not None:
            news.wait(SILENCE)
            news.clear()
            continue
        due = max(due + 1.0 / RATE, time.monotonic())
        over.wait(due - time.monotonic())


def _set(text: viser.GuiMarkdownHandle, content: str) -> None:
    if text.content != content:
        text.content = content
