"""The measurements of the solvers as Markdown tables."""

from collections import defaultdict
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from math import isnan
from typing import Any

from contactsense.benchmarks.solvers import accuracy, iterations, seams, speed, sweep
from contactsense.benchmarks.solvers.cases import catalogue
from contactsense.benchmarks.solvers.judge import Verdict, judge

Tick = Callable[[str], None]


@dataclass(frozen=True)
class Table:
    """A table and its content, for people and for programs."""

    head: tuple[str, ...]
    rows: Sequence[tuple[str, ...]]
    data: list[dict[str, Any]]

    def markdown(self) -> str:
        """The table in Markdown, as in the documentation."""
        ruler = ("-",) * len(self.head)
        return "\n".join("|" + "|".join(line) + "|" for line in (self.head, ruler, *self.rows))

    def aligned(self) -> str:
        """The same with columns of equal width, for a terminal."""
        lines = [self.head, *self.rows]
        widths = [max(len(line[column]) for line in lines) for column in range(len(self.head))]
        ruler = tuple("-" * width for width in widths)
        return "\n".join(
            "| " + " | ".join(cell.ljust(width) for cell, width in zip(line, widths, strict=True)) + " |"
            for line in (self.head, ruler, *self.rows)
        )


def number(value: float | None) -> str:
    """A number with two significant digits; a dash for None."""
    if value is None:
        return "-"
    if isnan(value):
        return "fails"
    return f"{value:.2g}" if value == 0.0 or 1e-3 <= abs(value) < 1e4 else f"{value:.0e}"


def _count(value: int | None) -> str:
    return "-" if value is None else f"{value:,}"


def accuracy_table(count: int, tick: Tick) -> Table:
    """Errors over random contacts."""
    found = list(accuracy.rows(count, tick))
    head = ("surface", "wrenches", "not answered", "worst", "99.9 %", "printed: median", "worst", "no number")
    rows = [
        (
            row.surface,
            _count(row.wrenches),
            _count(row.failures),
            number(row.worst),
            number(row.high),
            number(row.printed),
            number(row.printed_worst),
            _count(row.printed_failures),
        )
        for row in found
    ]
    return Table(head, rows, [_plain(row) for row in found])


def sweep_table(count: int, tick: Tick) -> Table:
    """Errors against exact arithmetic."""
    found = list(sweep.rows(max(count // 10_000, 1), tick))
    rows = [
        (row.surface, _count(row.wrenches), _count(row.failures), number(row.worst), f"{row.condition:.3f}")
        for row in found
    ]
    head = ("surface", "wrenches", "not answered", "worst", "condition, true to reported")
    return Table(head, rows, [_plain(row) for row in found])


def cases_table(count: int, tick: Tick) -> Table:
    """The hard cases, one row per group."""
    groups: dict[str, list[Verdict]] = defaultdict(list)
    for case in catalogue():
        if case.group not in groups:
            tick(case.group)
        groups[case.group].append(judge(case))
    rows, data = [], []
    for name, verdicts in groups.items():
        wrong = sum(not verdict.as_expected for verdict in verdicts)
        ours = max((verdict.error for verdict in verdicts if verdict.error is not None), default=None)
        printed = [verdict.printed for verdict in verdicts if verdict.printed is not None]
        worst = max((value for value in printed if not isnan(value)), default=None)
        lost = sum(isnan(value) for value in printed)
        wrong_printed = sum(not isnan(value) and value > 16.0 for value in printed)
        rows.append(
            (
                name,
                _count(len(verdicts)),
                _count(wrong),
                number(ours),
                f"{lost} of {len(printed)}" if printed else "-",
                f"{wrong_printed} of {len(printed)}" if printed else "-",
                number(worst),
            )
        )
        data += [
            {
                "group": name,
                "name": verdict.case.name,
                "status": verdict.found.status.name,
                "as_expected": verdict.as_expected,
                "error": verdict.error,
                "printed": verdict.printed,
            }
            for verdict in verdicts
        ]
    head = ("group", "cases", "wrong status", "worst", "printed: no number", "above 16", "worst")
    return Table(head, rows, data)


def seams_table(count: int, tick: Tick) -> Table:
    """Gaps and duplicate solutions near the seams."""
    found = list(seams.rows(count, tick))
    rows = [
        (row.surface, _count(row.wrenches), _count(row.gaps), _count(row.doubles), number(row.residual))
        for row in found
    ]
    head = ("body", "wrenches", "gaps", "second answers", "worst residual")
    return Table(head, rows, [_plain(row) for row in found])


def iterations_table(count: int, tick: Tick) -> Table:
    """Steps of Newton's method, one row per body."""
    found = list(iterations.rows(max(count // 10, 1), tick))
    bodies: dict[str, list[iterations.Row]] = defaultdict(list)
    for row in found:
        bodies[row.surface].append(row)
    rows = [
        (
            name,
            _count(sum(row.failures for row in kinds)),
            *(f"{row.median:.0f}/{row.p99:.0f}/{row.most}" for row in kinds),
            number(max(row.residual for row in kinds)),
        )
        for name, kinds in bodies.items()
    ]
    head = ("body", "failures", "contacts", "any force", "torsion 1", "worst residual")
    return Table(head, rows, [_plain(row) for row in found])


def speed_table(count: int, tick: Tick) -> Table:
    """Times as ratios."""
    found = list(speed.rows(max(count // 10, 1), tick))
    own = {row.surface: row.ratio for row in found if row.method == "wrench_axis"}
    rows = [
        (
            row.surface,
            row.method.replace("_", " "),
            str(row.patches),
            f"{row.nanoseconds:.0f}",
            f"{row.nanoseconds / row.patches:.1f}",
            f"{row.ratio:.2f}",
            f"{row.ratio / own[row.surface]:.2f}",
        )
        for row in found
    ]
    head = (
        "surface",
        "method",
        "patches",
        "ns",
        "ns per patch",
        "to the sphere's wrench axis",
        "to its own wrench axis",
    )
    return Table(head, rows, [_plain(row) for row in found])


TABLES: dict[str, Callable[[int, Tick], Table]] = {
    "accuracy": accuracy_table,
    "sweep": sweep_table,
    "cases": cases_table,
    "seams": seams_table,
    "iterations": iterations_table,
    "speed": speed_table,
}
"""Name -> function that generates the table from a number of wrenches."""


def into(text: str, tables: Iterable[tuple[str, Table]]) -> str:
    """Insert tables between the lines `<!-- NAME -->` and `<!-- end -->` of a text.

    Raises:
        ValueError: The text has no place for a table.
    """
    for name, table in tables:
        start, _, rest = text.partition(f"<!-- {name} -->\n")
        _, mark, rest = rest.partition("<!-- end -->")
        if not mark:
            raise ValueError(f"no lines <!-- {name} --> and <!-- end -->")
        text = f"{start}<!-- {name} -->\n{table.markdown()}\n{mark}{rest}"
    return text


def _plain(row: Any) -> dict[str, Any]:
    return {name: getattr(row, name) for name in row.__dataclass_fields__}
