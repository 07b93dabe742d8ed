"""`contactsense view`: the arm and its contacts in a browser, live or from a file."""

import contextlib
import os
import signal
import socket
import sys
import threading
import time
from collections.abc import Iterator
from pathlib import Path
from urllib.parse import urlsplit

import click
from rich.console import Console
from rich.progress import BarColumn, Progress, TextColumn, TimeRemainingColumn

from contactsense.scene import Scene, SceneError
from contactsense.service.api.http.token_file import TokenError, read_token
from contactsense.service.cli.options.option_names import refusal
from contactsense.service.free_ports import reason
from contactsense.service.group_signals import never_lost
from contactsense.service.recordings import (
    ColumnMapping,
    MappingError,
    RecordingError,
    RecordingFile,
    scene_in,
)
from contactsense.service.viewer import READY
from contactsense.service.viewer.analysis_source import AnalysisSource, is_analysis, tables_instead
from contactsense.service.viewer.live_source import LiveSource
from contactsense.service.viewer.recorded_source import RecordedSource
from contactsense.service.viewer.service_calls import AwayError, LiveError, ServiceCalls
from contactsense.service.viewer.viewer import PageServer, Viewer, run, serve_page

URL = "http://127.0.0.1:8000"
LOCAL = ("127.0.0.1", "localhost", "::1")
"""Addresses that other computers cannot reach."""
NAMED = 3
"""Tables that a message names."""
LESS_URGENT = 5
"""Added to the niceness of a viewer that runs beside its service."""
RETRY = 1.0
"""Time between two attempts to reach a service that has not come yet [s]."""


@click.command()
@click.argument("file", required=False, type=click.Path(path_type=Path))
@click.option("--url", help=f"Address of the service.  [default: {URL}]")
@click.option("--token-file", type=click.Path(path_type=Path), help="File with the service's token.")
@click.option(
    "--acknowledge", is_flag=True, help="Show a button that acknowledges the service's latched collisions."
)
@click.option(
    "--scene",
    "scene_path",
    type=click.Path(path_type=Path),
    help="Scene file (YAML).  [default: that of the service or recording]",
)
@click.option(
    "--columns",
    help="With FILE: names and units of columns or topics, as q=joint,time_unit=ms or a YAML file.",
)
@click.option("--host", default="127.0.0.1", show_default=True, help="Address to serve the page at.")
@click.option(
    "--port",
    type=click.IntRange(0, 65535),
    default=8080,
    show_default=True,
    help="Its port; 0 takes a free one.",
)
def view(
    file: Path | None,
    url: str | None,
    token_file: Path | None,
    acknowledge: bool,
    scene_path: Path | None,
    columns: str | None,
    host: str,
    port: int,
) -> int:
    """Show an arm, its contacts and how certain they are, in a browser.

    Without FILE: those of a service, once it runs. With FILE: a recording, which can be played, or the
    contacts.parquet of `contactsense analyze`. Runs until interrupted.
    """
    if file is not None and (url is not None or token_file is not None or acknowledge):
        raise click.UsageError("FILE: expected no --url, --token-file or --acknowledge beside it")
    if columns is not None and (file is None or is_analysis(file)):
        raise click.UsageError("--columns: expected FILE, a recording, beside it")
    if acknowledge and host not in LOCAL:
        raise click.UsageError(
            "--acknowledge: expected --host 127.0.0.1 beside it: whoever opens the page can press the button"
        )
    over = threading.Event()
    try:
        scene = None if scene_path is None else Scene.load(scene_path)
        if file is None:
            token = None if token_file is None else read_token(token_file)
            _live(URL if url is None else url, token, acknowledge, scene, host, port, over)
        else:
            # It takes minutes for a recording of hours.
            with never_lost(signal.SIGINT, signal.SIGTERM):
                source = _recorded(file, scene, ColumnMapping.parse(columns), host, port)
            _end_in_order(over)
            page = _page(host, port)
            viewer = Viewer(page, source.scene)
            viewer.add_controls(source.title, source.add_controls)
            run(lambda: _draw(viewer, source), over)
            viewer.close()
    except (SceneError, LiveError, RecordingError, MappingError, TokenError) as error:
        raise refusal(error) from None
    return 0


def _draw(viewer: Viewer, source: RecordedSource | AnalysisSource) -> None:
    frame = source.frame()
    if isinstance(source, AnalysisSource):
        viewer.face(frame.estimate)
    viewer.draw(frame, source.note())


def _end_in_order(over: threading.Event) -> None:
    """From now on a signal ends the drawing instead of the process."""
    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, lambda *_: over.set())


def _live(
    url: str,
    token: str | None,
    acknowledge: bool,
    scene: Scene | None,
    host: str,
    port: int,
    over: threading.Event,
) -> None:
    calls = ServiceCalls(url, token)
    _check_port(host, port)
    _give_way(url)
    source = _reached(calls, scene)
    try:
        _end_in_order(over)
        viewer = Viewer(_page(host, port), source.scene, source.acknowledge if acknowledge else None)
        run(
            lambda: viewer.draw(source.frame(), source.note(), source.latches, source.failures),
            over,
            source.news,
        )
        viewer.close()
    finally:
        source.close()


def _reached(calls: ServiceCalls, scene: Scene | None) -> LiveSource:
    """The source of a service, once it is there: it may be started after the viewer."""
    told = ""
    while True:
        try:
            return LiveSource(calls, scene)
        except AwayError as error:
            if str(error) != told:
                told = str(error)
                click.echo(f"{told}; waiting for the service, Ctrl-C ends", err=True)
        time.sleep(RETRY)


def _give_way(url: str) -> None:
    """Let a service on this computer go first. Only threads that are started later give way, too."""
    if urlsplit(url).hostname in LOCAL and sys.platform != "win32":
        os.nice(LESS_URGENT)


def _recorded(
    file: Path, scene: Scene | None, mapping: ColumnMapping, host: str, port: int
) -> RecordedSource | AnalysisSource:
    if is_analysis(file):
        return AnalysisSource(file, scene)
    tables = tables_instead(file)
    if tables:
        named, more = [str(table) for table in tables[:NAMED]], len(tables) - NAMED
        if more > 0:
            named.append("1 other" if more == 1 else f"{more} others")
        what = "the table of the contacts" if len(tables) == 1 else "one table of contacts"
        raise click.ClickException(f"{file}: expected {what}, {' or '.join(named)}")
    scene = scene_in(file) if scene is None else scene
    rows = RecordingFile(file, scene, mapping).rows
    _check_port(host, port)
    click.echo(f"{file}: the estimates are being computed", err=True)
    with Progress(
        TextColumn("{task.description}", markup=False), BarColumn(), TimeRemainingColumn(),
        console=Console(stderr=True), transient=True,
    ) as progress:  # fmt: skip
        task = progress.add_task(file.name, total=rows)
        source = RecordedSource(file, scene, mapping, lambda count: progress.advance(task, count))
    for problem in source.problems:
        click.echo(f"{file}: {problem}", err=True)
    return source


def _check_port(host: str, port: int) -> None:
    """Refuse an address that is taken before anybody waits, for a service or for estimates."""
    with _told(host, port), socket.create_server((host, port)):
        pass


def _page(host: str, port: int) -> PageServer:
    with _told(host, port):
        page = serve_page(host, port)
    click.echo(f"{READY}http://{host}:{page.get_port()}")
    return page


@contextlib.contextmanager
def _told(host: str, port: int) -> Iterator[None]:
    """Tell in one line why an address cannot be served at."""
    try:
        yield
    except OSError as error:
        raise click.ClickException(
            f"cannot serve at {host}:{port}: {reason(error)}; --port 0 takes a free port"
        ) from None
