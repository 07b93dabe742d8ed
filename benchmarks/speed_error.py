"""`python -m contactsense.benchmarks.speed_error`: time per estimate against its error for each method, level
of detail and number of contacts; a table, and the picture docs/speed_error.png."""

import json
from collections.abc import Iterator
from pathlib import Path

import click
import numpy as np
from rich.console import Console
from rich.progress import Progress

from contactsense.benchmarks import options
from contactsense.benchmarks.peers import PEERS
from contactsense.benchmarks.peers.cases import MESHES, ROBOTS, TRUTH, Case, answer, errors, static_cases
from contactsense.benchmarks.peers.method import Located, Method
from contactsense.benchmarks.pictures.mark import DETAILS, QUANTILES, Mark, draw, table
from contactsense.benchmarks.pictures.speed_multi_contact import several
from contactsense.benchmarks.posterior.dense import Dense, Geometry
from contactsense.benchmarks.posterior.table import GEOMETRIES, Skins
from contactsense.benchmarks.static_truth.cases import COLUMNS

NOISES = (COLUMNS[0], COLUMNS[2])
SKIPPED = 500
"""Contacts excluded from the evaluation: the other methods were tuned on them."""


def methods(case: Case, skins: Skins, folder: Path) -> Iterator[Method]:
    """All methods for a case with base sensor and torques, each created when it is needed; `folder`
    has the visual meshes."""
    for detail in DETAILS:
        meshes = folder / case.points.robot if detail == "skin" else None
        yield Located(case.scene.model_copy(update={"detail": detail, "meshes": meshes}))
    for geometry, samples in skins.samples.items():
        yield Dense(case.scene, geometry, samples)
    for peer in PEERS:
        if peer.sensors == case.sensors:
            yield peer.make(case.scene)


def mark(method: Method, case: Case) -> Mark:
    """Run a method on a case and measure its time and error."""
    answers, seconds = answer(method, case)
    quantiles = np.quantile(errors(answers, case.points), QUANTILES, method="higher")
    return Mark(
        method=method.name,
        robot=case.points.robot,
        noise=case.noise,
        contacts=1,
        microseconds=1e6 * seconds,
        error=tuple(float(value) for value in quantiles),
        link_right=float((answers.link == case.points.link).mean()),
    )


@click.command()
@click.option("--contacts", default=500, show_default=True, help="Postures of each arm.")
@click.option("--robot", "robots", multiple=True, default=ROBOTS, help="Arm; may be repeated.")
@click.option(
    "--geometry",
    "geometries",
    type=click.Choice(list(GEOMETRIES)),
    multiple=True,
    default=GEOMETRIES,
    help="Surface that the dense posterior samples; may be repeated.  [default: both]",
)
@click.option("--truth", type=options.FOLDER, default=TRUTH, help="Contacts.")
@click.option("--meshes", type=options.FOLDER, default=MESHES, help="ROBOT/LINK.ply.")
@options.as_json
def main(
    contacts: int,
    robots: tuple[str, ...],
    geometries: tuple[Geometry, ...],
    truth: Path,
    meshes: Path,
    as_json: bool,
) -> None:
    """Time against error of all methods, and the picture docs/speed_error.png."""
    marks: list[Mark] = []
    with Progress(console=Console(stderr=True), transient=True) as progress:
        task = progress.add_task("comparing", total=None)
        for robot in robots:
            skins = Skins.of(robot, "fine", meshes, geometries)
            rows = slice(SKIPPED, SKIPPED + contacts)
            for case in static_cases(robot, NOISES, ["all"], rows=rows, folder=truth):
                for method in methods(case, skins, meshes):
                    marks.append(mark(method, case))
                    progress.advance(task)
                for one in several(case, truth, meshes):
                    marks.append(one)
                    progress.advance(task)
    draw(marks)
    if as_json:
        click.echo(json.dumps([m.as_json() for m in marks], indent=1))
    else:
        Console(width=128).print(table(marks, contacts))


if __name__ == "__main__":
    main()
