"""`contactsense robots`: lists the arms of the library, or shows one of them in detail."""

import json
from collections import Counter
from math import degrees, isfinite
from pathlib import Path
from typing import Any

import click
from rich import box
from rich.console import Console
from rich.table import Table

from contactsense import robots as library
from contactsense.robots import Robot, RobotError
from contactsense.robots.library import EQUIVALENT_MODELS, in_library
from contactsense.service.cli.options.joint_angles import joint_angles
from contactsense.service.cli.options.picture_file import PicturePath, picture_file
from contactsense.service.drawing.posture import usual_posture


@click.command()
@click.argument("name", required=False)
@click.option("--json", "as_json", is_flag=True, help="Print JSON.")
@click.option("--picture", type=PicturePath(), help="Draw NAME's primitives into this PNG.")
@click.option(
    "--posture", "--pose", "posture", help="Joint angles for the picture in degrees, separated by commas."
)
@click.option("--coarse", is_flag=True, help="Draw the coarse level of detail instead of the fine one.")
def robots(name: str | None, as_json: bool, picture: Path | None, posture: str | None, coarse: bool) -> None:
    """List the arms, or show NAME: its links, joints and primitives. NAME may be a path to a
    URDF or a .yaml file.

    Of a URDF, the arm is the longest chain of revolute joints, without a gripper's fingers.
    """
    if picture is None and (posture is not None or coarse):
        raise click.UsageError(f"{'--coarse' if posture is None else '--posture'} needs --picture")
    if name is None:
        if picture is not None:
            raise click.UsageError("--picture needs the NAME of a robot")
        arms = [library.load(known) for known in library.names()]
        if as_json:
            click.echo(json.dumps([_summary(arm) for arm in arms], indent=1))
        else:
            _list(arms)
        return
    try:
        robot = library.load(name)
    except RobotError as error:
        raise click.ClickException(str(error)) from error
    if picture is not None:
        _draw(robot, picture, posture, coarse)
    if as_json:
        click.echo(json.dumps(_details(robot), indent=1))
    elif picture is None:
        _show(robot)


def _list(arms: list[Robot]) -> None:
    table = Table(box=box.SIMPLE_HEAD)
    for heading in ("arm", "joints", "mass [kg]", "primitives", "of them coarse"):
        table.add_column(heading, justify="left" if heading == "arm" else "right")
    for arm in arms:
        entry = _summary(arm)
        models = ", ".join((arm.name, *entry["equivalent_models"]))
        table.add_row(models, *(str(entry[key]) for key in ("joints", "mass", "primitives", "coarse")))
    Console(markup=False).print(table)


def _show(robot: Robot) -> None:
    console = Console(markup=False)
    links = Table(title=f"{robot.name}: links", box=box.SIMPLE_HEAD, title_justify="left")
    for heading in ("link", "mass [kg]", "centre of mass [m]", "primitives"):
        links.add_column(heading, justify="right" if "kg" in heading else "left")
    for link in robot.links:
        kinds = Counter(shape.kind for shape in link.primitives)
        links.add_row(
            link.name,
            f"{link.inertia.mass:g}",
            ", ".join(f"{value:g}" for value in link.inertia.com),
            ", ".join(f"{count} {kind}" for kind, count in kinds.items()) or "none",
        )
    console.print(links)
    if robot.held:
        console.print(f"held at zero: {', '.join(robot.held)}\n", highlight=False)
    joints = Table(title=f"{robot.name}: joints", box=box.SIMPLE_HEAD, title_justify="left")
    for heading in ("joint", "range [deg]", "speed [deg/s]", "torque [Nm]", "Nm/A"):
        joints.add_column(heading, justify="left" if heading == "joint" else "right")
    for joint in robot.joints:
        low, high = (degrees(limit) for limit in joint.position_limits)
        joints.add_row(
            joint.name,
            f"{low:g} to {high:g}" if isfinite(low) else "endless",
            f"{degrees(joint.velocity_limit):g}" if isfinite(joint.velocity_limit) else "unknown",
            f"{joint.torque_limit:g}" if isfinite(joint.torque_limit) else "unknown",
            "unknown" if joint.torque_constant is None else f"{joint.torque_constant:g}",
        )
    console.print(joints)


def _draw(robot: Robot, path: Path, posture: str | None, coarse: bool) -> None:
    joints = len(robot.joints)
    q = usual_posture(robot) if posture is None else joint_angles("--posture", posture, joints)
    with picture_file(path):
        from contactsense.service.drawing.arm_picture import draw_arm_picture

        try:
            draw_arm_picture(robot, q, path, coarse)
        except ValueError as error:
            raise click.ClickException(str(error)) from error


def _summary(robot: Robot) -> dict[str, Any]:
    return {
        "name": robot.name,
        "equivalent_models": [
            model for model, arm in EQUIVALENT_MODELS.items() if in_library(robot) and arm == robot.name
        ],
        "joints": len(robot.joints),
        "mass": round(robot.mass, 3),
        "primitives": sum(len(link.primitives) for link in robot.links),
        "coarse": sum(len(link.coarse) for link in robot.links),
    }


def _details(robot: Robot) -> dict[str, Any]:
    """All data of a robot in SI units; null if a limit or number does not exist."""
    return {
        **_summary(robot),
        "links": [
            {
                "name": link.name,
                "mass": link.inertia.mass,
                "com": link.inertia.com.tolist(),
                "tensor": link.inertia.tensor.tolist(),
                "primitives": [shape.model_dump() for shape in link.primitives],
                "coarse": [shape.model_dump() for shape in link.coarse],
            }
            for link in robot.links
        ],
        "joints": [
            {
                "name": joint.name,
                "rotation": joint.rotation.tolist(),
                "translation": joint.translation.tolist(),
                "axis": joint.axis.tolist(),
                "position_limits": [limit if isfinite(limit) else None for limit in joint.position_limits],
                "velocity_limit": joint.velocity_limit if isfinite(joint.velocity_limit) else None,
                "torque_limit": joint.torque_limit if isfinite(joint.torque_limit) else None,
                "rotor_inertia": joint.rotor_inertia,
                "torque_constant": joint.torque_constant,
            }
            for joint in robot.joints
        ],
        "held": list(robot.held),
        "flange": {
            "rotation": robot.flange_rotation.tolist(),
            "translation": robot.flange_translation.tolist(),
        },
    }
