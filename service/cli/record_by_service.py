"""Lets a running service record to its own folder while this command runs."""

import contextlib
import signal
import time

import click
from rich.console import Console

from contactsense.service.group_signals import ignored
from contactsense.service.viewer.service_calls import ServiceCalls


def record_by_service(service: ServiceCalls, seconds: float | None) -> None:
    """Start the recording, wait, and stop it.

    Args:
        service: The running service.
        seconds: Duration [s]; None: until interrupted.

    Raises:
        LiveError: The service refuses or does not answer.
        ClickException: The recording stopped.
    """
    end = None if seconds is None else time.monotonic() + seconds
    console = Console(stderr=True, markup=False)
    service.recording(on=True)
    try:
        with contextlib.suppress(KeyboardInterrupt), console.status("recording") as status:
            while end is None or time.monotonic() < end:
                time.sleep(min(0.5, 0.5 if end is None else max(0.0, end - time.monotonic())))
                state = service.recording()
                if state.error:
                    raise click.ClickException(f"{service.url}: the recording stopped: {state.error}")
                status.update(f"{state.rows} samples in {state.folder}")
    finally:
        # Whoever presses Ctrl-C twice would leave the service recording.
        with ignored(signal.SIGINT, signal.SIGTERM):
            service.recording(on=False)
    deadline = time.monotonic() + 5.0
    state = service.recording()
    rows = -1
    while state.rows != rows and time.monotonic() < deadline:
        rows = state.rows
        time.sleep(0.5)
        state = service.recording()
    click.echo(f"{state.rows} samples recorded by the service into {state.folder}")
