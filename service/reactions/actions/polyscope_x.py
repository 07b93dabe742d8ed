"""Change the program state through the REST interface of PolyScope X (from 10.11)."""

import json
import urllib.error
import urllib.request
from typing import Any, Literal

from contactsense.service.reactions.actions.base import ActionError, ExecutedAction, Port, no_answer

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
        request = urllib.request.Request(
            f"http://{host}:{self.port}{PATH}",
            json.dumps({"action": self.action}).encode(),
            {"Content-Type": "application/json"},
            method="PUT",
        )
        try:
            with urllib.request.urlopen(request, timeout=self.timeout) as answer:
                return f"answered {answer.status}"
        except urllib.error.HTTPError as error:
            with error:
                raise ActionError(f"{host}:{self.port}{PATH} answered {error.code}") from None
        except OSError as error:
            raise ActionError(f"{host}:{self.port}{PATH}: {no_answer(error, self.timeout)}") from None

    def describe(self) -> str:
        """Return a short description of the action."""
        return f"PolyScope X: {self.action} the program"
