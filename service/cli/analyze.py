"""`contactsense analyze FILES --scene scene.yaml --out DIR`: what touched the arm in recordings."""

import json
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any, NamedTuple

import click
from rich.console import Console
from rich.progress import BarColumn, Progress, TextColumn, TimeRemainingColumn

from contactsense.scene import Scene, SceneError
from contactsense.service.analysis import Analysis, ForceLimits, LimitsError
from contactsense.service.analysis import analyze as run
from contactsense.service.analysis.contact_arrows import contact_arrows
from contactsense.service.analysis.contact_table import contact_rows, from_folder, write_contacts
from contactsense.service.analysis.health import UNJUDGED, health, warning
from contactsense.service.analysis.report import write_report
from contactsense.service.analysis.summary.contact_summary import millimetres
from contactsense.service.analysis.summary.force_limits import DISCLAIMER
from contactsense.service.analysis.summary.undetermined_forces import doubted_forces
from contactsense.service.cli.options.output_file import check_no_input
from contactsense.service.recordings import (
    ColumnMapping,
    MappingError,
    RecordingError,
    RecordingFile,
    scene_in,
)
from contactsense.service.recordings.export import export
from contactsense.service.recordings.file_names import check_name
from contactsense.service.recordings.ros.bag_files import is_bag
from contactsense.service.recordings.tables.parquet_files import write_parquet
from contactsense.service.recordings.tables.table import reason

_WIDEST = 500
"""Width beyond which no table grows [characters]."""
_MOSTLY = 0.5
"""If a larger share of the samples is degraded, no contacts mean nothing."""
_TABLES = "contacts.parquet", "contacts.csv", "contacts.mcap", "estimates.parquet"
"""Files in the folder of the results that have the format of recordings."""
_COLUMNS = (
    "begin\ns", "link", "P", "force\nN", "duration\ns", "impulse\nN s", "place in link\nmm", "speed\nm/s",
)  # fmt: skip
"""Headings of the table of contacts; it is 80 columns wide."""


class _Options(NamedTuple):
    """How single recordings are read, and what is written."""

    scene: Scene | None
    """None: the scene that each recording carries."""
    limits: ForceLimits | None
    mapping: ColumnMapping
    estimates: bool
    mcap: bool


@click.command()
@click.argument("files", nargs=-1, required=True, type=click.Path(path_type=Path))
@click.option(
    "--scene",
    "scene_path",
    type=click.Path(path_type=Path),
    help="Scene file (YAML); for a dataset also a folder with ROBOT.yaml for each robot.  [default: "
    "robot=ROBOT/scene.yaml in a dataset, else the scene that a file carries]",
)
@click.option(
    "--columns", help="Names and units of columns or topics, as q=joint,time_unit=ms or a YAML file."
)
@click.option("--out", required=True, type=click.Path(path_type=Path), help="Folder for tables and report.")
@click.option("--limits", "limits_path", type=click.Path(path_type=Path), help="Your force limits (YAML).")
@click.option("--estimates", is_flag=True, help="Write the estimates and residuals of every sample, too.")
@click.option(
    "--mcap",
    is_flag=True,
    help="Write contacts.mcap, too: the recording with its contacts as arrows, for Foxglove.",
)
@click.option("--workers", type=click.IntRange(1), help="Analyse as a dataset, on that many processes.")
@click.option(
    "--scheduler", help="Analyse as a dataset on the Dask cluster at this address, tcp://HOST:PORT."
)
@click.option(
    "--json",
    "as_json",
    is_flag=True,
    help="Print the contacts for a program; of a dataset the robots, as in robots.parquet.",
)
def analyze(
    files: tuple[Path, ...],
    scene_path: Path | None,
    columns: str | None,
    out: Path,
    limits_path: Path | None,
    estimates: bool,
    mcap: bool,
    workers: int | None,
    scheduler: str | None,
    as_json: bool,
) -> None:
    """Find what touched the arm in recordings, and write tables and a report.

    Writes contacts.parquet, contacts.csv, report.html and report.md to OUT; with several FILES, to one folder
    for each. A file that cannot be read is reported and skipped; the exit status is then 1, as for a file
    without a usable sample.

    With a folder, --workers or --scheduler, analyses a dataset and writes contacts/robot=NAME/date=DATE/,
    robots.parquet, days.parquet, fleet.html and fleet.md to OUT. Segments that an earlier run completed are
    not computed again.
    """
    try:
        check_name(out)
    except RecordingError as error:
        raise click.ClickException(f"--out: {error}") from None
    if workers is not None or scheduler is not None or any(_is_folder(path) for path in files):
        if limits_path is not None or estimates or mcap or columns is not None:
            raise click.UsageError(
                "--limits, --estimates, --mcap, --columns: not for a dataset; analyze its files one by one"
            )
        if workers is not None and scheduler is not None:
            raise click.UsageError("--workers and --scheduler: expected one of them, got both")
        from contactsense.service.cli.analyze_fleet import analyze_dataset

        analyze_dataset(files, scene_path, out, workers or 1, scheduler, as_json)
    else:
        _analyze_files(files, _options(scene_path, limits_path, columns, estimates, mcap), out, as_json)


def _analyze_files(files: tuple[Path, ...], options: _Options, out: Path, as_json: bool) -> None:
    """Analyse single recordings, and print what was found."""
    folders = _folders(files, out)
    for folder in folders:
        for name in _TABLES:
            check_no_input("--out", folder / name, files)
    results: list[dict[str, Any]] = []
    unjudged: list[Path] = []
    analysed = 0
    for path, folder in zip(files, folders, strict=True):
        found = _analyze_or_skip(path, options, folder, is_only=len(files) == 1)
        if found is None:
            continue
        analysed += 1
        if not found.judged:
            unjudged.append(path)
        if as_json:
            results.append(_as_plain(found))
        else:
            _print(found, folder)
    if as_json:
        click.echo(json.dumps(results, indent=1))
    for path in unjudged:
        click.echo(f"contactsense: {path}: {UNJUDGED}", err=True)
    if analysed < len(files):
        raise click.ClickException(f"recordings that were skipped: {len(files) - analysed} of {len(files)}")
    if unjudged:
        sys.exit(1)


def _options(
    scene: Path | None, limits: Path | None, columns: str | None, estimates: bool, mcap: bool
) -> _Options:
    try:
        return _Options(
            None if scene is None else Scene.load(scene),
            None if limits is None else ForceLimits.load(limits),
            ColumnMapping.parse(columns),
            estimates,
            mcap,
        )
    except (SceneError, LimitsError, MappingError) as error:
        raise click.ClickException(str(error)) from None


def _is_folder(path: Path) -> bool:
    """Whether it holds recordings; the folder of a bag is one recording."""
    return path.is_dir() and not is_bag(path)


def _folders(files: tuple[Path, ...], out: Path) -> list[Path]:
    """Output folder of each file."""
    if len(files) == 1:
        return [out]
    stems = [path.name.removesuffix(".gz").rsplit(".", 1)[0] for path in files]
    for i, stem in enumerate(stems):
        if stem in stems[:i]:
            raise click.UsageError(
                f"{files[i]}: expected distinct file names, got {stem} twice; analyze them one by one"
            )
    return [out / stem for stem in stems]


def _analyze_or_skip(path: Path, options: _Options, folder: Path, *, is_only: bool) -> Analysis | None:
    """As `_analyze`; a recording that cannot be read is reported and skipped (None), unless it is the only
    one."""
    try:
        return _analyze(path, options, folder)
    except RecordingError as error:
        if is_only:
            raise click.ClickException(str(error)) from None
        click.echo(f"contactsense: {error}; skipped", err=True)
        return None


def _analyze(path: Path, options: _Options, folder: Path) -> Analysis:
    """Analyse one recording, and write its tables and its report."""
    try:
        scene = scene_in(path) if options.scene is None else options.scene
        file = RecordingFile(path, scene, options.mapping)
        folder.mkdir(parents=True, exist_ok=True)  # if that fails, no long analysis is lost
        with Progress(
            TextColumn("{task.description}", markup=False), BarColumn(), TimeRemainingColumn(),
            console=Console(stderr=True), transient=True,
        ) as progress:  # fmt: skip
            task = progress.add_task(file.path.name, total=file.rows)
            found = run(
                file,
                scene,
                estimates=options.estimates,
                limits=options.limits,
                progress=lambda count: progress.advance(task, count),
            )
        write_contacts(from_folder(found.to_arrow(), file.path, folder), folder)
        if found.estimates is not None:
            write_parquet(found.estimates, folder / "estimates.parquet")
        write_report(found, folder)
        if options.mcap:
            recording = file.read()
            export(recording, folder / "contacts.mcap", contact_arrows(found, recording))
    except OSError as error:
        raise click.ClickException(f"{error.filename or folder}: cannot write: {reason(error)}") from None
    return found


def _as_plain(found: Analysis) -> dict[str, Any]:
    return {
        "recording": found.recording,
        "samples": found.samples,
        "duration": found.duration,
        "problems": list(found.problems),
        "warning": warning(found),
        "health": [{"ok": well, "text": text} for well, text in health(found)],
        "contacts": contact_rows(found.contacts),
        "undetermined_forces": doubted_forces(found.scene, found.contacts),
        "limits": None if found.limits is None else _exceeded(found, found.limits),
    }


def _exceeded(found: Analysis, limits: ForceLimits) -> dict[str, Any]:
    return {
        "provenance": limits.provenance,
        "warnings": list(limits.doubts),
        "exceeded": {
            contact.contact: texts for contact in found.contacts if (texts := limits.exceeded(contact))
        },
    }


def _print(found: Analysis, folder: Path) -> None:
    from rich import box
    from rich.table import Table

    # A table that is wider than the terminal is printed whole: cut off, 1.00 and 1.5 are the same.
    console = Console(width=_WIDEST, markup=False)
    table = Table(
        title=f"{found.recording}: {found.duration:.1f} s", box=box.SIMPLE_HEAD, padding=(0, 1, 0, 0)
    )
    for name in _COLUMNS:
        table.add_column(name, justify="left" if name == "link" else "right", no_wrap=True)
    for contact in found.contacts:
        place = millimetres(contact.point) if contact.link else ""
        table.add_row(
            f"{contact.begin:.3f}",
            contact.link or "no single place",
            f"{contact.probability:.2f}",
            f"{contact.peak_force:.1f}",
            f"{contact.duration:.2f}",
            f"{contact.impulse:.2f}",
            place,
            f"{contact.speed:.2f}" if contact.link else "",
        )
    doubtful = warning(found)
    if doubtful:
        console.print(f"warning: {doubtful}", style="bold red", highlight=False, soft_wrap=True)
    if found.contacts:
        console.print(table)
    elif found.judged:
        console.print(f"{found.recording}: {found.duration:.1f} s, {_nothing(found)}", soft_wrap=True)
    if found.limits is not None:
        for line in _compared(found, found.limits):
            console.print(line, highlight=False, soft_wrap=True)
    undetermined = doubted_forces(found.scene, found.contacts)
    if undetermined and found.judged:
        console.print(f"forces: {undetermined}", highlight=False, soft_wrap=True)
    for well, text in health(found):
        if not well and text != found.doubt:  # the warning above says it
            console.print(f"check: {text}", soft_wrap=True)
    console.print(f"report: {folder / 'report.html'}", soft_wrap=True)


def _nothing(found: Analysis) -> str:
    """What the absence of contacts means: nothing, while estimates are degraded."""
    share = found.residuals.degraded / max(found.samples, 1)
    if share < _MOSTLY:
        return "nothing touched the arm"
    return f"no contact was found, but {share:.0%} of the samples are degraded: contacts may have been missed"


def _compared(found: Analysis, limits: ForceLimits) -> Iterator[str]:
    """What a comparison with the user's limits says: mistakes that are likely in them, one line per contact
    above them, and their source."""
    yield from (f"warning: {text}" for text in limits.doubts)
    within = True
    for contact in found.contacts:
        if texts := limits.exceeded(contact):
            yield f"above your limits: contact at {contact.begin:.3f} s: {'; '.join(texts)}"
            within = False
    if within and found.judged:
        yield "above your limits: none"
    if doubted_forces(found.scene, found.contacts):
        yield "a contact that is above no limit may have been above one: see forces below"
    yield f"limits from: {limits.provenance}. {DISCLAIMER}"
