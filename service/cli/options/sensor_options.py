"""Options and variables that say where a robot and its sensors are read, shared by commands."""

from collections.abc import Callable
from typing import Any, TypeVar

import click

from contactsense.service.api.sample_source import READERS
from contactsense.service.api.settings import Settings

_Command = TypeVar("_Command", bound=Callable[..., Any])

_OPTIONS = (
    click.option("--robot-port", type=int, help="Its RTDE port.  [default: 30004]"),
    click.option(
        "--robot-client",
        type=click.Choice(["rtde", "ur_rtde"]),
        help="Which client reads the robot.  [default: rtde]",
    ),
    click.option("--robot-rate", type=float, help="Robot samples per second.  [default: 500]"),
    click.option("--ft-host", help="Address of the force/torque sensor under the base (Net F/T)."),
    click.option("--ft-port", type=int, help="Its RDT port (UDP).  [default: 49152]"),
    click.option("--ft-http-port", type=int, help="Port of its configuration page.  [default: 80]"),
    click.option(
        "--ft-counts", help="Its counts per N and per Nm, as 1000000,1000000, instead of asking it."
    ),
    click.option(
        "--ft-rate", type=float, help="Its samples per second.  [default: estimated from the arrivals]"
    ),
    click.option("--ft-fields", help="Six RTDE fields that carry its reading, separated by commas."),
)


def sensor_options(robot_host: str) -> Callable[[_Command], _Command]:
    """Add the options to a command, which takes them by their names in `Settings`; None: not given.

    Args:
        robot_host: Help of `--robot-host`: what happens with and without it.
    """

    def add(command: _Command) -> _Command:
        for option in reversed((click.option("--robot-host", help=robot_host), *_OPTIONS)):
            command = option(command)
        return command

    return add


def from_environment(*more: str) -> dict[str, Any]:
    """The same settings, and those that have no option, where the environment gives them; and `more`.

    Raises:
        SettingsError: A variable cannot be used.
    """
    known = Settings.from_environment().model_dump(exclude_unset=True)
    names = {"robot_host", "robot_rate", *READERS, *more}
    return {name: value for name, value in known.items() if name in names}
