"""docs/results.md and its generator agree, and a table without its frame loses nothing."""

import io
import re
from pathlib import Path

from rich.console import Console
from rich.table import Table

from contactsense.benchmarks.results import SECTIONS, without_frame

PAGE = (Path(__file__).parents[2] / "docs" / "results.md").read_text(encoding="utf-8")


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


def test_the_page_has_the_sections_of_its_generator() -> None:
    assert re.findall(r"^## (.*)$", PAGE, re.MULTILINE) == [heading for heading, _, _ in SECTIONS]
    assert re.findall(r"^    (\S.*)$", PAGE, re.MULTILINE) == [command for _, _, command in SECTIONS]
    for _, about, _ in SECTIONS:
        assert about in PAGE
