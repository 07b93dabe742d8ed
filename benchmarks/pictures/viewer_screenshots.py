"""`python -m benchmarks.pictures.viewer_screenshots`: the pictures of the viewer in the docs.

The measurements are those of `contactsense demo`, made into a recording; a headless Chromium shows what the
viewer makes of it.
"""

import tempfile
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

import click
import numpy as np

from contactsense import Scene
from contactsense.benchmarks.browser import BrowserError, Page, browser_page
from contactsense.robots.surface.rendering import save, side_by_side
from contactsense.service.mock.arm.script import Script
from contactsense.service.mock.arm.simulated_arm import simulate
from contactsense.service.recordings.export import write_columns
from contactsense.service.viewer.playback import Playback
from contactsense.service.viewer.viewer import PageServer, Viewer, run, serve_page

DOCS = Path(__file__).resolve().parents[2] / "docs"
BOTH = Scene(robot="ur5e")
TORQUES = Scene(robot="ur5e", base_wrench=None)
CONTACT, AMBIGUOUS = 5.5, 20.2
"""Times in the demo [s]: a push on the upper arm, and one on the first wrist."""
STORY = (2.5, 3.6, 5.5, 7.9)
"""Times in the demo [s]: nothing, then pushes on three links, the last one on the move."""
SIZE = (1000, 640)
"""Of the browser's window."""
Camera = tuple[tuple[float, float, float], tuple[float, float, float]]
"""Place of the camera, and what it looks at [m]."""
ALL: Camera = ((0.59, -0.67, 0.6), (0.0, 0.0, 0.3))
ASIDE: Camera = ((0.15, -1.05, 0.75), (0.15, 0.0, 0.32))
STRIP = (slice(100, 370), slice(0, 385))
"""Rows and columns of a picture of the story."""
AT_REST = 4
"""Number of seconds without a change after which a picture counts as complete: software draws slowly."""
PATIENCE = 240.0


@dataclass(frozen=True)
class Screen:
    """A viewer of the demo in a browser."""

    page: Page
    server: PageServer
    shown: list[float]
    """The time that is shown [s]."""

    def at(self, time_shown: float, camera: Camera) -> np.ndarray:
        """What the browser shows of a time [s], when it has come to rest, shape (rows, columns, 3).

        Raises:
            BrowserError: It does not come to rest.
        """
        (client,) = self.server.get_clients().values()
        client.camera.position, client.camera.look_at = np.array(camera[0]), np.array(camera[1])
        self.shown[0] = time_shown
        self.page.wait_for(_note(time_shown))
        last, unchanged = np.empty(0), 0
        end = time.monotonic() + PATIENCE
        while unchanged < AT_REST:
            if time.monotonic() > end:
                raise BrowserError("the picture does not come to rest")
            time.sleep(1.0)
            before, last = last, self.page.screenshot()
            unchanged = unchanged + 1 if np.array_equal(before, last) else 0
        return last


def _note(time_shown: float) -> str:
    return f"the demo's measurements, after {time_shown:.1f} s"


def record(path: Path) -> None:
    """Write the measurements of the demo as a recording."""
    motion = simulate(Script.demo())
    columns = {"timestamp": motion.t}
    for name, values in (
        ("actual_q", motion.q), ("actual_qd", motion.qd), ("joint_torque", motion.joint_torque),
        ("base_wrench", motion.base_wrench),
    ):  # fmt: skip
        columns |= {f"{name}_{i}": values[:, i] for i in range(values.shape[1])}
    write_columns(path, columns)


@contextmanager
def screen(scene: Scene, recording: Path, profile: Path) -> Iterator[Screen]:
    """A viewer of a recording in a browser whose files are in `profile`.

    Raises:
        BrowserError: There is no browser, or it does not start.
    """
    playback = Playback.open(scene, recording)
    server = serve_page("127.0.0.1", 0)
    viewer, over, shown = Viewer(server, scene), threading.Event(), [0.0]

    def draw() -> None:
        viewer.draw(playback.at(shown[0]), _note(shown[0]))

    thread = threading.Thread(target=run, args=(draw, over))
    thread.start()
    try:
        with browser_page(f"http://127.0.0.1:{server.get_port()}/?fixedDpr=1", profile, SIZE) as (page, _):
            page.wait_for("Software WebGL")
            page.evaluate("document.querySelector('.mantine-Notification-closeButton').click()")
            while not server.get_clients():
                time.sleep(0.1)
            yield Screen(page, server, shown)
    finally:
        over.set()
        thread.join()
        viewer.close()


@click.command()
@click.option(
    "--folder", type=click.Path(path_type=Path, file_okay=False, exists=True), default=DOCS, show_default=True
)
def main(folder: Path) -> None:
    """Write view_contact.png, view_ambiguous.png and demo.png."""
    with tempfile.TemporaryDirectory() as name:
        recording = Path(name) / "demo.parquet"
        record(recording)
        try:
            with screen(BOTH, recording, Path(name) / "both") as both:
                story = [both.at(moment, ASIDE)[STRIP] for moment in STORY]
                save(side_by_side(story), folder / "demo.png")
                save(both.at(CONTACT, ALL), folder / "view_contact.png")
            with screen(TORQUES, recording, Path(name) / "torques") as torques:
                save(torques.at(AMBIGUOUS, ALL), folder / "view_ambiguous.png")
        except BrowserError as error:
            raise click.ClickException(str(error)) from None


if __name__ == "__main__":
    main()
