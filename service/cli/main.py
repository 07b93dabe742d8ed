"""Entry point: `contactsense COMMAND ...`. Commands are imported only when they are called."""

import sys

import click

from contactsense.service.cli.lazy import LazyGroup

COMMANDS = {
    "demo": "contactsense.service.cli.demo:demo",
    "view": "contactsense.service.cli.view:view",
    "serve": "contactsense.service.cli.serve:serve",
    "mock": "contactsense.service.cli.mock:mock",
    "reactions": "contactsense.service.cli.reactions:reactions",
    "scene": "contactsense.service.cli.scene:scene",
    "robots": "contactsense.service.cli.robots:robots",
    "bench": "contactsense.service.cli.bench:bench",
    "analyze": "contactsense.service.cli.analyze:analyze",
    "check": "contactsense.service.cli.check:check",
    "calibrate": "contactsense.service.cli.calibrate:calibrate",
    "record": "contactsense.service.cli.record:record",
    "excite": "contactsense.service.cli.excite:excite",
    "decompose": "contactsense.service.cli.decompose:decompose",
    "map": "contactsense.service.cli.map:surface_map",
    "paper": "contactsense.benchmarks.solvers.paper_command:paper",
}
"""Command name -> import path of its click command."""


cli = LazyGroup(
    COMMANDS,
    name="contactsense",
    help="Estimate where a robot arm is being touched.",
    context_settings={"help_option_names": ["-h", "--help"]},
)
click.version_option(package_name="contactsense")(cli)


def main() -> None:
    """Run the command line: exit status 0 on success, 1 on failure, 2 on wrong usage; one line per error."""
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
