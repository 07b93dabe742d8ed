"""Change the program state through the REST interface of PolyScope X (from 10.11)."""

import json
from typing import Any, Literal

from contactsense.service.reactions.actions.base import ActionError, ExecutedAction, Port
from contactsense.service.reactions.actions.http_request import request

PATH = "/universal-robots/robot-api/program/v1/state"


class PolyscopeXAction(ExecutedAction):
    """`pause` or `stop` the program; from 10.14 inbound port 80 must be opened in the robot's settings."""

    type: Literal["polyscope_x"]
    """Kind of the action."""
    action: Literal["pause", "stop"] = "pause"
    """What to do with the program."""
    port: Port = 80
    """Port of the REST interface."""

    def perform(self, decision: dict[str, Any], host: str) -> str:
        """Send the request; see `ExecutedAction.perform`."""
        where = f"{host}:{self.port}{PATH}"
        body, headers = json.dumps({"action": self.action}).encode(), {"Content-Type": "application/json"}
        try:
            status = request(f"http://{where}", "PUT", body, headers, self.timeout, direct=True)
        except ActionError as error:
            raise ActionError(f"{where}: {error}") from None
        if not 200 <= status < 300:
            raise ActionError(f"{where} answered {status}")
        return f"answered {status}"

    def describe(self) -> str:
        """Return a short description of the action."""
        return f"PolyScope X: {self.action} the program"
