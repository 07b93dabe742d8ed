"""Stop the motion by sending a short program, which replaces the running one."""

from typing import Annotated, Any, Literal

from pydantic import Field

from contactsense.service.reactions.actions.base import ExecutedAction, connection

PORTS = {"primary": 30001, "secondary": 30002, "realtime": 30003}


class StopProgramAction(ExecutedAction):
    """Sends `stopj` as a `def` program to one of the controller's client interfaces; needs remote control."""

    type: Literal["stop_program"]
    """Kind of the action."""
    deceleration: Annotated[float, Field(ge=0.01, le=100.0)] = 8.0
    """Deceleration of the fastest joint [rad/s^2]."""
    interface: Literal["primary", "secondary", "realtime"] = "secondary"
    """Client interface to which the program is sent."""
    port: Annotated[int, Field(ge=1, le=65535)] | None = None
    """Port; None: 30001, 30002 or 30003, that of the interface."""

    @property
    def script(self) -> str:
        """Return the program."""
        return f"def contactsense_stop():\n  stopj({self.deceleration:g})\nend\n"

    def perform(self, decision: dict[str, Any], host: str) -> str:
        """Send the program; see `ExecutedAction.perform`."""
        port = self.port or PORTS[self.interface]
        with connection(host, port, self.timeout) as robot:
            robot.sendall(self.script.encode())
        return f"sent to {host}:{port}"

    def describe(self) -> str:
        """Return a short description of the action."""
        return (
            f"replace the robot's program by stopj({self.deceleration:g}), sent to "
            f"port {self.port or PORTS[self.interface]}"
        )
