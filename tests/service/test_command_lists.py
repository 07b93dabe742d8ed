"""Lists of commands in help texts: whole sentences on a terminal of 80 columns, and commands that exist."""

from collections.abc import Iterator

import click
import pytest
from click.testing import CliRunner

from contactsense.service.cli.bench import bench
from contactsense.service.cli.lazy import LazyGroup
from contactsense.service.cli.main import cli
from contactsense.service.cli.reactions import reactions
from contactsense.service.cli.scene import scene

groups = pytest.mark.parametrize("group", [cli, scene, bench, reactions], ids=lambda group: group.name)


def lines(group: click.Group) -> Iterator[str]:
    """The rows of the group's list of commands, as a terminal of 80 columns shows them."""
    done = CliRunner().invoke(group, ["--help"], terminal_width=80)
    names = group.list_commands(click.Context(group))
    shown = done.output.partition("Options:")[2]
    rows = [line for line in shown.splitlines() if line.startswith("  ") and line.split()[0] in names]
    assert [row.split()[0] for row in rows] == names
    yield from rows


@groups
def test_every_command_has_one_whole_line(group: click.Group) -> None:
    for line in lines(group):
        assert line.endswith("."), line
        assert not line.endswith(("...", "…")), line
        assert len(line) <= 80


@pytest.mark.slow
@groups
def test_listed_commands_exist(group: click.Group) -> None:
    for name in group.list_commands(click.Context(group)):
        command = group.get_command(click.Context(group), name)
        assert command is not None
        assert isinstance(command, LazyGroup | click.Group) or command.help, name
