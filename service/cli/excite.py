"""`contactsense excite --robot ur10e`: a short motion for a well-posed calibration."""

import json
from pathlib import Path
from typing import Any

import click
import numpy as np
from rich import box
from rich.console import Console
from rich.progress import Progress
from rich.table import Table

from contactsense.calibration import CalibrationError
from contactsense.calibration.motion.excitation import ExcitationSettings, Proposal, propose_excitation
from contactsense.robots import RobotError, load
from contactsense.robots.units import FURTHEST
from contactsense.scene import Scene, SceneError
from contactsense.service.cli.options.finite_range import FiniteRange
from contactsense.service.cli.options.joint_angles import joint_angles
from contactsense.service.cli.options.output_file import check_writable
from contactsense.service.recordings.export import check_format, write_columns
from contactsense.service.recordings.problems import RecordingError


@click.command()
@click.option("--robot", "name", help="Arm: a name of `contactsense robots`, or a path.")
@click.option(
    "--scene", "path", type=click.Path(path_type=Path), help="Scene file (YAML): arm, tool and sensors."
)
@click.option("--into", type=click.Path(path_type=Path), help="Write the motion into this table.")
@click.option(
    "--seconds",
    default=ExcitationSettings.seconds,
    show_default=True,
    type=FiniteRange(4.0, 600.0),
    help="Length of the motion [s].",
)
@click.option(
    "--rate",
    default=125.0,
    show_default=True,
    type=FiniteRange(1.0, 10_000.0),
    help="Rows per second in the table [Hz].",
)
@click.option(
    "--speed",
    default=ExcitationSettings.speed,
    show_default=True,
    type=FiniteRange(0.0, 1.0, min_open=True),
    help="Highest speed, of each joint's limit.",
)
@click.option(
    "--floor",
    default=ExcitationSettings.floor,
    show_default=True,
    type=FiniteRange(-FURTHEST, FURTHEST),
    help="Height above the base plane [m].",
)
@click.option(
    "--clearance",
    default=ExcitationSettings.clearance,
    show_default=True,
    type=FiniteRange(0.0, FURTHEST),
    help="Distance between links [m].",
)
@click.option("--home", help="Mean posture: joint angles in degrees, separated by commas.")
@click.option(
    "--tries", default=60, show_default=True, type=click.IntRange(2), help="Number of candidate motions."
)
@click.option(
    "--seed", type=click.IntRange(0), default=0, show_default=True, help="Seed of the random numbers."
)
@click.option("--json", "as_json", is_flag=True, help="Print the result for a program.")
def excite(
    name: str | None,
    path: Path | None,
    into: Path | None,
    seconds: float,
    rate: float,
    speed: float,
    floor: float,
    clearance: float,
    home: str | None,
    tries: int,
    seed: int,
    as_json: bool,
) -> None:
    """Propose a motion from rest to rest for `contactsense calibrate`.

    The motion respects joint limits, the height above the plane on which the base stands, and distances
    between the links, as far as the model contains them. The surroundings of the arm are not known: run the
    motion slowly first, with a hand on the emergency stop. --into writes the columns timestamp, actual_q_0..,
    actual_qd_0.. of a recording.
    """
    if (name is None) == (path is None):
        raise click.UsageError("--robot and --scene: expected one of them")
    check_writable("--into", into)
    try:
        if into is not None:
            check_format(into)
        scene = Scene(robot=load(name)) if name is not None else Scene.load(path or "")
        joints = len(scene.robot.joints)
        center = None if home is None else tuple(joint_angles("--home", home, joints).tolist())
        settings = ExcitationSettings(seconds, speed, floor=floor, clearance=clearance, home=center)
        with Progress(console=Console(stderr=True), transient=True) as progress:
            task = progress.add_task("motions", total=tries)
            found = propose_excitation(scene, settings, tries, seed, lambda: progress.advance(task))
        if into is not None:
            write_columns(into, table_of(found, rate))
    except (RobotError, SceneError, CalibrationError, RecordingError) as error:
        raise click.ClickException(str(error)) from None
    if as_json:
        click.echo(json.dumps(as_plain(found), indent=1))
    else:
        _print(found, scene, into)


def table_of(found: Proposal, rate: float) -> dict[str, np.ndarray]:
    """The motion as columns of a recording, with `rate` rows per second."""
    t = np.linspace(0.0, found.motion.period, round(found.motion.period * rate) + 1)
    q, qd, _ = found.motion.at(t)
    columns = {"timestamp": t}
    for group, array in (("actual_q", q), ("actual_qd", qd)):
        columns |= {f"{group}_{j}": array[:, j] for j in range(q.shape[1])}
    return columns


def as_plain(found: Proposal) -> dict[str, Any]:
    """The proposal as plain data."""
    expected = found.expected
    return {
        "seconds": found.motion.period,
        "motion": {
            "center": found.motion.center.tolist(),
            "sine": found.motion.sine.tolist(),
            "cosine": found.motion.cosine.tolist(),
        },
        "condition": expected.condition,
        "parameters": [
            {"name": entry.name, "unit": entry.unit, "std": float(std) if excited else None}
            for entry, std, excited in zip(expected.entries, expected.std, expected.excited, strict=True)
        ],
        "not_excited": [
            e.name for e, excited in zip(expected.entries, expected.excited, strict=True) if not excited
        ],
        "lowest": found.lowest,
        "nearest": found.nearest if np.isfinite(found.nearest) else None,
        "speed": found.speed.tolist(),
        "torque": found.torque.tolist(),
    }


def _print(found: Proposal, scene: Scene, into: Path | None) -> None:
    console = Console(soft_wrap=True, markup=False)
    table = Table(box=box.SIMPLE_HEAD)
    for heading in ("parameter", "expected std", "unit"):
        table.add_column(heading, justify="right" if heading == "expected std" else "left")
    expected = found.expected
    for entry, std, excited in zip(expected.entries, expected.std, expected.excited, strict=True):
        table.add_row(entry.name, f"{std:.2g}" if excited else "not excited", entry.unit)
    console.print(table)
    table = Table(box=box.SIMPLE_HEAD)
    for heading in ("joint", "from [deg]", "to [deg]", "speed [rad/s]", "torque [Nm]"):
        table.add_column(heading, justify="left" if heading == "joint" else "right")
    q = np.degrees(found.motion.at(np.linspace(0.0, found.motion.period, 2000))[0])
    for j, joint in enumerate(scene.robot.joints):
        numbers = (f"{q[:, j].min():.0f}", f"{q[:, j].max():.0f}")
        table.add_row(joint.name, *numbers, f"{found.speed[j]:.2f}", f"{found.torque[j]:.0f}")
    console.print(table)
    console.print(f"condition number of the scaled regressor: {expected.condition:.3g}")
    console.print(f"lowest point {found.lowest:.3f} m above the base plane")
    if np.isfinite(found.nearest):
        console.print(f"smallest distance between links that are not neighbours {found.nearest:.3f} m")
    if into is not None:
        console.print(f"{found.motion.period:g} s written into {into}", highlight=False)
