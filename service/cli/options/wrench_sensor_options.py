"""Options and questions of `contactsense scene new` for one force/torque sensor of the scene."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, TypeVar

import click

from contactsense.service.cli.options.number_list import Numbers

_SIGNS = ("arm_on_sensor", "sensor_on_arm")
_Command = TypeVar("_Command", bound=Callable[..., Any])


@dataclass(frozen=True)
class WrenchSensorOptions:
    """The options of one force/torque sensor; each begins with its name."""

    name: str
    """`base` or `wrist`."""
    place: str
    """Where the sensor is."""
    frame: str
    """Name of the frame in which its pose is given."""
    weight: str
    """What it reads at rest with the first of the signs."""
    usual: bool
    """Whether a scene has it where no option says otherwise."""

    def __call__(self, command: _Command) -> _Command:
        """Add the options to a command."""
        name, frame = f"--{self.name}", self.frame
        options = (
            click.option(
                f"{name}-sensor/--no-{self.name}-sensor",
                default=None,
                help=f"Whether a force/torque sensor is {self.place}.",
            ),
            click.option(
                f"{name}-sign", type=click.Choice(_SIGNS), help="Which side's push it counts as positive."
            ),
            click.option(
                f"{name}-translation", type=Numbers(3), help=f"Its origin in the {frame} frame, x,y,z in m."
            ),
            click.option(
                f"{name}-rpy",
                type=Numbers(3),
                help=f"Its axes in the {frame} frame, roll,pitch,yaw in rad.",
            ),
            click.option(
                f"{name}-noise",
                type=Numbers(2),
                help="Its noise in N and Nm, standard deviation of a sample.",
            ),
            click.option(
                f"{name}-range", type=Numbers(2, 6), help="Its range in N and Nm, or of each component."
            ),
        )
        for option in reversed(options):
            command = option(command)
        return command

    def content(self, given: dict[str, Any]) -> dict[str, Any] | None:
        """Fields of the sensor from the values of all options, None where an option is not given; None: there
        is no such sensor.

        Raises:
            click.UsageError: The sensor is denied and described at once.
        """
        fields = {field: given[f"{self.name}_{field}"] for field in ("rpy", "translation", "sign", "range")}
        if given[f"{self.name}_noise"] is not None:
            fields["force_noise"], fields["moment_noise"] = given[f"{self.name}_noise"]
        stated = {field: value for field, value in fields.items() if value is not None}
        present = given[f"{self.name}_sensor"]
        if present is False and stated:
            raise click.UsageError(
                f"--no-{self.name}-sensor: expected no other option of the {self.name} sensor, got some"
            )
        if present is None:
            present = self.usual or bool(stated)
        return {"sign": _SIGNS[0], **stated} if present else None

    def ask(self, given: dict[str, Any], ask: Callable[..., None]) -> None:
        """Ask for what the options leave open.

        Args:
            given: Values of all options; the range is added to them.
            ask: Asks a question unless the option is given, and adds the answer to the values.
        """
        name, frame = self.name, self.frame
        question = f"Is a force/torque sensor {self.place}?"
        ask(f"{name}_sensor", question, click.confirm, default=self.usual)
        if not given[f"{name}_sensor"]:
            return
        sign = f"Its sign: with {_SIGNS[0]} {self.weight}"
        ask(f"{name}_sign", sign, default=_SIGNS[0], type=click.Choice(_SIGNS))
        for field, text in (
            ("translation", f"Its origin in the {frame} frame, x,y,z in m"),
            ("rpy", f"Its axes in the {frame} frame, roll,pitch,yaw in rad"),
        ):
            ask(f"{name}_{field}", text, default="0,0,0", type=Numbers(3))
        if given[f"{name}_range"] is None:
            answer = click.prompt("Its range, N,Nm, empty if unknown", default="", show_default=False)
            given[f"{name}_range"] = Numbers(2, 6).convert(answer, None, None) if answer.strip() else None
