"""Entry point: `contactsense COMMAND ...`. Commands are imported only when they are called."""

import sys
from importlib import import_module

import click

COMMANDS = {
    "robots": "service.cli.robots:robots",
    "bench": "service.cli.bench:bench",
}
"""Command name -> where its click command lives."""


class _LazyGroup(click.Group):
    """A group whose commands are imported on use, so that `--help` does not load the compiler."""

    def list_commands(self, ctx: click.Context) -> list[str]:
        """Names of all commands, in the order of `COMMANDS`."""
        return list(COMMANDS)

    def get_command(self, ctx: click.Context, cmd_name: str) -> click.Command | None:
        """The click command of that name, imported now."""
        if cmd_name not in COMMANDS:
            return None
        module, _, attribute = COMMANDS[cmd_name].partition(":")
        command: click.Command = getattr(import_module(module), attribute)
        return command


@click.group(cls=_LazyGroup, context_settings={"help_option_names": ["-h", "--help"]})
@click.version_option(package_name="contactsense")
def cli() -> None:
    """Tell where a robot arm is being touched."""


def main() -> None:
    """Run the command line: exit status 0 on success, 1 on failure, 2 on wrong usage; errors are one line on stderr."""
    try:
        status = cli.main(standalone_mode=False)
    except click.UsageError as error:
        print(f"contactsense: {error.format_message()}", file=sys.stderr)
        sys.exit(2)
    except click.ClickException as error:
        print(f"contactsense: {error.format_message()}", file=sys.stderr)
        sys.exit(1)
    except click.Abort:
        print("contactsense: interrupted", file=sys.stderr)
        sys.exit(1)
    sys.exit(status if isinstance(status, int) else 0)
