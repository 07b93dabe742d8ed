"""Run a user's command with the decision as JSON on its standard input."""

import json
import os
import shutil
import subprocess
from collections.abc import Callable
from typing import Annotated, Any, Literal

from pydantic import Field, PrivateAttr, ValidationInfo, field_validator

from contactsense.service.reactions.actions.base import ActionError, ExecutedAction
from contactsense.service.reactions.actions.child_group import ChildGroup


class CommandAction(ExecutedAction):
    """A program and its arguments; no shell."""

    type: Literal["command"]
    """Kind of the action."""
    command: Annotated[tuple[str, ...], Field(min_length=1)]
    """The program and its arguments; a path of the program is relative to the folder of the rules."""
    timeout: Annotated[float, Field(gt=0.0, le=3600.0)] = 10.0
    """Time after which the program and its children are killed [s]."""
    _group: ChildGroup | None = PrivateAttr(None)  # of the executor's process; rules are sent to another one

    @field_validator("command")
    @classmethod
    def _beside_the_rules(cls, command: tuple[str, ...], info: ValidationInfo) -> tuple[str, ...]:
        # A name without a folder is looked for on the path. A service that the computer starts works in
        # another folder than whoever tries the rules.
        program, folder = command[0], (info.context or {}).get("folder")
        if folder is None or os.path.dirname(program) == "":
            return command
        return (str((folder / program).absolute()), *command[1:])

    def open(self, tell: Callable[[int], None]) -> None:
        """See `ExecutedAction.open`."""
        self._group = ChildGroup(tell)

    def close(self) -> None:
        """Kill the program that runs, with its children."""
        if self._group is not None:
            self._group.close()

    def perform(self, decision: dict[str, Any], host: str) -> str:
        """Run the program; see `ExecutedAction.perform`."""
        if missing := self.missing():
            raise ActionError(missing)
        group = self._group or ChildGroup()
        process = group.start(self.command)
        with process:
            try:
                _, output = process.communicate(json.dumps(decision).encode(), self.timeout)
            except subprocess.TimeoutExpired:
                group.kill()
                raise ActionError(f"{self.command[0]}: killed after {self.timeout:g} s") from None
            finally:
                group.release()
        if process.returncode != 0:
            last = output.decode("utf-8", "replace").strip().splitlines()[-1:] or ["it printed nothing"]
            raise ActionError(f"{self.command[0]}: exit status {process.returncode}: {last[0][:200]}")
        return "exit status 0"

    def describe(self) -> str:
        """Return a short description of the action."""
        return f"run {' '.join(self.command)} (at most {self.timeout:g} s)"

    def missing(self) -> str:
        """See `ActionSettings.missing`."""
        program = self.command[0]
        return "" if shutil.which(program) else f"{program}: expected a program that can be run, found none"
