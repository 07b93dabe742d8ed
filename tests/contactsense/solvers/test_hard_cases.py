"""The catalogue of hard cases, the seams, and many random contacts against extended precision."""

from functools import cache

import numpy as np
import pytest
from click.testing import CliRunner

from contactsense.benchmarks.solvers import accuracy, iterations, seams, sweep
from contactsense.benchmarks.solvers.cases import catalogue
from contactsense.benchmarks.solvers.command import solvers
from contactsense.benchmarks.solvers.judge import Verdict, judge
from contactsense.benchmarks.solvers.tables import Table, into, number

WIDE = np.finfo(np.longdouble).eps < 1e-18
"""Whether this machine has floats wide enough for a reference."""

ULPS = 16.0
CASES = {f"{case.group}: {case.name}": case for case in catalogue()}


@cache
def verdict_on(name: str) -> Verdict:
    return judge(CASES[name])


@pytest.mark.parametrize("name", CASES)
def test_hard_case(name: str) -> None:
    verdict = verdict_on(name)
    assert verdict.as_expected, verdict.found
    assert verdict.error is None or verdict.error <= ULPS
    assert np.all(np.isfinite(verdict.found.centroid))
    assert not np.isnan(verdict.found.condition)


def test_the_printed_formulas_do_fail() -> None:
    """What the catalogue is for: the paper's own forms lose digits, or all, where ours do not."""
    lost = [verdict_on(name).printed for name, case in CASES.items() if case.group in ("torsion", "thin")]
    assert sum(error is not None and not error <= ULPS for error in lost) > 50


@pytest.mark.skipif(not WIDE, reason="no extended precision on this machine")
def test_random_contacts_to_the_last_digits() -> None:
    for row in accuracy.rows(20_000, lambda name: None):
        assert row.failures == 0
        assert row.worst <= ULPS


@pytest.mark.long
@pytest.mark.skipif(not WIDE, reason="no extended precision on this machine")
def test_a_million_random_contacts_to_the_last_digits() -> None:
    for row in accuracy.rows(1_000_000, lambda name: None):
        assert row.failures == 0
        assert row.worst <= ULPS


def _check_sweep(count: int) -> None:
    for row in sweep.rows(count, lambda name: None):
        assert row.failures == 0, row
        assert row.worst <= ULPS, row
        # Rounding errors of the point turn the normal of a rim of 1e-10 m, and with it change the condition.
        assert row.condition < 1.0 + 1e-3, row


@pytest.mark.slow
def test_solutions_agree_with_exact_arithmetic() -> None:
    _check_sweep(4)


@pytest.mark.long
def test_solutions_agree_with_exact_arithmetic_often() -> None:
    _check_sweep(100)


def test_seams_have_one_answer() -> None:
    for row in seams.rows(20_000, lambda name: None):
        assert (row.gaps, row.doubles) == (0, 0)
        assert row.residual < 1e-12


@pytest.mark.long
def test_seams_have_one_answer_a_million_times() -> None:
    for row in seams.rows(1_000_000, lambda name: None):
        assert (row.gaps, row.doubles) == (0, 0)
        assert row.residual < 1e-12


@pytest.mark.slow
def test_newton_needs_few_steps() -> None:
    for row in iterations.rows(2_000, lambda name: None):
        assert row.failures == 0
        assert row.residual < 1e-12
        assert row.p99 <= 8 or row.surface in iterations.HARDEST


@pytest.mark.slow
def test_newton_a_hundred_thousand_times() -> None:
    for row in iterations.rows(100_000, lambda name: None):
        assert row.failures == 0
        assert row.residual < 1e-12
        assert row.p99 <= 8 or row.surface in iterations.HARDEST


def test_tables_are_written_to_a_page() -> None:
    table = Table(("a", "b"), [("1", "long cell")], [])
    page = "before\n<!-- t -->\nold\n<!-- end -->\nafter"
    new = into(page, [("t", table)])
    assert new == f"before\n<!-- t -->\n{table.markdown()}\n<!-- end -->\nafter"
    assert into(new, [("t", table)]) == new
    with pytest.raises(ValueError, match="no lines <!-- u -->"):
        into(page, [("u", table)])
    assert [number(x) for x in (None, float("nan"), 0.0, 1.234, 1e-9, 2e14)] == [
        "-",
        "fails",
        "0",
        "1.2",
        "1e-09",
        "2e+14",
    ]


@pytest.mark.long
def test_the_command_prints_its_tables() -> None:
    shown = CliRunner().invoke(solvers, ["--count", "1000", "--only", "cases"])
    assert shown.exit_code == 0
    assert "| torsion " in shown.output
