"""Arms by the names that benchmarks have for them."""

import click

from contactsense import robots
from contactsense.benchmarks import panda
from contactsense.robots import Robot, RobotError


def arm(name: str) -> Robot:
    """The arm that `robots.load` knows by that name or path, or the Panda.

    Raises:
        click.ClickException: there is no such arm, or the URDF of the Panda is not installed.
    """
    try:
        if name != "panda":
            return robots.load(name)
        return panda.load()
    except (RobotError, panda.NoPandaError) as error:
        raise click.ClickException(str(error)) from None
