"""A viewer in a browser: what it shows is set by the test, and its picture is read."""

import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
import viser
from scipy.spatial.transform import Rotation

from contactsense.benchmarks.browser import Page, browser_page
from contactsense.scene import Scene
from contactsense.service.viewer.frame import TRACKS, Forces, Frame, Latch
from contactsense.service.viewer.viewer import PageServer, Viewer, run, serve_page
from contactsense.types import Estimate
from tests.service.loopback import until
from tests.service.viewer.estimates import POSTURE

PATIENCE = 240.0
"""Software draws a picture in seconds on a busy computer [s]."""
PANEL = 470
"""Column of the page from which on the panel or its shadow covers the picture."""


@dataclass
class Shown:
    """A viewer whose frame tests set."""

    page: Page
    server: PageServer
    viewer: Viewer
    estimate: Estimate | None = None
    q: np.ndarray = field(default_factory=lambda: POSTURE)
    latches: Callable[[], tuple[Latch, ...]] = lambda: ()
    failures: tuple[str, ...] = ()

    def frame(self) -> Frame:
        return Frame(self.q, self.estimate, Forces(np.empty(0), np.empty((0, TRACKS))))

    @property
    def camera(self) -> viser.CameraHandle:
        """The browser's camera."""
        (client,) = self.server.get_clients().values()
        return client.camera

    def is_aimed(self) -> bool:
        """Whether the panel stands beside the picture, and the viewer has given the camera its place."""
        camera = self.camera
        width = self.page.evaluate("innerWidth")
        first = self.viewer.cameras.view(camera.aspect).position
        return camera.image_width < width and np.allclose(camera.position, first, atol=1e-4)

    def look(self, at: np.ndarray, position: np.ndarray, aside: float = 0.0) -> None:
        """Set the camera, places in the world [m]; `aside`: how far left of the middle the picture has `at`
        [m]."""
        ahead = at - position
        right = np.cross(ahead, [0.0, 0.0, 1.0])
        shift = aside * right / np.linalg.norm(right)

        def stays() -> bool:
            """A page may report an earlier place once more before it has heard of this one."""
            self.camera.position, self.camera.look_at = position + shift, at + shift
            return not until(lambda: not np.allclose(self.camera.look_at, at + shift, atol=1e-6), 0.5)

        assert until(stays, PATIENCE)

    def pixel(self, place: np.ndarray) -> np.ndarray:
        """Column and row at which the browser's camera sees a place in the world [m]."""
        camera = self.camera
        turn = Rotation.from_quat(camera.wxyz, scalar_first=True)
        # The camera looks along its z, and its y points down.
        x, y, z = turn.inv().apply(place - camera.position)
        focal = camera.image_height / 2.0 / np.tan(camera.fov / 2.0)
        middle = np.array([camera.image_width, camera.image_height]) / 2.0
        return np.asarray(middle + focal * np.array([x, y]) / z)

    def picture(self) -> np.ndarray:
        """The picture beside the panel, when it has come to rest, as numbers (rows, columns, 3)."""
        end = time.monotonic() + PATIENCE
        before, last = np.empty(0), np.empty(0)
        while len(last) == 0 or not np.array_equal(before, last):
            assert time.monotonic() < end, "the picture does not come to rest"
            time.sleep(0.5)
            before, last = last, self.page.screenshot()[:, :PANEL].astype(int)
        return last


@contextmanager
def showing(scene: Scene, folder: Path, acknowledge: Callable[[], str] | None = None) -> Iterator[Shown]:
    """A viewer of a scene, in a browser whose files are in a folder; `acknowledge`: as for `Viewer`."""
    server = serve_page("127.0.0.1", 0)
    viewer = Viewer(server, scene, acknowledge)
    over = threading.Event()
    # The page lowers its resolution by itself where drawing is slow; pictures could not be compared then.
    with browser_page(f"http://127.0.0.1:{server.get_port()}/?fixedDpr=1", folder) as (page, _):
        shown = Shown(page, server, viewer)

        def draw() -> None:
            viewer.draw(shown.frame(), "a note", shown.latches(), shown.failures)

        thread = threading.Thread(target=run, args=(draw, over))
        thread.start()
        try:
            page.wait_for("a note")
            page.wait_for("Software WebGL")
            page.evaluate("document.querySelector('.mantine-Notification-closeButton').click()")
            assert until(lambda: len(server.get_clients()) == 1, PATIENCE)
            # From then on the camera is the test's.
            assert until(shown.is_aimed, PATIENCE)
            yield shown
        finally:
            over.set()
            thread.join()
            viewer.close()
