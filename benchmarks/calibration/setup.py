"""`contactsense bench setup`: does `contactsense check` name the wrong line of a scene, and no right one?"""

import json
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import click
from rich import box
from rich.console import Console
from rich.progress import track
from rich.table import Table

from contactsense import JointTorqueSensor, Scene
from contactsense.benchmarks.calibration.link_sensor_draws import ELBOW, LINK_MISTAKES, WRIST
from contactsense.benchmarks.calibration.recordings import FREE, IDENTIFICATION, TOUCHED, read
from contactsense.benchmarks.calibration.setup_draws import (
    MISTAKES,
    Case,
    Settings,
    right_setup,
    wrong_setup,
)
from contactsense.benchmarks.calibration.two_mistakes import ARM_AND_TOOL, named, two_wrong_lines
from contactsense.service.cli.options.finite_range import FiniteRange
from contactsense.setup_check import check

LOADED = "ur-20_01_31-load"
"""A recording with a load at the flange that the scene does not know."""
_WRONG_SEEDS = 10_000
"""Cells with a mistake are others than those without."""


def outcome(case: Case) -> dict[str, Any]:
    """What the check reports of one case: wrong lines, in order, and undetermined lines."""
    found = check(case.scene, [case.recording])
    return {
        "accused": [item.line for item in found.wrong],
        "untold": [item.line for item in found.findings if item.verdict == "cannot_tell"],
        "unexplained": list(found.unexplained),
    }


def measure(
    arms: tuple[str, ...], draws: int, right: int, settings: Settings, show: bool = False, sensor: str = ""
) -> Any:
    """Draw cells with each mistake, and cells without, and count what the check says.

    Args:
        arms: Names of the arms.
        draws: Cells per mistake and arm.
        right: Cells without a mistake, over all arms.
        settings: How cells are drawn.
        show: Whether to show progress.
        sensor: Field of a sensor within the arm that the cells have, and with which the mistakes are made;
            empty: none.
    """
    mistakes = LINK_MISTAKES[sensor] if sensor else MISTAKES
    jobs = [(kind, arm, i) for kind in mistakes for arm in arms for i in range(draws)]
    result: dict[str, Any] = {
        "mistakes": {kind: {arm: {"named": 0, "alone": 0} for arm in arms} for kind in mistakes},
        "draws": draws,
        "right": right,
        "right_accused": [],
        "misnamed": [],
    }
    for kind, arm, i in _tracked(jobs, "wrong setups", show):
        case = wrong_setup(kind, arm, _WRONG_SEEDS + i, settings, sensor)
        said = outcome(case)
        counts = result["mistakes"][kind][arm]
        counts["named"] += said["accused"][:1] == [case.line]
        counts["alone"] += said["accused"] == [case.line]
        if said["accused"][:1] != [case.line]:
            result["misnamed"].append({"kind": kind, "arm": arm, "seed": _WRONG_SEEDS + i, **said})
    for arm, i in _tracked([(arms[i % len(arms)], i) for i in range(right)], "right setups", show):
        said = outcome(right_setup(arm, i, settings, sensor))
        if said["accused"] or said["unexplained"]:
            result["right_accused"].append({"arm": arm, "seed": i, **said})
    return result


def measure_pairs(
    arms: tuple[str, ...], draws: int, settings: Settings, torques_alone: bool, show: bool = False
) -> dict[str, Any]:
    """Draw cells with two mistakes, and count what the check says.

    Args:
        arms: Names of the arms.
        draws: Cells per kind of pair and arm.
        settings: How cells are drawn.
        torques_alone: Whether the cells have no base sensor.
        show: Whether to show progress.
    """
    kinds = {"any two mistakes": None, " and ".join(ARM_AND_TOOL): ARM_AND_TOOL}
    counts = {kind: dict.fromkeys(("cells", "first", "both", "alone"), 0) for kind in kinds}
    missed = []
    jobs = [(kind, arm, _WRONG_SEEDS + i) for kind in kinds for arm in arms for i in range(draws)]
    for kind, arm, seed in _tracked(jobs, "pairs", show):
        case, lines = two_wrong_lines(arm, seed, settings, torques_alone, kinds[kind])
        said = outcome(case)
        accused, row = said["accused"], counts[kind]
        both = all(named(line, accused) for line in lines)
        row["cells"] += 1
        row["first"] += any(named(line, accused[:1]) for line in lines)
        row["both"] += both
        row["alone"] += both and len(accused) == len(lines)
        if not both:
            missed.append({"kind": kind, "arm": arm, "seed": seed, "lines": list(lines), **said})
    return {"pairs": counts, "missed": missed}


def _print_pairs(result: dict[str, Any], as_json: bool) -> None:
    if as_json:
        click.echo(json.dumps(result, indent=1))
        return
    for kind, row in result["pairs"].items():
        click.echo(
            f"{kind}: a wrong line named first: {row['first']} of {row['cells']}; both named: {row['both']}; "
            f"and no other line reported as wrong: {row['alone']}"
        )


def _tracked(jobs: list[Any], title: str, show: bool) -> Iterator[Any]:
    yield from track(jobs, title, console=Console(stderr=True), disable=not show, transient=True)


def real(folder: Path) -> dict[str, Any]:
    """What the check says of real recordings, by motor currents alone, see
    `contactsense.benchmarks.calibration.recordings`."""
    scene = Scene(robot="ur10e", base_wrench=None, joint_torque=JointTorqueSensor(signal="actual_current"))
    result = {}
    for name in (*IDENTIFICATION, *FREE, LOADED, *TOUCHED):
        found = check(scene, [read(folder / f"{name}.csv.gz", scene)[0]])
        proposals = [f"{item.line}: {item.proposed}" for item in found.wrong]
        untold = [item.line for item in found.findings if item.verdict == "cannot_tell"]
        result[name] = {
            "does not fit": proposals,
            "unexplained": list(found.unexplained),
            "left out": len(found.contacts),
            "cannot be told": len(untold),
            "lines": len(found.findings),
        }
    return result


def _print_real(result: dict[str, Any], as_json: bool) -> None:
    if as_json:
        click.echo(json.dumps(result, indent=1))
        return
    for name, said in result.items():
        told = "; ".join(said["does not fit"] + said["unexplained"]) or "nothing contradicts the scene"
        told += f"; {said['left out']} stretches left out" if said["left out"] else ""
        click.echo(f"{name}: {told}; {said['cannot be told']} of {said['lines']} lines are undetermined")


@click.command()
@click.option("--arm", "arms", multiple=True, default=("ur5e", "ur10e"), show_default=True, help="Arms.")
@click.option(
    "--draws", type=click.IntRange(0), default=20, show_default=True, help="Cells per mistake and arm."
)
@click.option(
    "--right", type=click.IntRange(0), default=200, show_default=True, help="Cells without a mistake."
)
@click.option(
    "--seconds",
    type=FiniteRange(0.0, min_open=True),
    default=Settings.seconds,
    show_default=True,
    help="Length of the motion [s].",
)
@click.option("--speed", default=Settings.speed, show_default=True, help="RMS speed of each joint [rad/s].")
@click.option(
    "--postures",
    type=click.IntRange(0),
    default=0,
    show_default=True,
    help="Number of postures at rest, instead of steady motion; 0: steady motion.",
)
@click.option(
    "--sensor",
    type=click.Choice(["wrist", "elbow"]),
    help="Cells with a sensor at the wrist or below the forearm, and mistakes there.",
)
@click.option(
    "--recordings",
    type=click.Path(exists=True, file_okay=False, path_type=Path),
    help="Check these recordings of a real UR10e instead.",
)
@click.option("--pairs", is_flag=True, help="Cells with two mistakes at once instead.")
@click.option("--torques-alone", is_flag=True, help="With --pairs: cells without a base sensor.")
@click.option("--json", "as_json", is_flag=True, help="Print the numbers for a program.")
def setup(
    arms: tuple[str, ...],
    draws: int,
    right: int,
    seconds: float,
    speed: float,
    postures: int,
    sensor: str | None,
    recordings: Path | None,
    pairs: bool,
    torques_alone: bool,
    as_json: bool,
) -> None:
    """Draw simulated cells with one mistake in the scene, and with none, and count the lines that
    `contactsense check` reports as wrong."""
    if recordings is not None:
        _print_real(real(recordings), as_json)
        return
    settings = Settings(seconds=seconds, speed=speed, postures=postures)
    if pairs:
        _print_pairs(measure_pairs(arms, draws, settings, torques_alone, True), as_json)
        return
    field = {None: "", "wrist": WRIST, "elbow": ELBOW}[sensor]
    result = measure(arms, draws, right, settings, True, field)
    if as_json:
        click.echo(json.dumps(result, indent=1))
        return
    table = Table(box=box.SIMPLE_HEAD)
    for heading in ("mistake", *arms, "no other line"):
        table.add_column(heading, justify="left" if heading == "mistake" else "right")
    named = alone = total = 0
    for kind, by_arm in result["mistakes"].items():
        named += sum(counts["named"] for counts in by_arm.values())
        alone += sum(counts["alone"] for counts in by_arm.values())
        total += draws * len(arms)
        cells = [f"{by_arm[arm]['named']} of {draws}" for arm in arms]
        only = sum(counts["alone"] for counts in by_arm.values())
        table.add_row(kind, *cells, f"{only} of {draws * len(arms)}")
    Console(width=80).print(table)
    click.echo(
        f"right line named first: {named} of {total}; and no other line reported as wrong: {alone} of {total}"
    )
    click.echo(f"right setups with a line reported as wrong: {len(result['right_accused'])} of {right}")
