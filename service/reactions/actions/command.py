"""Run a user's command with the decision as JSON on its standard input."""

import json
import os
import shutil
import signal
import subprocess
from contextlib import suppress
from typing import Annotated, Any, Literal

from pydantic import Field, ValidationInfo, field_validator

from contactsense.service.reactions.actions.base import ActionError, ExecutedAction


class CommandAction(ExecutedAction):
    """A program and its arguments; no shell."""

    type: Literal["command"]
    command: Annotated[tuple[str, ...], Field(min_length=1)]
    """The program and its arguments; a path of the program is relative to the folder of the rules."""
    timeout: Annotated[float, Field(gt=0.0, le=3600.0)] = 10.0
    """Time after which the program and its children are killed [s]."""

    @field_validator("command")
    @classmethod
    def _beside_the_rules(cls, command: tuple[str, ...], info: ValidationInfo) -> tuple[str, ...]:
        # A name without a folder is looked for on the path. A service that the computer starts works in
        # another folder than whoever tries the rules.
        program, folder = command[0], (info.context or {}).get("folder")
        if folder is None or os.path.dirname(program) == "":
            return command
        return (str((folder / program).absolute()), *command[1:])

    def perform(self, decision: dict[str, Any], host: str) -> str:
        """Run the program; see `ExecutedAction.perform`."""
        try:
            process = subprocess.Popen(
                self.command,
                stdin=subprocess.PIPE,
                stdout=subprocess.DEVNULL,
                stderr=subprocess.PIPE,
                start_new_session=True,  # so that its children can be killed with it
            )
        except OSError as error:
            raise ActionError(f"{self.command[0]}: {error.strerror or error}") from None
        with process:
            try:
                _, output = process.communicate(json.dumps(decision).encode(), self.timeout)
            except subprocess.TimeoutExpired:
                with suppress(ProcessLookupError):
                    os.killpg(process.pid, signal.SIGKILL)
                raise ActionError(f"{self.command[0]}: killed after {self.timeout:g} s") from None
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
