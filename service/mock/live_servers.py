"""Servers of a simulated controller with all its interfaces, and of the force/torque sensor under the arm."""

from contextlib import ExitStack
from dataclasses import dataclass

import numpy as np

from contactsense.service.mock.controller.robot_controller import RobotController
from contactsense.service.mock.interfaces.client_interfaces import (
    PRIMARY,
    REALTIME,
    SECONDARY,
    ClientInterface,
)
from contactsense.service.mock.interfaces.dashboard_server import PORT as DASHBOARD
from contactsense.service.mock.interfaces.dashboard_server import DashboardServer
from contactsense.service.mock.interfaces.live_fields import LiveController
from contactsense.service.mock.interfaces.netft_server import NetFtServer
from contactsense.service.mock.interfaces.received_log import ReceivedLog
from contactsense.service.mock.interfaces.rtde_server import RATE, RtdeServer
from contactsense.service.mock.interfaces.sent_log import SentLog
from contactsense.service.mock.playback import SimClock
from contactsense.service.mock.servers import MockSettings


@dataclass(frozen=True, slots=True)
class InterfacePorts:
    """Ports of the controller's further interfaces. 0: any free port; None: interface disabled."""

    dashboard: int | None = DASHBOARD
    primary: int | None = PRIMARY
    secondary: int | None = SECONDARY
    realtime: int | None = REALTIME

    @classmethod
    def free(cls) -> "InterfacePorts":
        """Return settings with all interfaces enabled, each on a free port."""
        return cls(0, 0, 0, 0)


class LiveServers:
    """All servers, running from construction to `close`.

    Args:
        robot: The simulated robot.
        settings: Where to listen; `loop` is the robot's.
        ports: Further interfaces.

    Raises:
        OSError: A port is in use.
    """

    def __init__(
        self,
        robot: RobotController,
        settings: MockSettings | None = None,
        ports: InterfacePorts | None = None,
    ) -> None:
        chosen, further = settings or MockSettings(), ports or InterfacePorts()
        self.robot = robot
        self.controller = LiveController(robot, chosen.version)
        self.sent = SentLog(chosen.sent_log, rate=RATE)
        log = chosen.received_log
        received = None if log is None else ReceivedLog(log, rate=RATE)
        self.dashboard: DashboardServer | None = None
        self.interfaces: dict[str, ClientInterface] = {}
        self._stack = ExitStack()
        with ExitStack() as opened:
            self.clock = SimClock()
            self.rtde = opened.enter_context(
                RtdeServer(
                    self.controller,
                    self.clock,
                    host=chosen.host,
                    port=chosen.rtde_port,
                    delay=chosen.rtde_delay,
                    sent=self.sent,
                    received=received,
                )
            )
            robot.on_message.append(self._tell_rtde)
            opened.callback(robot.on_message.remove, self._tell_rtde)
            self.netft = opened.enter_context(
                NetFtServer(
                    self._base_reading,
                    self.clock,
                    host=chosen.host,
                    port=chosen.netft_port,
                    http_port=chosen.http_port,
                    rate=chosen.netft_rate,
                    delay=chosen.netft_delay + robot.cell.base_delay,
                )
            )
            if further.dashboard is not None:
                self.dashboard = DashboardServer(
                    robot, chosen.version, host=chosen.host, port=further.dashboard
                )
                opened.callback(self.dashboard.close)
            for name, port in (
                ("primary", further.primary),
                ("secondary", further.secondary),
                ("realtime", further.realtime),
            ):
                if port is not None:
                    server = ClientInterface(self.controller, name, host=chosen.host, port=port)  # type: ignore[arg-type]
                    opened.callback(server.close)
                    self.interfaces[name] = server
            self._stack = opened.pop_all()

    def _base_reading(self, t: float) -> np.ndarray:
        return self.robot.at(t).base

    def _tell_rtde(self, message: str) -> None:
        self.rtde.say(message, source="mock")

    def close(self) -> None:
        """Stop all servers."""
        self._stack.close()

    def __enter__(self) -> "LiveServers":
        return self

    def __exit__(self, *_: object) -> None:
        self.close()
