"""Lists of commands in help texts: whole sentences on a terminal of 80 columns, and commands that exist. All
their options are tested or described."""

import re
from collections.abc import Iterator
from pathlib import Path

import click
import pytest
from click.testing import CliRunner

from contactsense.service.cli.bench import bench
from contactsense.service.cli.lazy import LazyGroup
from contactsense.service.cli.main import cli
from contactsense.service.cli.reactions import reactions
from contactsense.service.cli.scene import scene

groups = pytest.mark.parametrize("group", [cli, scene, bench, reactions], ids=lambda group: group.name)

ROOT = Path(__file__).parents[2]
OPTION = re.compile(r"(?<![\w-])--[a-z][a-z0-9-]*")


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


def commands(group: click.Group, name: str) -> Iterator[tuple[str, click.Command]]:
    """All commands below a group that can be imported here, with their names as they are called."""
    for word in group.list_commands(click.Context(group)):
        try:
            command = group.get_command(click.Context(group), word)
        except click.ClickException:  # an extra is not installed
            continue
        assert command is not None
        if isinstance(command, click.Group):
            yield from commands(command, f"{name} {word}")
        else:
            yield f"{name} {word}", command


@pytest.mark.slow
def test_every_option_is_named_in_a_test_or_on_a_page() -> None:
    files = [*ROOT.glob("*.md"), *(ROOT / "docs").glob("*.md"), *(ROOT / "tests").rglob("*.py")]
    files.remove(ROOT / "CHANGELOG.md")
    named = {word for file in files for word in OPTION.findall(file.read_text(encoding="utf-8"))}
    unnamed = [
        f"{name} {option}"
        for name, command in commands(cli, "contactsense")
        for parameter in command.params
        if isinstance(parameter, click.Option)
        for option in (*parameter.opts, *parameter.secondary_opts)
        if option.startswith("--") and option not in named
    ]
    assert unnamed == []
