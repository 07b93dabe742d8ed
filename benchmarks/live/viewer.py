"""`python -m benchmarks.live.viewer`: what the viewer costs the service, and what its pages get.

Service, simulated arm, viewer and pages are processes of one host. Stretches without a viewer, with one page
and with four pages and one that hangs alternate, so that other work on the host disturbs all of them alike.
"""

import contextlib
import json
import os
import platform
import tempfile
import time
from collections.abc import Iterator, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from statistics import median

import click
import numpy as np
import yaml

from contactsense.benchmarks.browser import BrowserError, browser_page
from contactsense.benchmarks.live.latency import collect
from contactsense.benchmarks.live.viewer_clients import Pages, pages
from contactsense.service.api.client import Client, ClientError
from contactsense.service.cli.options.finite_range import FiniteRange
from contactsense.service.demo.child_process import ChildError, child
from contactsense.service.demo.processes import Stage
from contactsense.service.mock.interfaces.rtde_server import RATE
from contactsense.service.mock.interfaces.sent_log import SentLog
from contactsense.service.viewer import READY

SCRIPT = {
    "robot": "ur5e",
    "rate": RATE,
    "noise": {"base_force": 0.25, "base_moment": 0.05, "joint_torque": 1.0, "seed": 1},
    "trajectory": {
        "start": [0.0, -1.3, 1.6, -1.9, -1.57, 0.0],
        "dwell": 0.0,
        "moves": [
            {"to": [0.9, -1.0, 1.3, -1.9, -1.2, 0.5], "duration": 4.0},
            {"to": [0.4, -1.7, 2.0, -1.4, -1.9, -0.4], "duration": 4.0},
            {"to": [0.0, -1.3, 1.6, -1.9, -1.57, 0.0], "duration": 4.0},
        ],
    },
    "contacts": [
        {
            "link": "forearm", "point": [-0.1747, 0.0373, 0.0095], "normal": [-0.0008, 0.9931, 0.1174],
            "push": 25.0, "start": 2.5 + 2.0 * k, "duration": 1.5,
        }
        for k in range(5)
    ],
}  # fmt: skip
"""The arm always moves, so that each frame has a new pose, and is pushed most of the time."""
CASES = ((0, 0), (1, 0), (4, 1))
"""Pages that read, and pages that hang."""


@dataclass(frozen=True, slots=True)
class Stretch:
    """One stretch of time."""

    pages: int
    """Pages that read; 0: no viewer runs."""
    hanging: int
    """Pages that hang."""
    lost: int
    """Samples without an estimate at a reader of the whole stream."""
    p50: float
    """Latency from packet to estimate [ms]."""
    p99: float
    frames: float
    """Poses of the arm a second, at the page that receives the fewest; NaN without pages."""
    core: float
    """Share of a processor core that the viewer takes; NaN where the system does not report it."""


def measure(seconds: float, rounds: int, browser: bool) -> list[Stretch]:
    """Run all cases in turn.

    Args:
        seconds: Length of a stretch [s].
        rounds: How often each case is measured.
        browser: Whether a real browser looks, too, wherever there is a viewer.

    Raises:
        ChildError: A process did not start.
        ClientError: The service stopped sending.
        BrowserError: There is no browser.
    """
    found = []
    with tempfile.TemporaryDirectory() as name, Stage("ur5e") as stage:
        folder = Path(name)
        (folder / "script.yaml").write_text(yaml.safe_dump(SCRIPT))
        log = SentLog(folder / "sent", rate=RATE)
        first = stage.start_service()
        first.close()  # a stretch reads the stream anew: one that nobody reads is closed
        url = first.url
        stage.start_arm("--loop", "--script", str(folder / "script.yaml"), "--sent-log", str(folder / "sent"))
        for number in range(rounds):
            for readers, hanging in CASES:
                with contextlib.ExitStack() as stack:
                    viewer = looking = None
                    if readers:
                        viewer = stack.enter_context(child("view", "--url", url, "--port", "0"))
                        page = viewer.wait_for(READY)
                        looking = stack.enter_context(pages(page, readers, hanging))
                        if browser:
                            profile = folder / f"profile {number} {readers}"
                            open_page, _ = stack.enter_context(browser_page(page, profile))
                            open_page.wait_for("ok: ")
                    client = stack.enter_context(Client(url))
                    pid = None if viewer is None else viewer.pid
                    found.append(_stretch(client, log, seconds, pid, looking, readers, hanging))
    return found


def _stretch(
    client: Client,
    log: SentLog,
    seconds: float,
    viewer: int | None,
    looking: Pages | None,
    readers: int,
    hanging: int,
) -> Stretch:
    if looking is not None:
        looking.frames()
    began, used = time.monotonic(), _processor_time(viewer)
    stamps, late = collect(client, log, seconds)
    frames = [] if looking is None else looking.frames()
    passed = time.monotonic() - began
    p50, p99 = np.percentile(late, [50, 99]).tolist()
    return Stretch(
        readers,
        hanging,
        round((stamps[-1] - stamps[0]) * RATE) + 1 - len(stamps),
        round(p50, 3),
        round(p99, 3),
        round(min(frames, default=float("nan")) / passed, 2),
        round((_processor_time(viewer) - used) / passed, 3),
    )


def _processor_time(process: int | None) -> float:
    """Processor time that a process has taken so far [s]; NaN where the system does not report it."""
    try:
        fields = Path(f"/proc/{process}/stat").read_text().rsplit(")", 1)[1].split()
    except OSError:
        return float("nan")
    return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")


def table(found: Sequence[Stretch]) -> Iterator[str]:
    """Medians of each case, line by line; latencies also as ratios to those without a viewer."""
    yield (
        f"{'pages':<22}{'lost':>6}{'p50 ms':>9}{'p99 ms':>9}{'ratio p50':>11}{'ratio p99':>11}"
        f"{'frames/s':>10}{'core %':>8}"
    )
    alone = [each for each in found if each.pages == 0]
    for readers, hanging in CASES:
        own = [each for each in found if (each.pages, each.hanging) == (readers, hanging)]
        name = f"{readers} and {hanging} that hangs" if hanging else str(readers) if readers else "no viewer"
        # Each with the stretch without a viewer beside it in time.
        ratio50 = median(a.p50 / b.p50 for a, b in zip(own, alone, strict=True))
        ratio99 = median(a.p99 / b.p99 for a, b in zip(own, alone, strict=True))
        line = (
            f"{name:<22}{sum(each.lost for each in own):>6}{median(each.p50 for each in own):>9.2f}"
            f"{median(each.p99 for each in own):>9.2f}{ratio50:>11.2f}{ratio99:>11.2f}"
        )
        if readers:
            line += (
                f"{median(each.frames for each in own):>10.1f}{100 * median(each.core for each in own):>8.0f}"
            )
        yield line


@click.command()
@click.option(
    "--seconds", default=20.0, show_default=True, type=FiniteRange(1.0), help="Length of a stretch."
)
@click.option(
    "--rounds", default=5, show_default=True, type=click.IntRange(1), help="How often each case is measured."
)
@click.option(
    "--browser", is_flag=True, help="Let a headless Chromium look, too; it draws by software, on this host."
)
@click.option("--json", "as_json", is_flag=True, help="Print every stretch as JSON.")
def main(seconds: float, rounds: int, browser: bool, as_json: bool) -> None:
    """Measure the service's losses and latency without and with the viewer, and the viewer's frames."""
    try:
        found = measure(seconds, rounds, browser)
    except (ChildError, ClientError, BrowserError) as error:
        raise click.ClickException(str(error)) from None
    if as_json:
        click.echo(json.dumps([asdict(each) for each in found]))
        return
    click.echo(
        f"{platform.machine()}, {os.cpu_count()} cores, load {os.getloadavg()[0]:.1f}; "
        f"medians of {rounds} stretches of {seconds:g} s, samples lost in all"
    )
    for line in table(found):
        click.echo(line)


if __name__ == "__main__":
    main()
