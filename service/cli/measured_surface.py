"""`contactsense decompose ARM --measure FILE`: how far the primitives of a surface file are from the meshes.

For a file that does not say it, or for other meshes.
"""

from pathlib import Path
from typing import TYPE_CHECKING

import click

from contactsense.robots import Robot, RobotError
from contactsense.robots.surface.deviation_table import lines
from contactsense.robots.yaml_schema import read_surface

if TYPE_CHECKING:
    import trimesh

_SAMPLES = 10000
"""Number of samples on each mesh: about twenty in a cell."""


def measured_again(robot: Robot, meshes: "dict[str, trimesh.Trimesh]", path: Path) -> str:
    """The surface file at `path` with the deviations that are measured now; a warning for each link without a
    mesh that can be touched, whose deviations stay.

    Raises:
        click.ClickException: there is no such file, or it has a link that the arm does not have.
    """
    from contactsense.robots.decomposition.local_deviation import local_deviation
    from contactsense.robots.decomposition.neighbour_poses import neighbour_poses
    from contactsense.robots.decomposition.outer_skin import OutOfReachError, outer_skin
    from contactsense.robots.decomposition.surface_error import bodies_of
    from contactsense.robots.decomposition.yaml_export import text

    try:
        surface = read_surface(path)
    except RobotError as error:
        raise click.ClickException(str(error)) from error
    comments = [
        line.removeprefix("# ")
        for line in path.read_text(encoding="utf-8").splitlines()
        if line.startswith("#") and not line.startswith("# Deviations")
    ]
    deviations = {}
    for name, link in surface.links.items():
        if name not in robot.link_names:
            raise click.ClickException(f"{path}: links.{name}: {robot.name} has no such link")
        click.echo(name, err=True)
        deviations[name] = {
            "coarse": link.coarse_deviation.splitlines(),
            "fine": link.fine_deviation.splitlines(),
        }
        if name not in meshes:
            click.echo(f"warning: {name}: no mesh; its deviations stay as they are", err=True)
            continue
        number = robot.link_names.index(name)
        try:
            skin = outer_skin(meshes[name], neighbour_poses(robot, meshes, number), _SAMPLES)
        except OutOfReachError as error:
            click.echo(f"warning: {name}: {error}; its deviations stay as they are", err=True)
            continue
        deviations[name] = {
            "coarse": lines(local_deviation(bodies_of(link.coarse), skin, moved=True)),
            "fine": lines(local_deviation(bodies_of(link.fine), skin)),
        }
    links = {name: {"coarse": link.coarse, "fine": link.fine} for name, link in surface.links.items()}
    comments.append(
        "Deviations: contactsense decompose --measure; primitive, x y z [mm], distance [mm], normal [deg], "
        "and of coarse ones mean shift [mm], mean rotation vector [deg]"
    )
    return text(surface.robot, links, comments, surface.fit_seconds, surface.tip, deviations)
