"""Command-line options that several benchmarks share."""

from pathlib import Path
from typing import get_args

import click

from contactsense.benchmarks.accuracy.static_cases import SENSORS, Detail
from contactsense.benchmarks.accuracy.static_points import HALVES
from contactsense.scene import LinkPrior

FOLDER = click.Path(exists=True, file_okay=False, path_type=Path)

truth_folder = click.argument("folder", type=FOLDER)
robots = click.option(
    "--robot", "robots", multiple=True, default=("ur5e", "ur10e"), help="Arm; may be repeated."
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
as_json = click.option("--json", "as_json", is_flag=True, help="Print the numbers for a program.")
