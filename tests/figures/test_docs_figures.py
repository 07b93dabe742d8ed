"""Every measured figure of README and docs has a source that agrees with it."""

import importlib
import re
import shlex
from importlib import util
from pathlib import Path

import click
import pytest
from click.testing import CliRunner

from contactsense.service.cli.main import cli
from tests.figures.coverage import is_declared, measured, outputs_of, uncovered
from tests.figures.declared import Declaration, numbers_of, read_declared, stands_in, wrong_formulas
from tests.figures.page import Page, Section, read_page
from tests.figures.prose import figures

ROOT = Path(__file__).parents[2]
MADE_BY_CODE = "docs/scene.md"
"""Its text is that of the code: tests/test_docs.py."""
PAGES: dict[Path, Page] = {
    path: read_page(path)
    for path in [ROOT / "README.md", *sorted((ROOT / "docs").glob("*.md"))]
    if path != ROOT / MADE_BY_CODE
}
DECLARED = read_declared()
COMMANDS = sorted({str(one.source) for one in DECLARED if one.kind == "command"})
pages = pytest.mark.parametrize("page", PAGES.values(), ids=lambda page: page.path.name)
declared = pytest.mark.parametrize("one", DECLARED, ids=lambda one: f"{one.page}: {one.text[:40]}")


def _name(page: Page) -> str:
    return page.path.relative_to(ROOT).as_posix()


def _section(one: Declaration) -> Section:
    """The section that has the text."""
    found = [section for section in PAGES[ROOT / one.page].sections if one.text in section.prose]
    assert found, "the text is no longer on the page"
    return found[0]


@pages
def test_every_measured_figure_has_a_source(page: Page) -> None:
    declarations = [one for one in DECLARED if one.page == _name(page)]
    without = [
        f"{figure.text} {figure.unit}: ...{section.prose[max(0, figure.place - 60) : figure.place + 40]}..."
        for section, figure in uncovered(page, PAGES, declarations, ROOT)
    ]
    assert not without, "correct them, or see tests/figures/__init__.py"


@pages
def test_a_command_stands_above_every_output(page: Page) -> None:
    assert not page.without_command


@declared
def test_what_is_declared_is_measured(one: Declaration) -> None:
    section = _section(one)
    assert any(is_declared(figure, section, [one]) for figure in measured(section))


@declared
def test_the_source_that_is_declared_has_the_figures(one: Declaration) -> None:
    section, page = _section(one), PAGES[ROOT / one.page]
    if one.kind == "command":
        assert any(str(one.source) in command for each in page.sections for command in each.commands)
    elif one.kind == "file":
        text = (ROOT / str(one.source)).read_text(encoding="utf-8")
        assert not [figure for figure in figures(one.text) if not stands_in(figure, text)]
    elif one.kind == "is":
        there = "\n".join([section.prose, *outputs_of(section, page, PAGES)])
        assert not wrong_formulas(one)
        assert not [n for n in numbers_of(one.source) if not re.search(rf"(?<![\d.]){n}(?!\d)", there)]
    else:
        assert one.kind == "source"
        assert one.source


@pytest.mark.parametrize("line", [line for line in COMMANDS if line.startswith("contactsense ")])
def test_commands_that_are_declared_tell_their_options(line: str) -> None:
    command: click.Command = cli
    path = []
    for word in shlex.split(line)[1:]:
        below = (
            command.get_command(click.Context(command), word) if isinstance(command, click.Group) else None
        )
        if below is None:
            break
        command, path = below, [*path, word]
    assert not isinstance(command, click.Group)
    assert CliRunner().invoke(cli, [*path, "--help"]).exit_code == 0


@pytest.mark.slow
@pytest.mark.parametrize("line", [line for line in COMMANDS if line.startswith("python -m ")])
def test_modules_that_are_declared_tell_their_options(line: str) -> None:
    name = shlex.split(line)[2]
    if util.find_spec(name).submodule_search_locations is not None:
        name += ".__main__"
    # In this process: each of its own would take two seconds to start.
    done = CliRunner().invoke(importlib.import_module(name).main, ["--help"])
    assert done.exit_code == 0, done.output
    assert "--help" in done.output
