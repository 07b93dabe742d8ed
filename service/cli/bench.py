"""`contactsense bench NAME`: measurements, each printing the numbers that the documentation quotes."""

from importlib import import_module

import click

BENCHES = {
    "stream": "service.bench.stream:stream",
}
"""Name -> where its click command lives."""


class _Benches(click.Group):
    """Imports a measurement when it is called."""

    def list_commands(self, ctx: click.Context) -> list[str]:
        """Names of all measurements, in the order of `BENCHES`."""
        return list(BENCHES)

    def get_command(self, ctx: click.Context, cmd_name: str) -> click.Command | None:
        """The click command of that name, imported now."""
        if cmd_name not in BENCHES:
            return None
        module, _, attribute = BENCHES[cmd_name].partition(":")
        command: click.Command = getattr(import_module(module), attribute)
        return command


@click.group(cls=_Benches)
def bench() -> None:
    """Measure speed and error."""
