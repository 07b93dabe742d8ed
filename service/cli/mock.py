"""`contactsense mock`: a simulated arm on the wire."""

import signal
import threading
from pathlib import Path

import click
import numpy as np

from service.mock.arm import Motion, simulate
from service.mock.script import Script, ScriptError
from service.mock.servers import MockServers, MockSettings

READY = "mock arm at "
"""What the line on stdout begins with that tells the addresses."""


@click.command()
@click.option(
    "--script", type=click.Path(path_type=Path), help="What the arm does (YAML); default: the demo's script."
)
@click.option("--host", default="127.0.0.1", show_default=True, help="Address to listen at.")
@click.option("--rtde-port", default=30004, show_default=True, help="RTDE port (TCP); 0 takes a free one.")
@click.option("--ft-port", default=49152, show_default=True, help="Force/torque sensor's port (UDP).")
@click.option(
    "--ft-http-port", default=49180, show_default=True, help="Port of its configuration page (TCP)."
)
@click.option("--loop", is_flag=True, help="Begin anew after the end; the script must end where it begins.")
@click.option(
    "--sent-log", type=click.Path(path_type=Path), help="File in which to note when each robot packet left."
)
def mock(
    script: Path | None,
    host: str,
    rtde_port: int,
    ft_port: int,
    ft_http_port: int,
    loop: bool,
    sent_log: Path | None,
) -> int:
    """Simulate a UR arm and the force/torque sensor under its base.

    Speaks RTDE and Net F/T as the real devices do, so every client of theirs can read it. Time stamps are
    seconds since the beginning of the script. Runs until it is interrupted.
    """
    try:
        motion = simulate(Script.demo() if script is None else Script.load(script))
    except ScriptError as error:
        raise click.ClickException(str(error)) from None
    if loop and not motion.loops:
        raise click.ClickException(
            "--loop: expected a script that ends where it begins, got "
            f"{np.round(motion.q[0], 3).tolist()} and {np.round(motion.q[-1], 3).tolist()}"
        )
    return _run(
        motion,
        MockSettings(
            host=host,
            rtde_port=rtde_port,
            netft_port=ft_port,
            http_port=ft_http_port,
            loop=loop,
            sent_log=sent_log,
        ),
    )


def _run(motion: Motion, settings: MockSettings) -> int:
    over = threading.Event()
    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, lambda *_: over.set())
    try:
        servers = MockServers(motion, settings)
    except OSError as error:
        raise click.ClickException(f"cannot listen at {settings.host}: {error.strerror or error}") from None
    with servers:
        click.echo(
            f"{READY}{settings.host}: RTDE port {servers.rtde.port}, force/torque port {servers.netft.port}, "
            f"its configuration page on port {servers.netft.http_port}"
        )
        over.wait()
    return 0
