"""`contactsense scene show SCENE`: what was understood of a scene, in words and as a picture."""

import json
from pathlib import Path

import click
import numpy as np
from rich.console import Console
from rich.table import Table

from contactsense.scene import Scene, SceneError
from contactsense.service.scene.summary import as_plain, scene_warnings, summarize, usual_posture


@click.command()
@click.argument("path", metavar="SCENE", type=click.Path(path_type=Path))
@click.option("--picture", type=click.Path(path_type=Path), help="Draw the arm in its place into this PNG.")
@click.option("--pose", help="Joint angles in degrees, separated by commas, for picture and readings.")
@click.option("--json", "as_json", is_flag=True, help="Print JSON.")
def show(path: Path, picture: Path | None, pose: str | None, as_json: bool) -> None:
    """Print what was understood of SCENE: mounting, tool, sensors, what they must read at rest."""
    try:
        scene = Scene.load(path)
    except SceneError as error:
        raise click.ClickException(str(error)) from None
    q = _posture(pose, len(scene.robot.joints))
    if picture is not None:
        _draw(scene, q, picture)
    if as_json:
        click.echo(json.dumps(as_plain(scene, q), indent=1))
        return
    console = Console()
    table = Table.grid(padding=(0, 2))
    for line in summarize(scene, q):
        table.add_row(line.subject, line.text)
    console.print(table, highlight=False)
    for warning in scene_warnings(scene):
        console.print(f"warning: {warning}", highlight=False, soft_wrap=True)


def _posture(pose: str | None, joints: int) -> np.ndarray:
    if pose is None:
        return usual_posture(joints)
    try:
        q = np.radians([float(angle) for angle in pose.split(",")])
    except ValueError:
        q = np.empty(0)
    if len(q) != joints or not np.isfinite(q).all():
        raise click.BadParameter(
            f"expected {joints} numbers separated by commas, got {pose!r}", param_hint="--pose"
        )
    return q


def _draw(scene: Scene, q: np.ndarray, path: Path) -> None:
    try:
        from contactsense.service.scene.picture import draw_scene
    except ImportError as error:
        raise click.ClickException(
            f"pictures need the extra packages: pip install contactsense[geometry] ({error})"
        ) from None
    try:
        draw_scene(scene, q, path)
    except OSError as error:
        raise click.ClickException(f"{path}: cannot write: {error.strerror}") from None
