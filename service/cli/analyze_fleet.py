"""`contactsense analyze` of a dataset: progress, results, errors."""

import json
import sys
from pathlib import Path

import click
from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeRemainingColumn

from contactsense.scene import SceneError
from contactsense.service.analysis.fleet.report import fleet_undetermined_forces, write_fleet_report
from contactsense.service.analysis.fleet.run import analyze_fleet
from contactsense.service.analysis.fleet.summary import FleetSummary, robot_rows
from contactsense.service.analysis.fleet.worker_pool import WorkerPoolError
from contactsense.service.analysis.health import UNJUDGED
from contactsense.service.recordings.problems import RecordingError


def analyze_dataset(
    files: tuple[Path, ...], scene: Path | None, out: Path, workers: int, scheduler: str | None, as_json: bool
) -> None:
    """Analyse a dataset and print its summary; exit with status 1 if a recording had no usable sample.

    Raises:
        click.ClickException: Nothing could be analysed, or recordings were skipped.
    """
    columns = (TextColumn("segments"), BarColumn(), MofNCompleteColumn(), TimeRemainingColumn())
    try:
        with Progress(*columns, console=Console(stderr=True), transient=True) as progress:
            bar = progress.add_task("segments", total=None)
            summary = analyze_fleet(
                files,
                scene,
                out,
                workers=workers,
                scheduler=scheduler,
                progress=lambda done, all_: progress.update(bar, completed=done, total=all_),
            )
        write_fleet_report(summary, out)
    except OSError as error:
        what = f"{error.filename}: {error.strerror}" if error.strerror else str(error)
        raise click.ClickException(what) from None
    except (RecordingError, SceneError, WorkerPoolError, RuntimeError) as error:
        raise click.ClickException(str(error)) from None
    for problem in summary.problems:
        click.echo(f"contactsense: {problem}", err=True)
    for name in summary.unjudged:
        click.echo(f"contactsense: {name}: {UNJUDGED}", err=True)
    if as_json:
        click.echo(json.dumps(_as_plain(summary), indent=1))
    else:
        click.echo((out / "fleet.md").read_text(encoding="utf-8"))
        click.echo(f"report: {out / 'fleet.html'}")
    if summary.skipped:
        raise click.ClickException(f"recordings that were skipped: {summary.skipped}")
    if summary.unjudged:
        sys.exit(1)


def _as_plain(summary: FleetSummary) -> dict[str, object]:
    return {
        "robots": robot_rows(summary),
        "contacts": summary.contacts.num_rows,
        "expected_false_alarms": summary.expected_false_alarms,
        "undetermined_forces": [f"{who}: {text}" for who, text in fleet_undetermined_forces(summary)],
        "problems": list(summary.problems),
        "unjudged": list(summary.unjudged),
    }
