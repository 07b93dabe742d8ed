"""`contactsense map SCENE --posture ...`: what the scene's sensors can determine of pushes on the arm."""

import json
from math import degrees, isfinite
from pathlib import Path
from typing import Any

import click
import numpy as np

from contactsense.detection.detectable_force import DETECTION
from contactsense.scene import Scene, SceneError
from contactsense.scene_model.reading_limits import LARGEST_FORCE
from contactsense.service.cli.map_table import compare_maps, show_map
from contactsense.service.cli.options.finite_range import FiniteRange
from contactsense.service.cli.options.joint_angles import joint_angles
from contactsense.service.cli.options.picture_file import PicturePath, picture_file
from contactsense.service.scene.summary import scene_warnings
from contactsense.surface_map.detectability import Detectability, detectability


@click.command(name="map")
@click.argument("path", metavar="SCENE", type=click.Path(path_type=Path))
@click.option(
    "--posture", required=True, metavar="Q1,...", help="Joint angles in degrees, separated by commas."
)
@click.option(
    "--force",
    type=FiniteRange(0.0, LARGEST_FORCE, min_open=True),
    help="Force for error and link [N]; by default the scene's `force`.",
)
@click.option(
    "--detection",
    type=FiniteRange(0.0, 1.0, min_open=True, max_open=True),
    default=DETECTION,
    show_default=True,
    help="Probability with which the smallest force is detected.",
)
@click.option(
    "--compare", "other", type=click.Path(path_type=Path), help="Another scene, to be shown beside SCENE."
)
@click.option("--picture", type=PicturePath(), help="Draw the arm by smallest force into this PNG.")
@click.option("--json", "as_json", is_flag=True, help="Print the result for a program.")
def surface_map(
    path: Path,
    posture: str,
    force: float | None,
    detection: float,
    other: Path | None,
    picture: Path | None,
    as_json: bool,
) -> None:
    """Show how well the sensors of SCENE detect and locate a push on each link, before you buy any.

    For each place of the surface, and pushes along the inward normal: the smallest force that is detected at
    the scene's false-alarm rate, the error of the place, and the probability of naming the link. All follow
    from the noise that SCENE states, for one measurement of the arm at rest.
    """
    try:
        scenes = [Scene.load(scene) for scene in (path, other) if scene is not None]
    except SceneError as error:
        raise click.ClickException(str(error)) from None
    joints = [len(scene.robot.joints) for scene in scenes]
    if joints[-1] != joints[0]:
        raise click.ClickException(
            f"--compare: expected an arm with {joints[0]} joints as in {path}, got {joints[-1]}"
        )
    q = _within_limits(posture, scenes[0])
    if picture is not None and not picture.parent.is_dir():
        raise click.ClickException(f"{picture}: cannot write the picture: no such folder")
    force = scenes[0].force if force is None else force
    try:
        found = [detectability(scene, q, force=force, detection=detection) for scene in scenes]
    except ValueError as error:
        raise click.ClickException(str(error)) from None
    titles = [str(scene) for scene in (path, other) if scene is not None]
    for title, scene in zip(titles, scenes, strict=True):
        for text in scene_warnings(scene):  # such as of a range that the arm's weight reaches
            click.echo(f"warning: {title}: {text}", err=True)
    if picture is not None:
        with picture_file(picture):
            from contactsense.service.drawing.force_map import draw_force_map

            draw_force_map(list(zip(titles, scenes, found, strict=True)), q, picture)
    if as_json:
        plain = {
            "posture": q.tolist(),
            "maps": [as_plain(*case) for case in zip(titles, scenes, found, strict=True)],
        }
        click.echo(json.dumps(plain, indent=1, allow_nan=False))
    elif other is None:
        show_map(scenes[0], found[0])
    else:
        compare_maps(titles, scenes, found)


def _within_limits(text: str, scene: Scene) -> np.ndarray:
    """Joint positions, shape (n,) [rad]."""
    joints = scene.robot.joints
    q = joint_angles("--posture", text, len(joints))
    for joint, angle in zip(joints, np.degrees(q), strict=True):
        low, high = (degrees(limit) if isfinite(limit) else limit for limit in joint.position_limits)
        if not low - 1e-6 <= angle <= high + 1e-6:
            raise click.UsageError(
                f"--posture: {joint.name}: expected {low:g} to {high:g} degrees, got {angle:g}"
            )
    return q


def as_plain(title: str, scene: Scene, found: Detectability) -> dict[str, Any]:
    """A map as plain data in SI units; null where the sensors do not determine them."""
    return {
        "scene": title,
        "robot": scene.robot.name,
        "force": found.force,
        "friction": found.friction,
        "detection": found.detection,
        "false_alarms_per_hour": found.false_alarms_per_hour,
        "links": [
            {
                key: [_finite(part) for part in value] if isinstance(value, tuple) else value
                for key, value in link._asdict().items()
            }
            for link in found.by_link()
        ],
        "places": {
            "link": [found.link_names[index] for index in found.link],
            "point_base": found.point_base.tolist(),
            "normal_base": found.normal_base.tolist(),
            "share": found.share.tolist(),
            **{
                key: [_finite(value) for value in getattr(found, key).tolist()]
                for key in ("smallest_force", "error", "error_95", "link_probability")
            },
        },
    }


def _finite(value: float) -> float | None:
    return value if isfinite(value) else None
