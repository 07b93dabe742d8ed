"""A click group whose commands are imported when they are called, so that `--help` does not load the
compiler."""

from collections.abc import Mapping
from importlib import import_module

import click


class LazyGroup(click.Group):
    """Knows its commands by name and import path."""

    def __init__(self, places: Mapping[str, str], **attributes: object) -> None:
        """`places`: command name -> "module:attribute" of its click command, in the order of the help
        text."""
        super().__init__(**attributes)  # type: ignore[arg-type]
        self._places = places

    def list_commands(self, ctx: click.Context) -> list[str]:
        """Names of all commands, in the order of the help text."""
        return list(self._places)

    def get_command(self, ctx: click.Context, cmd_name: str) -> click.Command | None:
        """The click command of that name, imported now; None where there is none."""
        if cmd_name not in self._places:
            return None
        module, _, attribute = self._places[cmd_name].partition(":")
        try:
            command: click.Command = getattr(import_module(module), attribute)
        except ModuleNotFoundError as error:
            package = (error.name or "").split(".")[0]
            if package == "contactsense":
                raise
            raise click.ClickException(
                f"{cmd_name} needs {package}: pip install contactsense[geometry,test]"
            ) from None
        return command
