"""`contactsense serve`: runs the service over HTTP and WebSocket."""

import contextlib
import errno
import logging
import os
import shlex
import signal
import socket
import ssl
from pathlib import Path
from types import FrameType
from typing import Any

import click
import uvicorn
from fastapi import FastAPI
from rich.console import Console

from contactsense.robots.jit.compilation import CompilationProgress
from contactsense.robots.jit.progress_bar import CompilationBar
from contactsense.service import logs
from contactsense.service.api import READY
from contactsense.service.api.app import create_app
from contactsense.service.api.exposure import check_exposure
from contactsense.service.api.http.connections import http_protocol, websocket_protocol
from contactsense.service.api.sample_source import unused
from contactsense.service.api.settings import Settings, SettingsError
from contactsense.service.api.variables import GROUPED, empty_token, misspelled
from contactsense.service.cli.options.option_names import as_options, refusal
from contactsense.service.cli.options.sensor_options import sensor_options
from contactsense.service.free_ports import PortError, reason
from contactsense.service.live.scheduling import prefer_low_latency, prioritize
from contactsense.service.scene.summary import scene_warnings


@click.command()
@click.option("--scene", type=click.Path(path_type=Path), help="Scene file (YAML).")
@click.option("--robot", help="Robot to assume where there is no scene file.  [default: ur5e]")
@sensor_options(
    "Address of the robot's controller; without it only POST /v1/locate and WS /v1/track work. With --source "
    "push: the robot that reactions act on."
)
@click.option("--host", help="Address to serve at.  [default: 127.0.0.1]")
@click.option("--port", type=int, help="Port to serve at; 0 takes a free one.  [default: 8000]")
@click.option(
    "--reactions",
    type=click.Path(path_type=Path),
    help="Rules of reactions (YAML); default: reactions.yaml beside the scene file, if there is one.",
)
@click.option("--recordings", type=click.Path(path_type=Path), help="Folder for clips and recordings.")
@click.option("--journal", type=click.Path(path_type=Path), help="File for events; default: in memory.")
@click.option(
    "--token-file",
    type=click.Path(path_type=Path),
    help="File with the token that requests must send; or CONTACTSENSE_TOKEN in the environment.",
)
@click.option("--tls-certificate", type=click.Path(path_type=Path), help="Certificate for TLS (PEM).")
@click.option("--tls-key", type=click.Path(path_type=Path), help="Its private key (PEM).")
@click.option("--insecure-no-tls", is_flag=True, default=None, help="Serve other computers without TLS.")
@click.option(
    "--allowed-host",
    "allowed_hosts",
    multiple=True,
    help="Further host name that requests may use; may be repeated.",
)
@click.option(
    "--allowed-origin",
    "allowed_origins",
    multiple=True,
    help="Origin of a web page that may use the service; may be repeated.",
)
@click.option("--max-connections", type=int, help="Largest number of open connections.  [default: 200]")
@click.option("--max-body", type=int, help="Largest body of a request, in bytes.  [default: 8000000]")
@click.option(
    "--constant-readings",
    is_flag=True,
    default=None,
    help="Accept readings that never change, as those of a simulator without noise.",
)
@click.option(
    "--log-level",
    type=click.Choice(["debug", "info", "warning", "error"]),
    help="Lowest level of what is logged.  [default: info]",
)
@click.option(
    "--log-format", type=click.Choice(["text", "json"]), help="Text for people, or JSON.  [default: text]"
)
@click.option("--log-file", type=click.Path(path_type=Path), help="Log to this file, of bounded size.")
@click.option(
    "--source",
    type=click.Choice(["robot", "push"]),
    help="Where samples come from: read from the robot, or pushed by a controller over WS /v1/track.  "
    "[default: robot]",
)
@click.option(
    "--xmlrpc-port",
    type=int,
    help="Port for XML-RPC calls of robot programs; 0 takes a free one.  [default: closed]",
)
@click.option(
    "--line-port",
    type=int,
    help="Port of the line socket for robot programs; 0 takes a free one.  [default: closed]",
)
@click.option("--controller-host", help="Address of these two ports.  [default: 127.0.0.1]")
@click.option(
    "--controller-clients", help="Addresses of robots that may connect to them, separated by commas."
)
@click.option("--queue", type=int, help="Estimates kept for a slow reader.  [default: 500]")
def serve(**options: Any) -> int:
    """Serve estimates over HTTP and WebSocket.

    Options that are not given are taken from environment variables (CONTACTSENSE_ROBOT_HOST and so on), then
    from the defaults. GET /docs on the running service describes the interface.
    """
    bar = _loading_display()
    try:
        inherited = Settings.from_environment().model_dump(exclude_unset=True)
        given = {name: value for name, value in options.items() if value not in (None, ())}
        groups: dict[str, dict[str, Any]] = {}
        for option, group, field in GROUPED:
            if option in given:
                groups.setdefault(group, dict(inherited.get(group, {})))[field] = given.pop(option)
        settings = Settings.checked({**inherited, **given, **groups}, "serve", as_options(GROUPED))
        check_exposure(settings)
        _configure_log(settings)
        app = create_app(settings, on_loading=bar.update)
        scene, log = app.state.service.scene, logging.getLogger("contactsense")
        for warning in scene_warnings(scene):
            log.warning("scene: %s", warning)
        own = (*misspelled(os.environ, Settings.model_fields), *empty_token(os.environ))
        for line in (*unused(settings, scene), *own):
            log.warning("%s", line)
    except SettingsError as error:
        raise refusal(error) from None
    try:
        listener = listen(settings.host, settings.port)
    except OSError as error:
        raise click.ClickException(
            f"cannot serve at {settings.host}:{settings.port}: {reason(error)}; --port 0 takes a free port"
        ) from None
    with listener:
        try:  # while the service's own port is open, as it may be one of these
            app.state.service.ports.check()
        except PortError as error:
            raise click.ClickException(str(error)) from None
        config = _server_config(app, settings)
        scheme = "http" if settings.tls_certificate is None else "https"
        url = f"{scheme}://{settings.host}:{listener.getsockname()[1]}"
        click.echo(f"{READY}{url}")
        click.echo(pages(url, settings.token_file))
        prioritize()
        prefer_low_latency()
        # An interrupt may come before the server handles it.
        with contextlib.suppress(KeyboardInterrupt):
            _Server(config).run([listener])
    return 0


def _configure_log(settings: Settings) -> None:
    try:
        logs.configure(settings.log_level, settings.log_format, settings.log_file)
    except OSError as error:
        raise click.ClickException(f"--log-file: {settings.log_file}: {error.strerror}") from None


def _server_config(app: FastAPI, settings: Settings) -> uvicorn.Config:
    """How uvicorn serves the application; certificate and key are loaded.

    Raises:
        click.ClickException: They cannot be used.
    """
    limits = app.state.service.connections
    config = uvicorn.Config(
        app,
        http=http_protocol(limits),
        ws=websocket_protocol(limits),
        ws_max_size=1_000_000,
        ssl_certfile=settings.tls_certificate,
        ssl_keyfile=settings.tls_key,
        server_header=False,
        log_config=None,
        log_level="warning",
        ws_per_message_deflate=False,  # here compression costs more time than it saves
        timeout_graceful_shutdown=3,
    )
    try:
        config.load()
    except OSError as error:
        why = error.strerror
        if isinstance(error, ssl.SSLError):
            why = f"expected a certificate and its key in PEM: {why}"
        elif error.errno == errno.EINVAL:  # without a terminal nobody can be asked
            why = "expected a key without pass phrase, as `openssl pkey -in KEY -out PLAIN_KEY` writes it"
        raise click.ClickException(
            f"{settings.tls_certificate}, {settings.tls_key}: cannot be used for TLS: {why}"
        ) from None
    return config


def pages(url: str, token_file: Path | None) -> str:
    """Where a person at this computer finds the description and the viewer of the service at `url`."""
    here = url.replace("//0.0.0.0:", "//127.0.0.1:")  # an address to listen at, not to connect to
    token = "" if token_file is None else f" --token-file {shlex.quote(str(token_file))}"
    return f"interface: {here}/docs; viewer: contactsense view --url {here}{token}"


class _Server(uvicorn.Server):
    """Shuts down in order on SIGINT and SIGTERM, however often they come.

    uvicorn leaves out the shutdown at a second SIGINT, which would leave the pipeline to itself, and raises
    each signal again at the end. An impatient Ctrl-C, or one that a shell and `timeout` both pass on, would
    then end in a traceback.
    """

    _signal: signal.Signals | None = None

    def handle_exit(self, sig: int, frame: FrameType | None) -> None:
        """Begin to shut down."""
        self._signal = self._signal or signal.Signals(sig)
        self.should_exit = True

    async def shutdown(self, sockets: list[socket.socket] | None = None) -> None:
        """Log why the service ends, and shut down."""
        # Not in `handle_exit`: a signal may come while a line is being logged.
        if self._signal is not None:
            logging.getLogger("contactsense").info("the service ends: it received %s", self._signal.name)
        await super().shutdown(sockets)


class _LogLines:
    """Logs the progress of the first compilation, one line per tenth that is done. The service itself logs
    that it has begun."""

    def __init__(self) -> None:
        self._step = 0

    def update(self, progress: CompilationProgress) -> None:
        """Log this progress."""
        step = int(10.0 * progress.share)
        if step > self._step:
            self._step = step
            logging.getLogger("contactsense").info("%s", progress)


def _loading_display() -> "CompilationBar | _LogLines":
    console = Console(stderr=True)
    return CompilationBar(console) if console.is_terminal else _LogLines()


def listen(host: str, port: int) -> socket.socket:
    """Open a listening socket whose connections send each message at once.

    Otherwise TCP (Nagle's algorithm) delays small messages until the previous one is acknowledged, by up to
    40 ms. asyncio disables this only for sockets that were created with a protocol number.

    Raises:
        OSError: The address is not available.
    """
    listener = socket.create_server((host, port), backlog=128)
    listener.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
    return listener
