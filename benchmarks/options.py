"""Command-line options that several benchmarks share."""

from collections.abc import Callable
from pathlib import Path
from typing import Any, TypeVar, get_args

import click

from contactsense.benchmarks.static_truth.cases import SENSORS, Detail
from contactsense.benchmarks.static_truth.points import HALVES
from contactsense.scene import LinkPrior
from contactsense.service.cli.options.finite_range import FiniteRange

_Command = TypeVar("_Command", bound=Callable[..., Any])

FOLDER = click.Path(exists=True, file_okay=False, path_type=Path)

truth_folder = click.argument("folder", type=FOLDER)
robots = click.option(
    "--robot", "robots", multiple=True, default=("ur5e", "ur10e"), help="Arm; may be repeated."
)
truth_robots = click.option(
    "--robot",
    "robots",
    multiple=True,
    help="Arm: its name, or the file of an arm of your own; may be repeated.  [default: all in FOLDER]",
)
sensor_sets = click.option(
    "--sensors",
    "kinds",
    type=click.Choice(list(SENSORS)),
    multiple=True,
    default=tuple(SENSORS),
    help="What is measured; may be repeated.  [default: all of these]",
)
detail = click.option(
    "--detail",
    type=click.Choice(get_args(Detail)),
    default="fine",
    show_default=True,
    help="Level of detail of the surface.",
)
fitted_detail = click.option(
    "--detail",
    type=click.Choice(["fine", "coarse"]),
    default="fine",
    show_default=True,
    help="Level of detail of the primitives.",
)
meshes = click.option("--meshes", type=FOLDER, help="For --detail skin: folder with ROBOT/LINK.ply.")
half = click.option(
    "--half",
    type=click.Choice(list(HALVES)),
    default="both",
    show_default=True,
    help="Which of the contacts: tune on one half, evaluate on the other.",
)
link_prior = click.option(
    "--link-prior",
    type=click.Choice(get_args(LinkPrior)),
    default="area",
    show_default=True,
    help="Prior over links: in proportion to their surface, or the same for each.",
)


def force(text: str) -> Callable[[_Command], _Command]:
    """The option --force [N], 20 N by default; `text`: its help."""
    return click.option(
        "--force", type=FiniteRange(0.0, min_open=True), default=20.0, show_default=True, help=text
    )


def trials(default: int) -> Callable[[_Command], _Command]:
    """The option --trials: how many of each kind."""
    return click.option(
        "--trials",
        type=click.IntRange(1),
        default=default,
        show_default=True,
        help="Number of trials of each kind.",
    )


as_json = click.option("--json", "as_json", is_flag=True, help="Print the numbers for a program.")
