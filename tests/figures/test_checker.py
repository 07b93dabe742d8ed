"""The check of figures finds what is wrong on a small made-up page."""

from pathlib import Path

import pytest

from tests.figures.coverage import uncovered
from tests.figures.declared import Declaration, reckoned, stands_in, wrong_formulas
from tests.figures.page import Page, read_page
from tests.figures.prose import figures

PAGE = """# Speed of the mill

The wheel has a diameter of 40 mm and starts with `--torque 3`.

## Results

    contactsense bench mill --runs 20

```
mill    ground   error mm   time ms
small    91.4%       1.26      17.0
large    88.0%       0.75      12.4
```

{prose}
"""


def _page(folder: Path, prose: str) -> Page:
    path = folder / "mill.md"
    path.write_text(PAGE.format(prose=prose), encoding="utf-8")
    return read_page(path)


def _uncovered(folder: Path, prose: str, *declarations: Declaration) -> list[str]:
    page = _page(folder, prose)
    return [f"{figure.text} {figure.unit}" for _, figure in uncovered(page, {}, list(declarations), folder)]


@pytest.mark.parametrize(
    "prose",
    [
        "The small mill grinds 91.4 % of the corn, to 1.3 mm.",
        "Errors are 1.26 and 0.75 mm after 17 and 12.4 ms.",
        "With 0.25 N of noise, 95 % of the corn is ground.",
        "`--runs 20 %` and [figures](at_33_%.md) are no prose.",
    ],
)
def test_figures_of_the_table_are_covered(tmp_path: Path, prose: str) -> None:
    assert not _uncovered(tmp_path, prose)


@pytest.mark.parametrize(
    ("prose", "wrong"),
    [
        ("The small mill grinds 91.5 % of the corn.", ["91.5 %"]),
        ("It is ground to 1.2 mm.", ["1.2 mm"]),
        ("Errors are 1.26 and 0.57 mm.", ["0.57 mm"]),
        ("It grinds 17 % of the corn.", ["17 %"]),  # the time
        ("The error is 88 mm.", ["88 mm"]),  # a share
        ("It takes 17 s.", ["17 s"]),  # another unit
        ("In 3 of 7 mills", ["3 of", "7 of"]),
    ],
)
def test_figures_that_are_not_in_the_table_are_found(tmp_path: Path, prose: str, wrong: list[str]) -> None:
    assert _uncovered(tmp_path, prose) == wrong


def test_settings_are_figures_of_sections_without_results(tmp_path: Path) -> None:
    first = _page(tmp_path, "").sections[1]
    assert [figure.text for figure in figures(first.prose)] == ["40"]
    assert not first.shows_results


def test_figures_of_a_test_that_is_named_are_covered(tmp_path: Path) -> None:
    (tmp_path / "tests").mkdir()
    (tmp_path / "tests" / "test_mill.py").write_text("assert stops_within(0.25)\n", encoding="utf-8")
    assert _uncovered(tmp_path, "It stops within 250 ms, not 260 ms (`tests/test_mill.py`).") == ["260 ms"]


def test_a_declared_text_covers_its_figures_only(tmp_path: Path) -> None:
    declared = Declaration("mill.md", "bakes 7 %", "command", "contactsense bench mill")
    assert _uncovered(tmp_path, "It bakes 7 % and burns 8 %.", declared) == ["8 %"]


def test_an_output_without_a_command_is_found(tmp_path: Path) -> None:
    path = tmp_path / "mill.md"
    path.write_text(
        "# Mill\n\n## One\n\n    contactsense bench mill\n\n## Two\n\n```\n91.4%\n```\n", encoding="utf-8"
    )
    assert read_page(path).without_command == ["91.4%"]


def test_outputs_of_a_linked_chapter_count(tmp_path: Path) -> None:
    there = _page(tmp_path, "")
    path = tmp_path / "bread.md"
    path.write_text("# Bread\n\n[Ground](mill.md#results): 91.4 %, 91.6 %.\n", encoding="utf-8")
    pages = {there.path.resolve(): there}
    assert [figure.text for _, figure in uncovered(read_page(path), pages, [], tmp_path)] == ["91.6"]


def test_a_figure_stands_in_code_in_its_unit_or_in_si() -> None:
    code = "RADIUS, SHARE, COUNT = 0.02, 0.4, 1e3  # v0.7"
    assert [
        figure.text for figure in figures("20 mm, 40 %, 7 %, 1000 N, 21 mm") if stands_in(figure, code)
    ] == [
        "20",
        "40",
        "1000",
    ]


def test_formulas_are_reckoned() -> None:
    assert reckoned("100 * (1 - 0.98)") == pytest.approx(2.0)
    assert not wrong_formulas(Declaration("", "2 to 7 %", "is", ["100 * (1 - 0.98)", "sqrt(49)"]))
    assert wrong_formulas(Declaration("", "2 to 7 %", "is", ["100 * (1 - 0.98)", "6"])) == ["7 % is not 6"]
    assert wrong_formulas(Declaration("", "2 to 7 %", "is", ["2"]))
    with pytest.raises(ValueError, match="not allowed"):
        reckoned("print(1)")
