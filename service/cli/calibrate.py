"""`contactsense calibrate RECORDING... --scene scene.yaml`: parameters of arm and sensors from
contact-free motion."""

import json
from dataclasses import asdict, replace
from pathlib import Path
from typing import Any

import click
import numpy as np
import yaml
from rich import box
from rich.console import Console
from rich.table import Table

from contactsense.calibration import Calibration, CalibrationError, FreeMotion, Settings, default_groups
from contactsense.calibration import calibrate as run
from contactsense.plausibility.plausible_limits import PlausibleLimits
from contactsense.robots.extras import install_command
from contactsense.robots.file_references import moved
from contactsense.robots.files.whole_file import write_text
from contactsense.robots.files.yaml_fields import Dumper, read_fields
from contactsense.scene import Scene, SceneError
from contactsense.service.cli.calibration_doubts import doubts
from contactsense.service.cli.calibration_page import Section, page, reasons_against
from contactsense.service.cli.contact_lines import channels
from contactsense.service.cli.options.output_file import check_no_input, check_writable
from contactsense.service.cli.options.recordings_once import each_once
from contactsense.service.recordings import ColumnMapping, MappingError, RecordingError
from contactsense.service.recordings.free_motion import read_free_motion
from contactsense.service.recordings.problem_lines import problem_lines
from contactsense.setup_check.usable_recordings import check_values

_PARTS = ("joint_torque", "base_wrench", "wrist_wrench", "link_wrenches", "mounting", "tool", "inertia")
"""Fields of a scene that calibration may change."""


@click.command()
@click.argument("recordings", nargs=-1, required=True, type=click.Path(path_type=Path), callback=each_once)
@click.option("--scene", "path", required=True, type=click.Path(path_type=Path), help="Scene file (YAML).")
@click.option("--out", type=click.Path(path_type=Path), help="Write the calibrated scene into this file.")
@click.option(
    "--write",
    "in_place",
    is_flag=True,
    help="Change the scene file itself; the former one, with its comments, is kept as FILE.bak.",
)
@click.option(
    "--links",
    is_flag=True,
    help="Estimate the links' inertia, too; torque constants and the tool are then kept.",
)
@click.option(
    "--report", type=click.Path(path_type=Path), help="Folder for a report with plots (Markdown, PNG)."
)
@click.option(
    "--columns", help="Names and units of columns or topics, as q=joint,time_unit=ms or a YAML file."
)
@click.option(
    "--keep-contacts", is_flag=True, help="Use stretches, too, in which something seems to push on the arm."
)
@click.option("--verbose", is_flag=True, help="Print every parameter, kept ones too, and every warning.")
@click.option("--json", "as_json", is_flag=True, help="Print the result for a program.")
@click.pass_context
def calibrate(
    ctx: click.Context,
    /,
    recordings: tuple[Path, ...],
    path: Path,
    out: Path | None,
    in_place: bool,
    links: bool,
    report: Path | None,
    columns: str | None,
    keep_contacts: bool,
    verbose: bool,
    as_json: bool,
) -> None:
    """Calibrate the scene from RECORDINGS of contact-free motion.

    Prints what was left out because something seems to push on the arm, what changed, what it means, and what
    to do next. Nothing is written without --out or --write. Exit status: 0 the calibrated scene can be used,
    1 the input cannot be used, 3 the calibrated scene should not be used; --write then changes nothing.
    """
    if out is not None and in_place:
        raise click.UsageError("--out and --write: expected one of them, got both")
    check_writable("--out", out)
    check_no_input("--out", out, recordings)
    if report is not None:
        _check_report(report)
    errors = Console(stderr=True, markup=False)
    try:
        scene = Scene.load(path)
        stretches = _stretches(recordings, scene, ColumnMapping.parse(columns), errors)
        groups = default_groups(scene, stretches)
        if links:
            groups = (*(group for group in groups if group not in ("gain", "payload")), "links")
        with errors.status("calibrating") as status:
            settings = Settings(groups, leave_out_contacts=not keep_contacts)
            found = run(scene, stretches, settings, lambda text: status.update(f"calibrating: {text}"))
    except (SceneError, RecordingError, MappingError, CalibrationError, ValueError) as error:
        raise click.ClickException(str(error)) from None
    with errors.status("judging the result"):
        if keep_contacts:
            found = replace(found, warnings=(*found.warnings, *_kept_contacts(scene, stretches, settings)))
        against = reasons_against(found, doubts(found, scene, stretches))
    # A scene that works is not replaced by one that should not be used.
    target = out if not in_place else None if against else path
    sections = page(found, scene, target, against)
    try:
        if report is not None:
            from contactsense.service.cli.calibration_report import write_report

            write_report(report, found, sections, stretches, scene)
        if target is not None:
            _write(path, found.scene, target, keep_former=in_place)
    except OSError as error:
        raise click.ClickException(f"{error.filename}: cannot write: {error.strerror}") from None
    if as_json:
        click.echo(json.dumps({**as_plain(found), "against": list(against)}, indent=1))
    else:
        _print_page(found, sections)
        if verbose:
            _print_everything(found, scene)
    if against:
        ctx.exit(3)


def _stretches(
    recordings: tuple[Path, ...], scene: Scene, mapping: ColumnMapping, errors: Console
) -> list[FreeMotion]:
    """The motion in all recordings; what was left out is printed."""
    found: list[FreeMotion] = []
    for recording in recordings:
        here, problems = read_free_motion(recording, scene, mapping)
        check_values(scene, here)
        _in_radians(recording, scene, here)
        found += here
        for problem in problem_lines(problems):
            errors.print(f"{recording}: {problem}", soft_wrap=True)
    return found


def _check_report(folder: Path) -> None:
    """Refuse a report that cannot be made, before the work instead of after it."""
    there = next(path for path in (folder, *folder.parents) if path.exists())
    if not there.is_dir():
        raise click.ClickException(f"--report: expected a folder, got the file {there}")
    try:
        import matplotlib  # noqa: F401
    except ImportError as error:
        raise click.ClickException(
            f"plots need matplotlib: {install_command('geometry')} ({error})"
        ) from None


def _write(path: Path, scene: Scene, target: Path, *, keep_former: bool) -> None:
    """Write the calibrated scene of the file `path`; `keep_former`: first write that file as it was."""
    if keep_former:
        write_text(_former(path), path.read_text(encoding="utf-8"))
    write_text(target, scene_text(path, scene, target))


def _former(path: Path) -> Path:
    """Where --write leaves the scene file as it was, with its comments."""
    return path.with_name(f"{path.name}.bak")


def _kept_contacts(scene: Scene, stretches: list[FreeMotion], settings: Settings) -> tuple[str, ...]:
    """What is used although something seems to push on the arm, as one warning. A fit bends to pushes that it
    uses, so they are looked for with one that does not."""
    try:
        contacts = run(scene, stretches, replace(settings, leave_out_contacts=True)).contacts
    except CalibrationError as error:
        return (f"--keep-contacts has used what is left out otherwise: {error}",)
    if not contacts:
        return ()
    first = contacts[0]
    count = "one stretch" if len(contacts) == 1 else f"{len(contacts)} stretches"
    return (
        f"--keep-contacts has used {count} in which something seems to push on the arm, the first from "
        f"{first.start:.1f} s on in {first.recording}: do not use this scene unless nothing was there",
    )


def _in_radians(recording: Path, scene: Scene, stretches: list[FreeMotion]) -> None:
    """Raise a RecordingError if joint positions are beyond what the arm reaches, as angles in degrees are."""
    limits = PlausibleLimits(scene)
    for stretch in stretches:
        for extreme in (stretch.q.min(axis=0), stretch.q.max(axis=0)):
            found = limits.position(extreme)
            if found is not None:
                option = " (--columns angle_unit=deg)" if "degrees" in found.reason else ""
                raise RecordingError(f"{recording}: {found.field}: {found.reason}{option}")


def scene_text(path: Path, scene: Scene, target: Path) -> str:
    """Text of the scene file for `target`, with the calibrated fields; other fields are unchanged, comments
    are lost."""
    content = moved(read_fields(path, "the scene", "robot: ur5e"), path.parent, target.parent)
    fresh = scene.model_dump(mode="json", include=set(_PARTS), exclude_defaults=True)
    for part in _PARTS:
        value = getattr(scene, part)
        if value is None and part in content:
            content[part] = None
        elif part in fresh:
            content[part] = fresh[part]
    return yaml.dump(
        content, Dumper=_SceneDumper, sort_keys=False, default_flow_style=None, width=110, allow_unicode=True
    )


class _SceneDumper(Dumper):
    """Text of several lines, such as a tool's `deviation`, stays a block of lines."""


def _text(dumper: yaml.SafeDumper, text: str) -> yaml.ScalarNode:
    return dumper.represent_scalar("tag:yaml.org,2002:str", text, style="|" if "\n" in text else None)


_SceneDumper.add_representer(str, _text)


def as_plain(found: Calibration) -> dict[str, Any]:
    """The result as plain data."""
    return {
        "values": [
            {
                "name": value.entry.name,
                "unit": value.entry.unit,
                "before": value.before,
                "after": value.after,
                "std": value.std,
                "kept": value.kept or None,
            }
            for value in (*found.values, *found.inertia)
        ],
        "warnings": list(found.warnings),
        "condition": found.condition,
        "seconds": found.seconds,
        "contacts": [asdict(contact) for contact in found.contacts],
        "equations": channels(found.scene),
        "residuals": {
            moment: {"rms": _numbers(level.rms), "q999": _numbers(level.tail)}
            for moment, level in (("before", found.before), ("after", found.after))
        },
    }


def _numbers(array: np.ndarray) -> list[float | None]:
    return [float(x) if np.isfinite(x) else None for x in array]


def _print_page(found: Calibration, sections: tuple[Section, ...]) -> None:
    console = Console(soft_wrap=True, highlight=False, markup=False)
    console.print(f"Calibrated from {found.seconds:.1f} s of motion without contact.")
    for section in sections:
        console.print(f"\n{section.title}", style="bold")
        for line in section.lines:
            console.print(f"- {line}")


def _print_everything(found: Calibration, scene: Scene) -> None:
    console = Console(soft_wrap=True, markup=False)
    table = Table(box=box.SIMPLE_HEAD)
    for heading in ("parameter", "before", "after", "std", "unit"):
        table.add_column(heading, justify="left" if heading in ("parameter", "unit") else "right")
    for value in found.values:
        entry = value.entry
        after = ("kept", "") if value.kept else (f"{value.after:.5g}", f"{value.std:.2g}")
        table.add_row(entry.name, f"{value.before:.5g}", *after, entry.unit)
    console.print(table)
    table = Table(box=box.SIMPLE_HEAD)
    for heading in ("residual", "RMS before", "after", "99.9 % before", "after"):
        table.add_column(heading, justify="left" if heading == "residual" else "right")
    for i, name in enumerate(channels(scene)):
        if np.isfinite(found.after.rms[i]):
            numbers = (found.before.rms[i], found.after.rms[i], found.before.tail[i], found.after.tail[i])
            table.add_row(name, *(f"{number:.3g}" for number in numbers))
    console.print(table)
    console.print(f"condition number of the scaled regressor: {found.condition:.3g}")
    for warning in found.warnings:
        console.print(f"warning: {warning}", highlight=False)
