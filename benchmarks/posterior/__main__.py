"""`python -m contactsense.benchmarks.posterior`: our estimates compared with the dense posterior."""

import json
from pathlib import Path
from typing import get_args

import click
from rich.console import Console
from rich.progress import Progress

from contactsense.benchmarks import options
from contactsense.benchmarks.peers.cases import MESHES, ROBOTS, TRUTH
from contactsense.benchmarks.posterior.dense import Geometry, Rule
from contactsense.benchmarks.posterior.table import GEOMETRIES, Row, Skins, rows, table
from contactsense.benchmarks.static_truth.cases import COLUMNS, Detail
from contactsense.benchmarks.static_truth.points import HALVES, read, select


@click.command()
@click.option("--robot", "robots", multiple=True, default=ROBOTS, help="Arm; may be repeated.")
@options.sensor_sets
@click.option(
    "--noise",
    "levels",
    type=click.Choice([f"{column.force:g}" for column in COLUMNS]),
    multiple=True,
    default=tuple(f"{column.force:g}" for column in COLUMNS),
    help="Columns of noise, by that of the base force; may be repeated.  [default: all of these]",
)
@click.option(
    "--rule",
    type=click.Choice(get_args(Rule)),
    default="middle",
    show_default=True,
    help="What the dense posterior answers.",
)
@click.option("--contacts", default=500, show_default=True, help="Contacts of each arm.")
@options.half
@click.option(
    "--geometry",
    "geometries",
    type=click.Choice(list(GEOMETRIES)),
    multiple=True,
    default=GEOMETRIES,
    help="Surface that the posterior samples; may be repeated.  [default: both]",
)
@options.detail
@click.option("--truth", type=options.FOLDER, default=TRUTH, help="Contacts.")
@click.option(
    "--meshes",
    type=options.FOLDER,
    default=MESHES,
    help="ROBOT/LINK.ply.",
)
@options.as_json
def main(
    robots: tuple[str, ...],
    kinds: tuple[str, ...],
    levels: tuple[str, ...],
    rule: Rule,
    contacts: int,
    half: str,
    geometries: tuple[Geometry, ...],
    detail: Detail,
    truth: Path,
    meshes: Path,
    as_json: bool,
) -> None:
    """Compare our estimates of the static contacts with the dense posterior."""
    results: list[Row] = []
    columns = [column for column in COLUMNS if f"{column.force:g}" in levels]
    with Progress(console=Console(stderr=True), transient=True) as progress:
        task = progress.add_task("comparing", total=len(robots) * len(kinds) * len(columns))
        for robot in robots:
            points = select(select(read(truth, robot), HALVES[half]), slice(contacts))
            skins = Skins.of(robot, detail, meshes, geometries)
            for row in rows(points, kinds, detail, meshes, skins, columns, rule):
                results.append(row)
                progress.advance(task)
    if as_json:
        click.echo(
            json.dumps({"detail": detail, "half": half, "results": [row.as_json() for row in results]})
        )
        return
    for geometry in geometries:
        Console(width=192).print(table(results, geometry, detail))


if __name__ == "__main__":
    main()
