"""The pages of results and their generator agree, a table without its frame loses nothing, and an interrupted
run goes on."""

import io
import re
import subprocess
from pathlib import Path

import pytest
from click.testing import CliRunner
from rich.console import Console
from rich.table import Table

from contactsense.benchmarks.results.__main__ import main
from contactsense.benchmarks.results.kept_output import printed_by, source_version
from contactsense.benchmarks.results.plain_table import without_frame
from contactsense.benchmarks.results.sections import PAGES, Page

DOCS = Path(__file__).parents[2] / "docs"


def test_a_table_without_its_frame_keeps_cells_groups_and_caption() -> None:
    table = Table(title="errors", caption="in mm")
    table.add_column("arm")
    table.add_column("noise N / Nm")
    table.add_column("right", justify="right")
    table.add_row("ur5e", "0 / 0", "18 %", end_section=True)
    table.add_row("ur10e", "0.25 / 0.05", "9.5 %")
    out = io.StringIO()
    Console(file=out, width=80).print(table)
    assert [line.rstrip() for line in without_frame(out.getvalue().strip("\n")).splitlines()] == [
        "errors",
        "arm    noise N/Nm  right",
        "────────────────────────",
        "ur5e   0/0           18%",
        "────────────────────────",
        "ur10e  0.25/0.05    9.5%",
        "in mm",
    ]


def test_notes_that_the_page_has_already_are_left_out() -> None:
    printed = "errors\n┏━━━┓\n┃ a ┃\n┡━━━┩\n│ 1 │\n└───┘\nin mm"
    notes = {"in mm"}
    assert without_frame(printed, notes).splitlines() == ["errors", "a", "─", "1"]
    assert notes == {"errors", "in mm"}


def test_output_without_a_table_is_kept() -> None:
    text = "source   lost\nrtde        0"
    assert without_frame(text) == text


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.name)
def test_a_page_has_the_sections_of_its_generator(page: Page) -> None:
    text = (DOCS / page.name).read_text(encoding="utf-8")
    written = re.findall(r"^## (.*)$", text, re.MULTILINE)
    sections = [one for one in page.sections if one.needs is None or one.heading in written]
    assert written == [one.heading for one in sections]
    for part in (page.introduction, *(one.about for one in sections)):
        assert part in text
    commands = re.findall(r"^    (\S.*)$", text.replace(page.introduction, ""), re.MULTILINE)
    assert commands == [one.command for one in sections]


def test_what_a_command_has_printed_is_kept_for_the_same_version(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    command = f"sh -c 'echo run >> {tmp_path}/runs; wc -l < {tmp_path}/runs'"
    kept = tmp_path / "kept"
    assert [printed_by(command, version, kept).strip() for version in ("a", "a", "b", "", "")] == [
        *("1", "1", "2", "3", "4")
    ]
    assert capsys.readouterr().out.count(": kept") == 1


def test_a_command_that_fails_is_not_kept(tmp_path: Path) -> None:
    for _ in range(2):
        with pytest.raises(subprocess.CalledProcessError):
            printed_by("sh -c 'echo half; exit 1'", "a", tmp_path)
    assert not list(tmp_path.iterdir())


def test_the_version_changes_with_the_source_but_not_with_docs(tmp_path: Path) -> None:
    assert source_version(tmp_path) == ""
    for line in (
        "git init -q",
        "git -c user.name=a -c user.email=a@b commit -q --allow-empty -m first",
    ):
        subprocess.run(line.split(), cwd=tmp_path, check=True)
    (tmp_path / "docs").mkdir()
    first = source_version(tmp_path)
    assert first
    for name, same in (("docs/results.md", True), ("a.py", False)):
        (tmp_path / name).write_text("1")
        subprocess.run(["git", "add", name], cwd=tmp_path, check=True)
        assert (source_version(tmp_path) == first) == same


@pytest.mark.parametrize("argument", ["--help", "--only"])
def test_a_word_too_many_runs_nothing(argument: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(subprocess, "run", lambda *_, **__: pytest.fail("a command ran"))
    result = CliRunner().invoke(main, [argument])
    assert result.exit_code == (0 if argument == "--help" else 2)
    assert "Usage:" in result.output
