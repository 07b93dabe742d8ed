"""`contactsense bench solvers`: accuracy and speed of the contact solvers."""

import json
import sys
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any

import click

from contactsense.benchmarks.solvers.tables import TABLES, Table, Tick, into
from contactsense.robots.extras import install_command


def _show(bar: Any, name: str, step: str) -> None:
    bar.label = f"{name}: {step}"
    bar.update(0)


@click.command()
@click.option(
    "--count",
    default=1_000_000,
    show_default=True,
    type=click.IntRange(1000),
    help="Wrenches a surface; a tenth of them for iterations and speed, a 10,000th for the sweep.",
)
@click.option(
    "--only",
    "names",
    multiple=True,
    type=click.Choice(list(TABLES)),
    help="Only this table; may be repeated.",
)
@click.option("--json", "as_json", is_flag=True, help="Print the numbers as JSON.")
@click.option(
    "--into",
    "page",
    type=click.Path(exists=True, dir_okay=False, path_type=Path),
    help="Write the tables into this Markdown page, between <!-- NAME --> and <!-- end -->.",
)
def solvers(count: int, names: tuple[str, ...], as_json: bool, page: Path | None) -> None:
    """Measure error, hard cases, seams, Newton steps and time of the contact solvers.

    Errors are in ulps times the condition number: 1 is what rounding of the wrench alone may cause.
    """
    made: dict[str, Table] = {}
    for name in list(names) or list(TABLES):
        with click.progressbar(length=1, label=name, file=sys.stderr) as bar:
            try:
                make: Callable[[int, Tick], Table] = TABLES[name]
                made[name] = make(count, partial(_show, bar, name))
            except ModuleNotFoundError as error:
                raise click.ClickException(f"{error.name} is needed: {install_command('test')}") from None
            bar.update(1)
    if page is not None:
        try:
            page.write_text(into(page.read_text(), made.items()))
        except ValueError as error:
            raise click.ClickException(f"{page}: {error}") from None
    elif as_json:
        click.echo(json.dumps({name: table.data for name, table in made.items()}))
    else:
        click.echo("\n\n".join(f"{name}\n\n{table.aligned()}" for name, table in made.items()))
