"""Reading the static ground truth: one contact per sample on an arm at rest."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import click
import numpy as np

from contactsense.benchmarks.truth_arms import STATIC, file_of

_ARRAYS = {
    "q": "q",
    "torque": "tau",
    "base_wrench": "base_wrench",
    "link": "link",
    "point_base": "c_base",
    "noise_torque": "noise_tau",
    "noise_wrench": "noise_wrench",
}
"""Field -> name in the file."""


HALVES = {"both": slice(None), "first": slice(1000), "second": slice(1000, None)}
"""Half of a file's 2000 contacts -> rows. Not by parity: odd ones carry torsion, even ones none."""


@dataclass(frozen=True)
class StaticPoints:
    """N contacts and the sensors' readings; units and frames as in `contactsense.Sample`."""

    robot: str
    """Name of the arm, or its own file."""
    gravity: float
    q: np.ndarray
    torque: np.ndarray
    base_wrench: np.ndarray
    link: np.ndarray
    point_base: np.ndarray
    noise_torque: np.ndarray
    noise_wrench: np.ndarray


def read(folder: Path, robot: str) -> StaticPoints:
    """Contacts of `static_points_ROBOT.npz` in `folder`; `robot`: name of the arm, or its own file.

    Raises:
        click.ClickException: the file is missing, unreadable or lacks an array; the message names it.
    """
    found = read_arrays(folder, robot, (*_ARRAYS.values(), "gravity"))
    gravity = float(np.linalg.norm(found["gravity"]))
    arrays = {field: found[name] for field, name in _ARRAYS.items()}
    arrays["link"] = arrays["link"].astype(np.int64)
    floats = {field: array.astype(np.float64) for field, array in arrays.items() if field != "link"}
    return StaticPoints(robot=robot, gravity=gravity, link=arrays["link"], **floats)


def read_arrays(folder: Path, robot: str, names: Sequence[str]) -> dict[str, np.ndarray]:
    """Arrays of `static_points_ROBOT.npz` in `folder` by their names in the file; docs/ground_truth.md lists
    them.

    Raises:
        click.ClickException: as for `read`.
    """
    path = file_of(folder, STATIC, robot)
    try:
        with np.load(path) as file:
            missing = [name for name in names if name not in file]
            if missing:
                raise click.ClickException(
                    f"{path}: expected the array {missing[0]!r}, found {', '.join(file.files)}"
                )
            return {name: np.asarray(file[name]) for name in names}
    except (OSError, ValueError) as error:
        raise click.ClickException(f"{path}: cannot read ground truth: {error}") from None


def select(points: StaticPoints, rows: slice | np.ndarray) -> StaticPoints:
    """Some of the contacts."""
    arrays = {name: value[rows] for name, value in vars(points).items() if isinstance(value, np.ndarray)}
    return StaticPoints(robot=points.robot, gravity=points.gravity, **arrays)
