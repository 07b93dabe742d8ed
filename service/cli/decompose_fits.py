"""Fits of `contactsense decompose`, several links at the same time in processes of their own."""

from contextlib import closing
from typing import TYPE_CHECKING

import click
from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeElapsedColumn

from contactsense.robots import Robot
from contactsense.service.analysis.fleet.worker_pool import WorkerPoolError, run_tasks

if TYPE_CHECKING:
    import trimesh

    from contactsense.robots.decomposition.decompose import Fit, Options

PROGRESS_COLUMNS = (
    TextColumn("{task.description}", markup=False),
    BarColumn(),
    MofNCompleteColumn(),
    TimeElapsedColumn(),
)
"""Columns of the progress bar."""


def fit_all(
    robot: Robot, meshes: "dict[str, trimesh.Trimesh]", options: "Options", jobs: int
) -> "dict[str, tuple[Fit, ...]]":
    """The fits of every link that has a mesh and can be touched; a warning for each of the others.

    Raises:
        click.ClickException: a link cannot be fitted, or none can be touched.
    """
    from contactsense.robots.decomposition.outer_skin import OutOfReachError

    links = [number for number, name in enumerate(robot.link_names) if name in meshes]
    tasks = [(robot, meshes, number, options) for number in links]
    found: dict[int, tuple[Fit, ...]] = {}
    hidden: dict[int, str] = {}
    with (
        Progress(*PROGRESS_COLUMNS, console=Console(stderr=True)) as progress,
        closing(run_tasks(_fit, tasks, jobs)) as fits,
    ):
        bar = progress.add_task(f"{robot.name}: links", total=len(links))
        for (_, _, number, _), fit in fits:
            progress.advance(bar)
            if isinstance(fit, OutOfReachError):
                hidden[number] = str(fit)
            elif isinstance(fit, ValueError | WorkerPoolError):
                raise click.ClickException(f"{robot.name}: link {robot.link_names[number]}: {fit}") from fit
            elif isinstance(fit, Exception):
                raise fit
            else:
                found[number] = fit
    for number in sorted(hidden):
        name = robot.link_names[number]
        click.echo(f"warning: {name}: {hidden[number]}; it gets no primitives", err=True)
    if not found:
        raise click.ClickException(f"{robot.name}: no part can be touched; is each mesh in its link's frame?")
    return {robot.link_names[number]: found[number] for number in links if number in found}


def _fit(task: "tuple[Robot, dict[str, trimesh.Trimesh], int, Options]") -> "tuple[Fit, ...]":
    """The fits of one link, in a worker process."""
    from contactsense.robots.decomposition.decompose import fit_link

    return fit_link(*task)


def fit_by_parts(
    name: str, mesh: "trimesh.Trimesh", whole: "Fit", options: "Options", most: int | None, jobs: int
) -> "Fit":
    """The fit of a whole tool or body, or one part by part if that is better: it is tried where the whole one
    is beyond the tolerance and the mesh has separate parts."""
    from contactsense.robots.decomposition.decompose import choose
    from contactsense.robots.decomposition.separate_parts import joined_fit, separate_parts

    if whole.p95 <= options.tolerance:
        return whole
    parts = separate_parts(mesh)
    if len(parts) < 2:
        return whole
    fits: dict[int, tuple[Fit, ...]] = {}
    with (
        Progress(*PROGRESS_COLUMNS, console=Console(stderr=True)) as progress,
        closing(run_tasks(_fit_part, [(parts, i, options) for i in range(len(parts))], jobs)) as results,
    ):
        bar = progress.add_task(f"{name}: parts", total=len(parts))
        for (_, number, _), fit in results:
            if isinstance(fit, Exception):
                raise click.ClickException(f"{name}: part {number}: {fit}") from fit
            fits[number] = fit
            progress.advance(bar)
    shown = [fits[number] for number in sorted(fits) if fits[number]]
    if not 0 < len(shown) <= (most or len(shown)):
        return whole
    chosen = choose(shown, options.tolerance, most)
    joined = joined_fit(mesh, [part[i] for part, i in zip(shown, chosen, strict=True)], options)
    return min(whole, joined, key=lambda fit: fit.p95)


def _fit_part(task: "tuple[list[trimesh.Trimesh], int, Options]") -> "tuple[Fit, ...]":
    """The fits of one part, in a worker process."""
    from contactsense.robots.decomposition.separate_parts import fit_part

    return fit_part(*task)
