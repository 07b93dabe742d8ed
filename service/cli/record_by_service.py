"""Lets a running service record to its own folder while this command runs."""

import contextlib
import json
import signal
import time
import urllib.error
import urllib.request
from collections.abc import Iterator
from typing import Any

import click
from rich.console import Console


@contextlib.contextmanager
def ended_by_signals() -> Iterator[None]:
    """Make SIGTERM end the block like Ctrl-C."""
    before = signal.signal(signal.SIGTERM, signal.default_int_handler)
    try:
        yield
    finally:
        signal.signal(signal.SIGTERM, before)


def record_by_service(url: str, seconds: float | None) -> None:
    """Start the recording, wait, and stop it.

    Args:
        url: Address of the service.
        seconds: Duration [s]; None: until interrupted.

    Raises:
        ClickException: The service refuses or does not answer.
    """
    place = f"{url.rstrip('/')}/v1/recording"
    end = None if seconds is None else time.monotonic() + seconds
    console = Console(stderr=True)
    _call(place, {"on": True})
    try:
        with (
            ended_by_signals(),
            contextlib.suppress(KeyboardInterrupt),
            console.status("recording") as status,
        ):
            while end is None or time.monotonic() < end:
                time.sleep(min(0.5, 0.5 if end is None else max(0.0, end - time.monotonic())))
                state = _call(place)
                if state["error"]:
                    raise click.ClickException(f"{url}: the recording stopped: {state['error']}")
                status.update(f"{state['rows']} samples in {state['folder']}")
    finally:
        _call(place, {"on": False})
    deadline = time.monotonic() + 5.0
    state = _call(place)
    rows = -1
    while state["rows"] != rows and time.monotonic() < deadline:
        rows = state["rows"]
        time.sleep(0.5)
        state = _call(place)
    click.echo(f"{state['rows']} samples recorded by the service into {state['folder']}")


def _call(place: str, body: dict[str, Any] | None = None) -> dict[str, Any]:
    data = None if body is None else json.dumps(body).encode()
    request = urllib.request.Request(place, data, {"Content-Type": "application/json"})
    try:
        with urllib.request.urlopen(request, timeout=10.0) as response:
            found: dict[str, Any] = json.load(response)
            return found
    except urllib.error.HTTPError as error:
        with contextlib.suppress(ValueError, KeyError, IndexError):
            raise click.ClickException(f"{place}: {json.load(error)['errors'][0]['reason']}") from None
        raise click.ClickException(f"{place}: {error.code} {error.reason}") from None
    except (urllib.error.URLError, TimeoutError, ValueError) as error:
        raise click.ClickException(
            f"{place}: no answer from a service: {getattr(error, 'reason', error)}"
        ) from None
