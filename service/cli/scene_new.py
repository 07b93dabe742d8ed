"""`contactsense scene new FILE`: writes a commented scene file from options, or from answers on a
terminal."""

import shlex
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any, get_args

import click

from contactsense import robots
from contactsense.robots.file_references import moved
from contactsense.robots.files.whole_file import write_text
from contactsense.scene import LinkPrior, Scene, SceneError
from contactsense.sensors.settings import CURRENTS, JointTorqueSignal
from contactsense.service.cli.options.number_list import Numbers
from contactsense.service.cli.options.wrench_sensor_options import WrenchSensorOptions
from contactsense.service.scene.commented_yaml import commented_yaml
from contactsense.service.scene.summary import scene_warnings

_SIGNALS = (*get_args(JointTorqueSignal), "none")
_TORQUE = ("torque_fields", "torque_constants", "torque_noise")
"""Options that describe the signal of the joint torques."""
_MOUNTINGS = ("table", "ceiling", "wall")
_BASE = WrenchSensorOptions(
    name="base",
    place="under the base",
    frame="base",
    weight="an arm on a table reads a force along -z",
    usual=True,
)
_WRIST = WrenchSensorOptions(
    name="wrist",
    place="between flange and tool",
    frame="flange",
    weight="the tool's weight reads as a force along gravity",
    usual=False,
)


class Mounting(click.ParamType):  # type: ignore[type-arg]  # generic for mypy only
    """A mounting by its name, or three angles."""

    name = "MOUNTING"

    def convert(
        self, value: Any, param: click.Parameter | None, ctx: click.Context | None
    ) -> str | list[float]:
        """The name, or the angles."""
        if value in _MOUNTINGS:
            return str(value)
        try:
            return Numbers(3).convert(value, param, ctx)
        except click.BadParameter:
            self.fail(f"expected {', '.join(_MOUNTINGS)} or roll,pitch,yaw in rad, got {value!r}", param, ctx)


@click.command()
@click.argument("path", metavar="FILE", type=click.Path(path_type=Path))
@click.option("--robot", help="Name of the arm, or path of a URDF or YAML file.")
@click.option("--mounting", type=Mounting(), help="table, ceiling, wall, or roll,pitch,yaw in rad.")
@click.option("--tool-mass", type=float, help="Mass of tool or payload in kg; 0: none.")
@click.option("--tool-com", type=Numbers(3), help="Its centre of mass in the flange frame, x,y,z in m.")
@click.option("--tool-name", help="Its name in estimates.  [default: tool]")
@_BASE
@click.option("--torque-signal", type=click.Choice(_SIGNALS), help="RTDE signal of the joint torques.")
@click.option("--torque-fields", help="RTDE fields of the torques, separated by commas.")
@click.option("--torque-constants", type=Numbers(), help="Torque per current of each joint in Nm/A.")
@click.option("--torque-noise", type=Numbers(), help="Noise in Nm, one number or one per joint.")
@_WRIST
@click.option("--touchable", help="Links that can be touched, separated by commas.  [default: all]")
@click.option(
    "--link-prior",
    type=click.Choice(get_args(LinkPrior)),
    help="Whether contacts are equally probable per area or per link.  [default: area]",
)
@click.option("--force", is_flag=True, help="Overwrite FILE.")
def new(path: Path, force: bool, **given: Any) -> None:
    """Write a scene into FILE, every field with a comment.

    On a terminal, asks for what the options leave open. Elsewhere, only --robot is needed.
    """
    if path.exists() and not force:
        raise click.ClickException(f"{path}: exists already; --force overwrites it")
    if _on_terminal():
        _ask(given)
    if given["robot"] is None:
        known = ", ".join(robots.known_names())
        raise click.UsageError(f"--robot: expected one of {known}, or a path to .yaml or .urdf, got none")
    content = scene_content(given)
    try:
        scene = Scene(**content)
    except SceneError as error:
        raise click.ClickException(str(error)) from None
    try:
        write_text(path, commented_yaml(moved(content, Path(), path.parent)))
    except OSError as error:
        raise click.ClickException(f"{path}: cannot write: {error.strerror}") from None
    click.echo(f"{path}: written; `contactsense scene show {shlex.quote(str(path))}` says what it means")
    for warning in scene_warnings(scene):
        click.echo(f"warning: {warning}")


def scene_content(given: dict[str, Any]) -> dict[str, Any]:
    """Fields of the scene from the values of the options, None where an option is not given.

    Raises:
        click.UsageError: an option needs another one.
    """
    content: dict[str, Any] = {"robot": given["robot"], "mounting": given["mounting"] or "table"}
    tool = _present(given, {"name": "tool_name", "mass": "tool_mass", "com": "tool_com"})
    if tool.get("mass"):
        content["tool"] = tool
    elif tool.keys() - {"mass"}:
        raise click.UsageError("--tool-mass: expected the mass of the tool, got none")
    content["base_wrench"] = _BASE.content(given)
    signal = given["torque_signal"] or _SIGNALS[0]
    if signal == "none":
        if _present(given, {name: name for name in _TORQUE}):
            raise click.UsageError("--torque-signal none: expected no other option of the torques, got some")
        content["joint_torque"] = None
    else:
        if given["torque_constants"] is not None and signal not in CURRENTS:
            raise click.UsageError(
                f"--torque-constants: expected --torque-signal {' or '.join(CURRENTS)}, got {signal}"
            )
        torque = _present(given, {"torque_constants": "torque_constants", "noise": "torque_noise"})
        if len(torque.get("noise", ())) == 1:
            torque["noise"] = torque["noise"][0]
        if given["torque_fields"] is not None:
            torque["fields"] = _names(given["torque_fields"])
        content["joint_torque"] = {"signal": signal, **torque}
    wrist = _WRIST.content(given)
    if wrist is not None:
        content["wrist_wrench"] = wrist
    if given["touchable"] is not None:
        content["touchable"] = _names(given["touchable"])
    if given["link_prior"]:
        content["link_prior"] = given["link_prior"]
    return content


def _present(given: dict[str, Any], names: dict[str, str]) -> dict[str, Any]:
    return {field: given[option] for field, option in names.items() if given[option] is not None}


def _names(text: str) -> list[str]:
    return [name.strip() for name in text.split(",")]


def _on_terminal() -> bool:
    return sys.stdin.isatty() and sys.stdout.isatty()


def _ask(given: dict[str, Any]) -> None:
    """Ask for what the options leave open; the answers are added to `given`."""

    def ask(name: str, question: str, ask_it: Callable[..., Any] = click.prompt, **options: Any) -> None:
        if given[name] is None:
            given[name] = ask_it(question, **options)

    ask("robot", f"Arm ({', '.join(robots.known_names())}, or path of a URDF or YAML file)")
    ask(
        "mounting",
        "Mounting (table, ceiling, wall, or roll,pitch,yaw in rad)",
        default="table",
        type=Mounting(),
    )
    ask("tool_mass", "Mass of tool or payload in kg, 0 for none", default=0.0, type=float)
    if given["tool_mass"]:
        ask(
            "tool_com",
            "Its centre of mass in the flange frame, x,y,z in m",
            default="0,0,0.05",
            type=Numbers(3),
        )
    _BASE.ask(given, ask)
    ask(
        "torque_signal",
        "RTDE signal of the joint torques",
        default=_SIGNALS[0],
        type=click.Choice(_SIGNALS),
    )
    if given["torque_signal"] == "external_torque":
        ask("torque_fields", "RTDE fields of the torques, separated by commas")
    if given["tool_mass"]:  # a scene without a tool cannot have it
        _WRIST.ask(given, ask)
