"""`contactsense mock`: a simulated arm served over the real protocols."""

import signal
import socket
import threading
from pathlib import Path

import click
import numpy as np

from contactsense.scene import Scene, SceneError
from contactsense.service.cli.options.output_file import check_writable
from contactsense.service.free_ports import PortError, Wanted, check
from contactsense.service.live.scheduling import prefer_low_latency
from contactsense.service.mock import READY
from contactsense.service.mock.arm.cell import Cell
from contactsense.service.mock.arm.script import Script, ScriptError
from contactsense.service.mock.controller.robot_controller import RobotController
from contactsense.service.mock.interfaces.rtde_server import PORT
from contactsense.service.mock.live_servers import InterfacePorts, LiveServers
from contactsense.service.mock.servers import MockSettings
from contactsense.service.wire.rtde_fields import JOINTS

_PORT = click.IntRange(0, 65535)
_FURTHER = "  [default: its usual port if RTDE has its own, else none; 0 takes a free one]"


@click.command()
@click.option(
    "--script", type=click.Path(path_type=Path), help="What the arm does (YAML); default: the demo's script."
)
@click.option(
    "--scene",
    type=click.Path(path_type=Path),
    help="Scene (YAML) to simulate: its arm, mounting, tool and sensors.",
)
@click.option("--host", default="127.0.0.1", show_default=True, help="Address to listen at.")
@click.option(
    "--rtde-port", type=_PORT, default=PORT, show_default=True, help="RTDE port (TCP); 0 takes a free one."
)
@click.option(
    "--ft-port", type=_PORT, default=49152, show_default=True, help="Force/torque sensor's port (UDP)."
)
@click.option(
    "--ft-http-port",
    type=_PORT,
    default=49180,
    show_default=True,
    help="Port of its configuration page (TCP).",
)
@click.option("--dashboard-port", type=_PORT, help=f"Dashboard server (TCP).{_FURTHER}")
@click.option("--primary-port", type=_PORT, help=f"Primary client interface (TCP).{_FURTHER}")
@click.option("--secondary-port", type=_PORT, help=f"Secondary client interface (TCP).{_FURTHER}")
@click.option("--realtime-port", type=_PORT, help=f"Real-time client interface (TCP).{_FURTHER}")
@click.option("--loop", is_flag=True, help="Repeat the script; it must end where it begins.")
@click.option(
    "--sent-log", type=click.Path(path_type=Path), help="File to record when each robot packet left."
)
@click.option(
    "--contact-log",
    type=click.Path(path_type=Path),
    help="File (JSON) to write at the end: each contact with an obstacle, its peak force and depth.",
)
@click.option(
    "--received-log",
    type=click.Path(path_type=Path),
    help="File to record when a reaction's registers were written.",
)
def mock(
    script: Path | None,
    scene: Path | None,
    host: str,
    rtde_port: int,
    ft_port: int,
    ft_http_port: int,
    dashboard_port: int | None,
    primary_port: int | None,
    secondary_port: int | None,
    realtime_port: int | None,
    loop: bool,
    sent_log: Path | None,
    contact_log: Path | None,
    received_log: Path | None,
) -> int:
    """Simulate a UR arm with its controller, and the force/torque sensor under its base.

    Supports RTDE, the dashboard, the client interfaces and Net F/T like the real devices, so that their
    clients can read and control it. Time stamps are seconds since the beginning of the script. Runs until
    interrupted.
    """
    try:
        robot = simulated_robot(script, scene, loop)
    except (ScriptError, SceneError) as error:
        raise click.ClickException(str(error)) from None
    logs = {"--sent-log": sent_log, "--received-log": received_log, "--contact-log": contact_log}
    for option, log in logs.items():
        check_writable(option, log)
    settings = MockSettings(
        host=host,
        rtde_port=rtde_port,
        netft_port=ft_port,
        http_port=ft_http_port,
        loop=loop,
        sent_log=sent_log,
        received_log=received_log,
    )
    usual = InterfacePorts() if rtde_port == PORT else InterfacePorts(None, None, None, None)
    ports = InterfacePorts(
        usual.dashboard if dashboard_port is None else dashboard_port,
        usual.primary if primary_port is None else primary_port,
        usual.secondary if secondary_port is None else secondary_port,
        usual.realtime if realtime_port is None else realtime_port,
    )
    return _run(robot, settings, ports, contact_log)


def simulated_robot(script: Path | None, scene: Path | None, loop: bool) -> RobotController:
    """The robot that a script and a scene describe.

    Raises:
        ScriptError: The script cannot be read, or does not fit the scene.
        SceneError: The scene cannot be read.
    """
    played = Script.demo() if script is None else Script.load(script)
    if scene is None:
        cell = Cell.of_script(played)
    else:
        described = Scene.load(scene)
        cell = Cell.of_scene(described)
        if script is None:
            # The demo's contacts are for a UR5e; another arm only moves.
            played = played.model_copy(update={"robot": described.robot.name, "contacts": ()})
        elif played.robot != described.robot.name:
            raise ScriptError(
                f"{script}: robot: expected that of the scene, {described.robot.name}, got {played.robot}"
            )
    if len(cell.robot.joints) != JOINTS:
        raise ScriptError(
            f"robot: expected an arm with {JOINTS} joints, as RTDE has them, got {cell.robot.name} with "
            f"{len(cell.robot.joints)}"
        )
    start, end = played.trajectory.start, played.trajectory.end
    if loop and np.abs(np.subtract(start, end)).max() >= 1e-3:
        raise ScriptError(
            f"--loop: expected a script that ends where it begins, got {np.round(start, 3).tolist()} and "
            f"{np.round(end, 3).tolist()}"
        )
    return RobotController(cell, played, loop=loop)


def _run(
    robot: RobotController, settings: MockSettings, ports: InterfacePorts, contact_log: Path | None
) -> int:
    over = threading.Event()
    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, lambda *_: over.set())
    prefer_low_latency()  # a pause of this process would be a burst on all its wires
    try:
        check(settings.host, _wanted(settings, ports))
    except PortError as error:
        raise click.ClickException(str(error)) from None
    with LiveServers(robot, settings, ports) as servers:
        click.echo(
            f"{READY}{settings.host}: RTDE port {servers.rtde.port}, force/torque port {servers.netft.port}, "
            f"its configuration page on port {servers.netft.http_port}{_further(servers)}"
        )
        over.wait()
    if contact_log is not None:
        try:
            robot.contacts.save(contact_log)
        except OSError as error:
            raise click.ClickException(f"{contact_log}: {error.strerror}") from None
    return 0


def _wanted(settings: MockSettings, ports: InterfacePorts) -> list[Wanted]:
    """All ports that will be opened."""
    further = {
        "--dashboard-port": ports.dashboard,
        "--primary-port": ports.primary,
        "--secondary-port": ports.secondary,
        "--realtime-port": ports.realtime,
    }
    return [
        Wanted("--rtde-port", settings.rtde_port),
        Wanted("--ft-port", settings.netft_port, socket.SOCK_DGRAM),
        Wanted("--ft-http-port", settings.http_port),
        *(Wanted(option, port) for option, port in further.items() if port is not None),
    ]


def _further(servers: LiveServers) -> str:
    named = {} if servers.dashboard is None else {"dashboard": servers.dashboard.port}
    named |= {name: server.port for name, server in servers.interfaces.items()}
    return "".join(f", {name} port {port}" for name, port in named.items())
