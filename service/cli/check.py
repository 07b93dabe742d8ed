"""`contactsense check SCENE`: which lines of a scene fit contact-free motion, and which do not."""

import json
from dataclasses import asdict
from pathlib import Path
from typing import Any

import click
from rich import box
from rich.console import Console
from rich.table import Table

from contactsense.calibration import FreeMotion
from contactsense.scene import Scene, SceneError
from contactsense.service.api.sample_source import reader_settings
from contactsense.service.api.settings import Settings, SettingsError
from contactsense.service.cli.contact_lines import LEFT_OUT, LOOK_AT_THEM, contact_lines
from contactsense.service.cli.options.finite_range import FiniteRange
from contactsense.service.cli.options.option_names import as_options
from contactsense.service.cli.options.recordings_once import each_once
from contactsense.service.cli.options.sensor_options import from_environment, sensor_options
from contactsense.service.recordings import ColumnMapping, MappingError, RecordingError
from contactsense.service.recordings.free_motion import read_free_motion
from contactsense.service.recordings.problem_lines import problem_lines
from contactsense.service.sensors.clients.robot_stream import SensorError
from contactsense.service.sensors.live_free_motion import read_live_motion
from contactsense.setup_check import CheckError, Finding, Residuals, SetupCheck
from contactsense.setup_check import check as run
from contactsense.setup_check.findings.unexplained import NOT_EXPLAINED
from contactsense.setup_check.result import FITS_BETTER, NOT_RECORDED

_VERDICTS = {
    "fits": "fits",
    "does_not_fit": "[bold red]does not fit[/]",
    "cannot_tell": "[yellow]undetermined[/]",
}

_NOT_LEFT_OUT = (
    "Something seems to push on the arm, for too long to be left out, and may be the reason for all that "
    "does not fit: repeat without contact"
)
_UNITS = {
    "mounting": "rad",
    "tool.mass": "kg",
    "tool.com": "m",
    ".translation": "m",
    ".rpy": "rad",
    ".delay": "s",
    ".bias": "N, Nm",
    ".range": "N, Nm",
}
"""Units of the lines with these endings."""


@click.command()
@click.argument("scene_file", metavar="SCENE", type=click.Path(path_type=Path))
@click.argument("recordings", nargs=-1, type=click.Path(path_type=Path), callback=each_once)
@click.option(
    "--columns", help="Names and units of columns or topics, as q=joint,time_unit=ms or a YAML file."
)
@sensor_options("Read this robot's controller instead of RECORDINGS.")
@click.option(
    "--seconds",
    type=FiniteRange(4.0),
    default=20.0,
    show_default=True,
    help="How long to read the robot [s].",
)
@click.option(
    "--keep-contacts", is_flag=True, help="Use stretches, too, in which something seems to push on the arm."
)
@click.option("--json", "as_json", is_flag=True, help="Print the result for a program.")
@click.pass_context
def check(
    ctx: click.Context,
    /,
    scene_file: Path,
    recordings: tuple[Path, ...],
    columns: str | None,
    seconds: float,
    keep_contacts: bool,
    as_json: bool,
    **source: Any,
) -> None:
    """Check SCENE against RECORDINGS, or a live robot, of slow motion or some postures without contact.

    Each line of the scene fits, or does not fit and another value would, or is undetermined by this motion.
    Where no lines explain the readings, stretches in which something seems to push on the arm are left out.
    Exit status: 0 nothing contradicts the scene, 1 something does, 2 the input cannot be used.
    """
    given = {name: value for name, value in source.items() if value is not None}
    if recordings and "robot_host" in given:
        raise click.UsageError("check: expected either recordings or --robot-host, got both")
    if recordings and given:
        option = as_options()((next(iter(given)),))
        raise click.UsageError(f"{option} is for a live robot: expected it with --robot-host, not recordings")
    errors = Console(stderr=True, markup=False)
    try:
        scene = Scene.load(scene_file)
        with errors.status("reading") as status:
            if recordings:
                parts = _recorded(scene, recordings, columns, errors)
            else:
                known = {**from_environment(), **given}
                if "robot_host" not in known:
                    raise SettingsError("check: expected either recordings or --robot-host, got neither")
                settings = Settings.checked({**known, "scene": scene_file}, "check", as_options())
                reader = reader_settings(settings, scene)
                assert reader is not None
                parts = [
                    read_live_motion(
                        scene,
                        reader,
                        seconds,
                        lambda t: status.update(f"reading the robot: {t:.0f} of {seconds:.0f} s"),
                    )
                ]
            found = run(scene, parts, lambda text: status.update(f"checking: {text}"), not keep_contacts)
    except (
        SceneError, SettingsError, SensorError, RecordingError, MappingError, CheckError, ValueError,
    ) as error:  # fmt: skip
        raise click.UsageError(str(error)) from None
    if as_json:
        click.echo(json.dumps(as_plain(found), indent=1))
    else:
        print_check(found, scene, Console())
    ctx.exit(0 if found.fits else 1)


def _recorded(
    scene: Scene, recordings: tuple[Path, ...], columns: str | None, errors: Console
) -> list[FreeMotion]:
    mapping = ColumnMapping.parse(columns)
    parts: list[FreeMotion] = []
    for recording in recordings:
        found, problems = read_free_motion(recording, scene, mapping)
        parts += found
        for problem in problem_lines(problems):
            errors.print(f"{recording}: {problem}", soft_wrap=True)
    return parts


def as_plain(found: SetupCheck) -> dict[str, Any]:
    """The result as plain data."""
    return {"fits": found.fits, **asdict(found)}


def print_check(found: SetupCheck, scene: Scene, console: Console) -> None:
    """Print the result for a person; `scene`: the one that was checked."""
    _print_contacts(found, scene, console)
    table = Table(box=box.SIMPLE_HEAD, padding=(0, 1, 0, 0))
    for heading in ("line", "scene", "verdict"):
        table.add_column(heading, overflow="fold")
    for item in found.findings:
        verdict = "[yellow]not recorded[/]" if item.remark == NOT_RECORDED else _VERDICTS[item.verdict]
        table.add_row(item.line, _plain(_with_unit(item.line, item.stated)), verdict)
    console.print(table)
    for item in found.wrong:
        console.print(_explained(item), highlight=False, soft_wrap=True)
    for item in found.findings:
        if item.remark.startswith(FITS_BETTER):
            text = f"{item.line}: {_with_unit(item.line, item.remark)}"
            console.print(text, highlight=False, markup=False, soft_wrap=True)
    if found.unexplained:
        console.print(f"{NOT_EXPLAINED[0].upper()}{NOT_EXPLAINED[1:]}:", soft_wrap=True)
        for text in found.unexplained:
            console.print(f"  {text}", highlight=False, markup=False)
    _print_advice(found, console)
    left = _listed(found.residuals)
    text = ", ".join(f"{name} {value:.2g} {unit}" for name, (value, unit) in left.items())
    console.print(f"{found.seconds:.1f} s of motion", highlight=False)
    console.print(f"RMS residual below 2 Hz: {text}", highlight=False)
    if found.fits:
        console.print("Nothing contradicts the scene.")
    if found.base_offset is not None:
        force, moment = (
            ", ".join(f"{value:.3g}" for value in part)
            for part in (found.base_offset[:3], found.base_offset[3:])
        )
        console.print(
            f"The base sensor reads ({force}) N, ({moment}) Nm more than weight and bias of the scene: live, "
            "that is a contact. Run `contactsense calibrate`, which estimates base_wrench.bias.",
            highlight=False,
            markup=False,
        )
    if found.friction is not None:
        text = ", ".join(f"{value:.2g}" for value in found.friction)
        console.print(
            f"The joint torques contain Coulomb friction of about ({text}) Nm, and the scene states no "
            "friction: live, joints that move seem touched. Run `contactsense calibrate`, which estimates "
            "joint_torque.friction.",
            highlight=False,
            markup=False,
        )


def _print_contacts(found: SetupCheck, scene: Scene, console: Console) -> None:
    """Print where something seems to push on the arm."""
    if found.contacts:
        console.print(LEFT_OUT if found.contacts_left_out else _NOT_LEFT_OUT, style="bold", soft_wrap=True)
    for text in contact_lines(found.contacts, scene):
        console.print(f"- {text}", highlight=False, markup=False, soft_wrap=True)


def _print_advice(found: SetupCheck, console: Console) -> None:
    """Print whether something was left out that should be looked at, and what would determine the lines that
    are not."""
    if not found.contacts_left_out:
        return
    if found.contacts:
        console.print(f"{LOOK_AT_THEM[0].upper()}{LOOK_AT_THEM[1:]}.", highlight=False, soft_wrap=True)
    recorded = [item for item in found.findings if item.remark != NOT_RECORDED]
    untold = [item for item in recorded if item.verdict == "cannot_tell"]
    if untold and len(untold) == len(recorded) and found.unexplained:
        # A push hides what the lines would give: moving more joints would not help.
        console.print(
            "Something may have touched the arm: repeat without contact. If the same remains, move more "
            "joints, further or faster.",
            highlight=False,
            soft_wrap=True,
        )
    elif untold:
        console.print("To determine the other lines, move more joints, further or faster.", highlight=False)


def _explained(item: Finding) -> str:
    remark = f" ({item.remark})" if item.remark else ""
    if item.proposed == "deg":
        remark = f" ({item.remark}: --columns angle_unit=deg reads them)"
    lines = [f"[bold]{item.line}[/] does not fit: {_plain(_with_unit(item.line, item.stated))}"]
    lines.append(f"  this would: [bold]{_plain(_with_unit(item.line, item.proposed or ''))}[/]{remark}")
    if item.before is not None and item.after is not None:
        after = _listed(item.after)
        for name, (value, unit) in _listed(item.before).items():
            lines.append(f"  residual of {name}: {value:.2g} {unit}, then {after[name][0]:.2g} {unit}")
    if item.instead:
        lines.append(f"  or else: {', '.join(item.instead)}")
    return "\n".join(lines)


def _with_unit(line: str, value: str) -> str:
    """A line's value with the unit that the scene file leaves out."""
    if line == "tool":
        return value.replace(", com", " kg, com") + " m"
    unit = next((unit for end, unit in _UNITS.items() if line.endswith(end)), None)
    # Some values are words: a mounting by name, or what is to be done.
    return f"{value} {unit}" if unit is not None and value[-1:] in "]0123456789" else value


def _listed(residuals: Residuals) -> dict[str, tuple[float, str]]:
    """What remains of each measured signal, with its unit."""
    known = {"force": (residuals.force, "N"), "moment": (residuals.moment, "Nm")}
    known["torque"] = (residuals.torque, "Nm")
    for field, own in residuals.links.items():
        known |= {f"{field} force": (own.force, "N"), f"{field} moment": (own.moment, "Nm")}
    return {name: (value, unit) for name, (value, unit) in known.items() if value is not None}


def _plain(text: str) -> str:
    return text.replace("[", r"\[")
