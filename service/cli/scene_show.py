"""`contactsense scene show SCENE`: what was understood of a scene, in words and as a picture."""

import json
from pathlib import Path

import click
from rich.console import Console
from rich.table import Table

from contactsense.scene import Scene, SceneError
from contactsense.service.cli.options.joint_angles import joint_angles
from contactsense.service.cli.options.picture_file import PicturePath, picture_file
from contactsense.service.drawing.posture import usual_posture
from contactsense.service.scene.skin_meshes import check_meshes
from contactsense.service.scene.summary import (
    as_plain,
    link_prior_line,
    prior_of_links,
    scene_warnings,
    summarize,
)


@click.command()
@click.argument("path", metavar="SCENE", type=click.Path(path_type=Path))
@click.option("--picture", type=PicturePath(), help="Draw the arm in its place into this PNG.")
@click.option(
    "--posture",
    "--pose",
    "posture",
    help="Joint angles in degrees, separated by commas, for picture and readings.",
)
@click.option("--json", "as_json", is_flag=True, help="Print JSON.")
def show(path: Path, picture: Path | None, posture: str | None, as_json: bool) -> None:
    """Print what was understood of SCENE: mounting, tool, sensors, what they must read at rest."""
    try:
        scene = Scene.load(path)
    except SceneError as error:
        raise click.ClickException(str(error)) from None
    try:
        check_meshes(scene)
    except SceneError as error:
        raise click.ClickException(f"{path}: {error}") from None
    joints = len(scene.robot.joints)
    q = usual_posture(scene.robot) if posture is None else joint_angles("--posture", posture, joints)
    if picture is not None:
        with picture_file(picture):
            from contactsense.service.scene.picture import draw_scene

            draw_scene(scene, q, picture)
    if as_json:
        click.echo(json.dumps({**as_plain(scene, q), "link_prior": prior_of_links(scene)}, indent=1))
        return
    console = Console(markup=False)
    table = Table.grid(padding=(0, 2))
    for line in (*summarize(scene, q), link_prior_line(scene)):
        table.add_row(line.subject, line.text)
    console.print(table, highlight=False)
    for warning in scene_warnings(scene):
        console.print(f"warning: {warning}", highlight=False, soft_wrap=True)
