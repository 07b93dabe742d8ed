"""Histogram of latencies."""

from contactsense.benchmarks.live.histogram import EDGES, bars, histogram


def test_each_value_is_in_the_bin_that_begins_at_or_below_it() -> None:
    bins = histogram([0.1, 0.25, 0.3, 1000.0])
    assert [low for low, _ in bins] == list(EDGES)
    assert {low: count for low, count in bins if count} == {0.0: 1, 0.25: 2, 50.0: 1}


def test_bars_are_in_proportion() -> None:
    lines = list(bars(histogram([0.1, 0.25, 0.3, 1000.0])))
    assert lines[0] == f"  0.00 to   0.25 ms       1 {'#' * 25}"
    assert lines[1] == f"  0.25 to   0.50 ms       2 {'#' * 50}"
    assert lines[2].rstrip() == "  0.50 to   0.75 ms       0"
    assert lines[-1] == f" 50.00 to    inf ms       1 {'#' * 25}"
