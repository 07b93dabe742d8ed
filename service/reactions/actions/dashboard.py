"""Commands of the dashboard server (e-Series and CB3)."""

import re
from typing import Annotated, Any, Literal

from pydantic import Field, field_validator

from contactsense.service.reactions.actions.base import ActionError, ExecutedAction, Port, connection

_VALUES = ("rule", "level", "link", "force")
"""What a popup can show of a decision."""
_IN_BRACES = r"\{([^{}]*)\}"
_DONE = {"pause": "pausing program", "stop": "stopped", "popup": "showing popup"}
"""How the server answers a command that it carries out (Universal Robots, "Dashboard Server e-Series, port
29999"). Anything else is a refusal, or the answer of another server."""


class DashboardAction(ExecutedAction):
    """`pause` or `stop` the program, or show a `popup`; the first two need remote control."""

    type: Literal["dashboard"]
    """Kind of the action."""
    command: Literal["pause", "stop", "popup"]
    """What to do."""
    text: Annotated[str, Field(max_length=200)] = "{rule}: {force} N on {link}"
    """Text of the popup; {rule}, {level}, {link} and {force} are replaced by their values."""
    port: Port = 29999
    """Port of the dashboard server."""

    @field_validator("text")
    @classmethod
    def _has_known_values(cls, text: str) -> str:
        if "\r" in text or "\n" in text:
            raise ValueError(f"expected a single line, got {text!r:.60}")
        for name in re.findall(_IN_BRACES, text):
            if name not in _VALUES:
                expected = ", ".join(f"{{{value}}}" for value in _VALUES)
                raise ValueError(f"expected only {expected} in braces, got {{{name}}}")
        return text

    def perform(self, decision: dict[str, Any], host: str) -> str:
        """Send the command; see `ExecutedAction.perform`."""
        line: str = self.command
        if line == "popup":
            shown = {name: str(decision[name]) for name in _VALUES}
            shown["force"] = format(decision["force"], ".0f")
            filled = re.sub(_IN_BRACES, lambda found: shown[found[1]], self.text)
            # A name with a line break, as YAML's block texts have, would end the command and begin another.
            line = f"popup {' '.join(filled.split())}"
        with connection(host, self.port, self.timeout) as robot, robot.makefile("rb") as answers:
            greeting = answers.readline(1000)
            if not greeting:
                raise ActionError(f"{host}:{self.port}: expected a greeting, the server hung up")
            robot.sendall(line.encode("ascii", "replace") + b"\n")
            answer = answers.readline(1000).decode("utf-8", "replace").strip()
        if not answer.lower().startswith(_DONE[self.command]):
            raise ActionError(f"{host}:{self.port} answered {answer!r:.200} to {self.command!r}")
        return answer

    def describe(self) -> str:
        """Return a short description of the action."""
        return f"dashboard: {self.command}"
