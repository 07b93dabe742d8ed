"""`contactsense scene new FILE`: writes a commented scene file from options, or from answers on a
terminal."""

import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any, get_args

import click

from contactsense import robots
from contactsense.robots.file_references import moved
from contactsense.robots.whole_file import write_text
from contactsense.scene import LinkPrior, Scene, SceneError
from contactsense.sensors.settings import JointTorqueSignal
from contactsense.service.scene.commented_yaml import commented_yaml
from contactsense.service.scene.summary import scene_warnings

_SIGNALS = (*get_args(JointTorqueSignal), "none")
_SIGNS = ("arm_on_sensor", "sensor_on_arm")


class Numbers(click.ParamType):  # type: ignore[type-arg]  # generic for mypy only
    """Numbers separated by commas."""

    def __init__(self, *counts: int) -> None:
        """`counts`: how many numbers are accepted; any number of them if there are none."""
        self._counts = counts
        self.name = "NUMBERS"

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> list[float]:
        """The numbers; fails with one line if there are others than expected."""
        if isinstance(value, list):
            return value
        try:
            numbers = [float(part) for part in value.strip("[]() ").split(",")]
        except ValueError:
            numbers = []
        if not numbers or (self._counts and len(numbers) not in self._counts):
            count = " or ".join(str(n) for n in self._counts) or "some"
            self.fail(f"expected {count} numbers separated by commas, got {value!r}", param, ctx)
        return numbers


class Mounting(click.ParamType):  # type: ignore[type-arg]  # generic for mypy only
    """A mounting by its name, or three angles."""

    name = "MOUNTING"

    def convert(
        self, value: Any, param: click.Parameter | None, ctx: click.Context | None
    ) -> str | list[float]:
        """The name, or the angles."""
        if value in ("table", "ceiling", "wall"):
            return str(value)
        return Numbers(3).convert(value, param, ctx)


@click.command()
@click.argument("path", metavar="FILE", type=click.Path(path_type=Path))
@click.option("--robot", help="Name of the arm, or path of a URDF or YAML file.")
@click.option("--mounting", type=Mounting(), help="table, ceiling, wall, or roll,pitch,yaw in rad.")
@click.option("--tool-mass", type=float, help="Mass of tool or payload in kg; 0: none.")
@click.option("--tool-com", type=Numbers(3), help="Its centre of mass in the flange frame, x,y,z in m.")
@click.option("--tool-name", help="Its name in estimates.  [default: tool]")
@click.option(
    "--base-sensor/--no-base-sensor", default=None, help="Whether a force/torque sensor is under the base."
)
@click.option("--base-sign", type=click.Choice(_SIGNS), help="Which side's push it counts as positive.")
@click.option("--base-translation", type=Numbers(3), help="Its origin in the base frame, x,y,z in m.")
@click.option("--base-rpy", type=Numbers(3), help="Its axes in the base frame, roll,pitch,yaw in rad.")
@click.option("--base-noise", type=Numbers(2), help="Its noise in N and Nm, standard deviation of a sample.")
@click.option("--base-range", type=Numbers(2, 6), help="Its range in N and Nm, or of each component.")
@click.option("--torque-signal", type=click.Choice(_SIGNALS), help="RTDE signal of the joint torques.")
@click.option("--torque-fields", help="RTDE fields of the torques, separated by commas.")
@click.option("--torque-constants", type=Numbers(), help="Torque per current of each joint in Nm/A.")
@click.option("--torque-noise", type=Numbers(), help="Noise in Nm, one number or one per joint.")
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
    click.echo(f"{path}: written; `contactsense scene show {path}` says what it means")
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
    sensor = _present(
        given,
        {"rpy": "base_rpy", "translation": "base_translation", "sign": "base_sign", "range": "base_range"},
    )
    if given["base_noise"] is not None:
        sensor["force_noise"], sensor["moment_noise"] = given["base_noise"]
    if given["base_sensor"] is False and sensor:
        raise click.UsageError("--no-base-sensor: expected no other option of the base sensor, got some")
    content["base_wrench"] = None if given["base_sensor"] is False else {"sign": _SIGNS[0], **sensor}
    if given["torque_signal"] == "none":
        content["joint_torque"] = None
    else:
        torque = _present(given, {"torque_constants": "torque_constants", "noise": "torque_noise"})
        if len(torque.get("noise", ())) == 1:
            torque["noise"] = torque["noise"][0]
        if given["torque_fields"]:
            torque["fields"] = _names(given["torque_fields"])
        content["joint_torque"] = {"signal": given["torque_signal"] or _SIGNALS[0], **torque}
    if given["touchable"]:
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
    ask("base_sensor", "Is a force/torque sensor under the base?", click.confirm, default=True)
    if given["base_sensor"]:
        signs = click.Choice(_SIGNS)
        ask(
            "base_sign",
            "Its sign: with arm_on_sensor an arm on a table reads a force along -z",
            default=_SIGNS[0],
            type=signs,
        )
        ask(
            "base_translation",
            "Its origin in the base frame, x,y,z in m",
            default="0,0,0",
            type=Numbers(3),
        )
        ask("base_rpy", "Its axes in the base frame, roll,pitch,yaw in rad", default="0,0,0", type=Numbers(3))
        if given["base_range"] is None:
            answer = click.prompt("Its range, N,Nm, empty if unknown", default="", show_default=False)
            given["base_range"] = Numbers(2, 6).convert(answer, None, None) if answer.strip() else None
    ask(
        "torque_signal",
        "RTDE signal of the joint torques",
        default=_SIGNALS[0],
        type=click.Choice(_SIGNALS),
    )
    if given["torque_signal"] == "external_torque":
        ask("torque_fields", "RTDE fields of the torques, separated by commas")
