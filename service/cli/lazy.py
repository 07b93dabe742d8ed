"""A click group that imports its commands when they are called: `--help` does not load the compiler."""

from collections.abc import Mapping
from importlib import import_module

import click

EXTRAS = {"viser": ("viewer",)}
"""Package -> the extras that install it, where that is neither `geometry` nor `test`."""


def missing(command: str, package: str) -> str:
    """What a command says where a package is not installed."""
    # With NumPy, which may not be loaded before its number of threads is set.
    from contactsense.robots.extras import install_command

    return f"{command} needs {package}: {install_command(*EXTRAS.get(package, ('geometry', 'test')))}"


class LazyGroup(click.Group):
    """Imports its commands by name and import path when they are called."""

    def __init__(
        self,
        commands: Mapping[str, tuple[str, str]],
        sections: Mapping[str, str] | None = None,
        **attributes: object,
    ) -> None:
        """Create the group.

        Args:
            commands: Command name -> "module:attribute" of its command and its line in the help text, in
                the order of the help text.
            sections: Heading in the help text -> the first command below it; None: one for all.
            attributes: Of the group, see click.
        """
        super().__init__(**attributes)  # type: ignore[arg-type]
        self._places = {name: place for name, (place, _) in commands.items()}
        self._lines = {name: line for name, (_, line) in commands.items()}
        self._headings = {first: heading for heading, first in (sections or {}).items()}

    def list_commands(self, ctx: click.Context) -> list[str]:
        """Names of all commands, in the order of the help text."""
        return list(self._places)

    def format_commands(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:
        """Write the commands below their headings, with their lines in one column."""
        parts: dict[str, list[tuple[str, str]]] = {}
        heading, width = "Commands", max(map(len, self._places))
        for name, line in self._lines.items():
            heading = self._headings.get(name, heading)
            parts.setdefault(heading, []).append((name.ljust(width), line))
        for heading, rows in parts.items():
            with formatter.section(heading):
                formatter.write_dl(rows)

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
