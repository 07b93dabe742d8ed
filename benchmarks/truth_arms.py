"""The arms whose ground truth is in a folder."""

from collections.abc import Sequence
from pathlib import Path

import click

from contactsense.robots.library import sorted_by_number

STATIC = "static_points"
"""Beginning of the names of files with static contacts; those of moving arms begin with their suite."""


def files_of(folder: Path, chosen: Sequence[str], suites: Sequence[str]) -> list[tuple[str, str]]:
    """Arm and suite of each file SUITE_ROBOT.npz that is to be read.

    Args:
        folder: Folder with the files.
        chosen: Names of arms or their own files, which are then read whether there is ground truth or not;
            empty: all of the folder.
        suites: Beginnings of the names of the files.

    Raises:
        click.ClickException: no arm is chosen, and the folder has none.
    """
    if chosen:
        return [(name, suite) for name in chosen for suite in suites]
    names = {p.stem.removeprefix(f"{s}_") for s in suites for p in folder.glob(f"{s}_*.npz")}
    found = [
        (name, suite)
        for name in sorted_by_number(names)
        for suite in suites
        if file_of(folder, suite, name).exists()
    ]
    if not found:
        expected = " or ".join(f"{suite}_ROBOT.npz" for suite in suites)
        raise click.ClickException(f"{folder}: expected {expected}, found none")
    return found


def name_of(robot: str) -> str:
    """Name of an arm, which is given by it or by its own file, such as a URDF."""
    return Path(robot).stem


def file_of(folder: Path, suite: str, robot: str) -> Path:
    """The file of an arm."""
    return folder / f"{suite}_{name_of(robot)}.npz"


def static_arms(folder: Path, chosen: Sequence[str]) -> list[str]:
    """Arms whose static contacts are to be read; as for `files_of`."""
    return [name for name, _ in files_of(folder, chosen, (STATIC,))]
