"""`contactsense serve`: the service on HTTP and WebSocket."""

import contextlib
import logging
import signal
import socket
from pathlib import Path
from typing import Any

import click
import uvicorn

from service.app import create_app
from service.settings import Settings, SettingsError

READY = "serving at "
"""What the line on stdout begins with that tells the address."""


@click.command()
@click.option("--scene", type=click.Path(path_type=Path), help="Scene file (YAML).")
@click.option("--robot", help="Robot to assume where there is no scene file.  [default: ur5e]")
@click.option(
    "--robot-host", help="Address of the robot's controller; without it only POST /v1/locate works."
)
@click.option("--robot-port", type=int, help="Its RTDE port.  [default: 30004]")
@click.option("--robot-client", type=click.Choice(["rtde", "ur_rtde"]), help="Which client reads the robot.")
@click.option("--robot-rate", type=float, help="Robot samples a second.  [default: 500]")
@click.option("--ft-host", help="Address of the force/torque sensor under the base (Net F/T).")
@click.option("--ft-port", type=int, help="Its RDT port (UDP).  [default: 49152]")
@click.option("--ft-http-port", type=int, help="Port of its configuration page.  [default: 80]")
@click.option("--ft-counts", help="Its counts per N and per Nm, as 1000000,1000000, instead of asking it.")
@click.option("--ft-fields", help="Six RTDE fields that carry its reading, separated by commas.")
@click.option("--host", help="Address to serve at.  [default: 127.0.0.1]")
@click.option("--port", type=int, help="Port to serve at; 0 takes a free one.  [default: 8000]")
@click.option("--queue", type=int, help="Estimates kept for a slow reader.  [default: 500]")
def serve(**options: Any) -> int:
    """Serve estimates over HTTP and WebSocket.

    Options that are not given are taken from environment variables (CONTACTSENSE_ROBOT_HOST and so on), then
    from the defaults. GET /docs on the running service describes the interface.
    """
    logging.basicConfig(level=logging.INFO, format="%(asctime)s %(levelname)s %(message)s")
    try:
        inherited = Settings.from_environment().model_dump(exclude_unset=True)
        given = {name: value for name, value in options.items() if value is not None}
        settings = Settings.checked({**inherited, **given}, "serve")
        app = create_app(settings)
    except SettingsError as error:
        raise click.ClickException(str(error)) from None
    try:
        listener = listen(settings.host, settings.port)
    except OSError as error:
        raise click.ClickException(
            f"cannot serve at {settings.host}:{settings.port}: {error.strerror}; --port 0 takes a free port"
        ) from None
    with listener:
        click.echo(f"{READY}http://{settings.host}:{listener.getsockname()[1]}")
        config = uvicorn.Config(
            app,
            log_config=None,
            log_level="warning",
            ws_per_message_deflate=False,  # compressing costs more time than it saves here
            timeout_graceful_shutdown=3,
        )
        # uvicorn shuts down in order on either signal, and then passes it on.
        signal.signal(signal.SIGTERM, signal.default_int_handler)
        with contextlib.suppress(KeyboardInterrupt):
            uvicorn.Server(config).run([listener])
    return 0


def listen(host: str, port: int) -> socket.socket:
    """A listening socket whose connections send each message at once.

    Otherwise TCP holds small messages back until the last one is acknowledged, for up to 40 ms: asyncio sees
    to that only for sockets that were opened by protocol number.

    Raises:
        OSError: the place cannot be had.
    """
    listener = socket.create_server((host, port), backlog=128)
    listener.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
    return listener
