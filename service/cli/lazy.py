"""A click group that imports its commands when they are called: `--help` does not load the compiler."""

from collections.abc import Mapping
from importlib import import_module

import click

EXTRAS = {"viser": "viewer"}
"""Package -> the extra that installs it, where that is neither `geometry` nor `test`."""


def missing(command: str, package: str) -> str:
    """What a command says where a package is not installed."""
    return f"{command} needs {package}: pip install contactsense[{EXTRAS.get(package, 'geometry,test')}]"


class LazyGroup(click.Group):
    """Imports its commands by name and import path when they are called."""

    def __init__(self, places: Mapping[str, str], **attributes: object) -> None:
        """`places`: command name -> "module:attribute" of its command, in the order of the help text."""
        super().__init__(**attributes)  # type: ignore[arg-type]
        self._places = places

    def list_commands(self, ctx: click.Context) -> list[str]:
        """Names of all commands, in the order of the help text."""
        return list(self._places)

    def get_command(self, ctx: click.Context, cmd_name: str) -> click.Command | None:
        """Import and return the click command of that name; None if there is none."""
        if cmd_name not in self._places:
            return None
        module, _, attribute = self._places[cmd_name].partition(":")
        try:
            command: click.Command = getattr(import_module(module), attribute)
        except ModuleNotFoundError as error:
            package = (error.name or "").split(".")[0]
            if package == "contactsense":
                raise
            raise click.ClickException(missing(cmd_name, package)) from None
        return command
