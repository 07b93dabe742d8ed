"""The dashboard server of a UR controller: one command per line, one answer per line.

Answers as in Universal Robots, "Dashboard Server e-Series, port 29999". The simulated robot is powered on,
its brakes are released and it is in remote control.
"""

import re
from collections.abc import Callable

from contactsense.service.mock.controller.robot_controller import RobotController
from contactsense.service.mock.controller.robot_state import RuntimeState
from contactsense.service.mock.interfaces.tcp_server import Connection, TcpServer

PORT = 29999
GREETING = "Connected: Universal Robots Dashboard Server"
PROGRAM = "mock.urp"
SERIAL_NUMBER = "20195000000"
_MOST_LINE = 4096


class DashboardServer(TcpServer):
    """Serves the dashboard of a simulated robot.

    Args:
        robot: The robot.
        version: Version of the controller's software.
        host, port: Where to listen; port 0: any free port.
    """

    def __init__(
        self,
        robot: RobotController,
        version: tuple[int, int, int, int],
        *,
        host: str = "127.0.0.1",
        port: int = PORT,
    ) -> None:
        super().__init__(host, port)
        self._robot = robot
        self._version = ".".join(str(number) for number in version)
        model = re.fullmatch(r"ur(\d+)e?", robot.cell.robot.name)
        self._model = f"UR{model[1]}" if model else robot.cell.robot.name
        self._answers: dict[str, Callable[[], str]] = {
            "play": self._play,
            "pause": lambda: "Pausing program" if robot.pause() else "Failed to execute: pause",
            "stop": self._stop,
            "running": lambda: f"Program running: {str(self._is_running()).lower()}",
            "robotmode": lambda: "Robotmode: RUNNING",
            "programstate": self._program_state,
            "get loaded program": lambda: f"Loaded program: {PROGRAM}",
            "safetymode": lambda: f"Safetymode: {self._safety()}",
            "safetystatus": lambda: f"Safetystatus: {self._safety()}",
            "unlock protective stop": self._unlock,
            "close popup": self._close_popup,
            "close safety popup": lambda: "closing safety popup",
            "polyscopeversion": lambda: f"URSoftware {self._version} (mock)",
            "version": lambda: self._version,
            "get serial number": lambda: SERIAL_NUMBER,
            "get robot model": lambda: self._model,
            "is in remote control": lambda: "true",
            "get operational mode": lambda: "NONE",
            "clear operational mode": lambda: (
                "No longer controlling the operational mode. Current mode: NONE"
            ),
            "power on": lambda: "Powering on",
            "brake release": lambda: "Brake releasing",
            "isprogramsaved": lambda: f"true {PROGRAM}",
        }
        self.start()

    def greet(self, connection: Connection) -> None:
        """Send the greeting."""
        connection.send(GREETING.encode() + b"\n")

    def receive(self, connection: Connection, data: bytes) -> None:
        """Answer each complete line."""
        connection.rest += data
        while (end := connection.rest.find(b"\n")) >= 0:
            line = connection.rest[:end].decode("utf-8", "replace").strip()
            del connection.rest[: end + 1]
            if line:
                connection.send(self.answer(line).encode() + b"\n")
            if line.lower() in ("quit", "shutdown"):
                connection.closing = True
        if len(connection.rest) > _MOST_LINE:
            connection.closing = True

    def answer(self, line: str) -> str:
        """Execute a command and return the answer of the dashboard."""
        command = line.lower()
        if command == "quit":
            return "Disconnected"
        if command.startswith("popup "):
            self._robot.popup = line[6:].strip()
            return "showing popup"
        if command.startswith("addtolog "):
            self._robot.send_message(line[9:].strip())
            return "Added log message"
        if command.startswith("load "):
            name = line[5:].strip()
            return f"Loading program: {name}" if name == PROGRAM else f"File not found: {name}"
        known = self._answers.get(command)
        return known() if known else f"could not understand: '{line}'"

    def _is_running(self) -> bool:
        return self._robot.runtime not in (RuntimeState.STOPPED, RuntimeState.PAUSED)

    def _play(self) -> str:
        return "Starting program" if self._robot.play() else "Failed to execute: play"

    def _stop(self) -> str:
        if self._robot.runtime is RuntimeState.STOPPED:
            return "Failed to execute: stop"
        self._robot.stop()
        return "Stopped"

    def _program_state(self) -> str:
        state = {RuntimeState.STOPPED: "STOPPED", RuntimeState.PAUSED: "PAUSED"}
        return f"{state.get(self._robot.runtime, 'PLAYING')} {PROGRAM}"

    def _safety(self) -> str:
        return "PROTECTIVE_STOP" if self._robot.protective else "NORMAL"

    def _unlock(self) -> str:
        if self._robot.unlock():
            return "Protective stop releasing"
        return (
            "Cannot unlock protective stop until 5s after occurrence. "
            "Always inspect cause of protective stop before unlocking"
        )

    def _close_popup(self) -> str:
        self._robot.popup = ""
        return "closing popup"
