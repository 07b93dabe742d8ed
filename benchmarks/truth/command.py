"""The command line of `python -m benchmarks.truth`."""

import time
from functools import partial
from importlib.util import find_spec
from pathlib import Path
from typing import TYPE_CHECKING

import click
from rich.console import Console
from rich.progress import Progress

from . import ROBOTS

if TYPE_CHECKING:
    from .arm import Arm

SUITES = ("static", "motion", "meshes")
_DEFAULT = ("ur3e", "ur5e")
_NEEDED = ("airo_models", "mujoco", "trimesh")


@click.group()
def main() -> None:
    """Ground truth that depends on nothing of contactsense."""


@main.command()
@click.option(
    "--robot",
    "names",
    type=click.Choice(list(ROBOTS)),
    multiple=True,
    help="Arm; may be repeated. The Panda needs the extra `panda`.  [default: ur3e, ur5e]",
)
@click.option(
    "--urdf",
    "files",
    type=click.Path(exists=True, dir_okay=False, path_type=Path),
    multiple=True,
    help="URDF of an arm of your own, instead; may be repeated. It is called as the file.",
)
@click.option(
    "--tip",
    help="Last link of the arm in the URDF.  [default: the end of the longest chain of revolute joints]",
)
@click.option(
    "--into",
    "folder",
    type=click.Path(file_okay=False, path_type=Path),
    required=True,
    help="Folder of the files; it is made if need be.",
)
@click.option(
    "--suite",
    "suites",
    type=click.Choice(SUITES),
    multiple=True,
    default=SUITES,
    help="Arm at rest, runs of a moving one, or the visual meshes of the links; may be repeated.",
)
@click.option(
    "--contacts",
    type=click.IntRange(1),
    default=2000,
    show_default=True,
    help="Contacts with each arm at rest.",
)
@click.option(
    "--runs",
    type=click.IntRange(1),
    default=8,
    show_default=True,
    help="Runs of each moving arm; the last quarter of them with two contacts at a time.",
)
@click.option(
    "--seed", type=click.IntRange(0), default=1, show_default=True, help="The same seed gives the same files."
)
def make(
    names: tuple[str, ...],
    files: tuple[Path, ...],
    tip: str | None,
    folder: Path,
    suites: tuple[str, ...],
    contacts: int,
    runs: int,
    seed: int,
) -> None:
    """Write static_points_ROBOT.npz, motion_ROBOT.npz and meshes/ROBOT/LINK.ply, which `contactsense bench
    truth`, `contactsense bench motion` and the option `--meshes` of benchmarks read."""
    missing = [module for module in _NEEDED if find_spec(module) is None]
    if missing:
        raise click.ClickException(
            f"{', '.join(missing)} cannot be imported: pip install '.[truth]' in the folder of the sources"
        )
    if tip is not None and len(files) != 1:
        raise click.UsageError(f"--tip: expected one --urdf, got {len(files)}")
    from . import arm, urdf_arm

    try:
        arms = [arm.read(name) for name in names or (() if files else _DEFAULT)]
        arms += [urdf_arm.read(path, tip) for path in files]
    except (ImportError, OSError, ValueError) as error:
        raise click.ClickException(str(error)) from None
    try:
        folder.mkdir(parents=True, exist_ok=True)
        for one in arms:
            for suite in suites:
                begin = time.perf_counter()
                made = (
                    _meshes(folder, one)
                    if suite == "meshes"
                    else _contacts(folder, one, suite, contacts if suite == "static" else runs, seed)
                )
                click.echo(f"{made}, {time.perf_counter() - begin:.0f} s")
    except OSError as error:
        raise click.ClickException(f"{folder}: cannot write: {error.strerror}") from None


def _meshes(folder: Path, arm: "Arm") -> str:
    """Write the links of one arm, and say what."""
    from . import mesh_files

    mesh_files.write(folder / "meshes" / arm.name, arm)
    return f"{folder / 'meshes' / arm.name}: {len(arm.links)} meshes"


def _contacts(folder: Path, arm: "Arm", suite: str, count: int, seed: int) -> str:
    """Write one suite of one arm, and say what."""
    from . import arrays, motion, static_points

    with Progress(console=Console(stderr=True), transient=True) as progress:
        step = partial(progress.advance, progress.add_task(f"{arm.name}, {suite}", total=count))
        if suite == "static":
            kind, made = "static_points", static_points.make(arm, count, seed, step)
        else:
            kind, made = "motion", motion.make(arm, count, seed, step)
    path = folder / f"{kind}_{arm.name}.npz"
    arrays.write(path, made)
    return f"{path}: {count} {'contacts' if suite == 'static' else 'runs'}"
