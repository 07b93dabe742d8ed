"""The table of the viewer's cost: ratios to the stretch without a viewer beside it, not to a distant one."""

import pytest

pytest.importorskip("viser")

from contactsense.benchmarks.live.viewer import CASES, Stretch, table


def test_ratios_are_those_of_neighbours() -> None:
    """The second round is ten times as slow, with and without a viewer."""
    found = [
        Stretch(readers, hanging, 1, slow * factor, 3.0 * slow * factor, 29.0, 0.2)
        for slow in (1.0, 10.0)
        for (readers, hanging), factor in zip(CASES, (1.0, 1.05, 1.2), strict=True)
    ]
    head, alone, one, four = table(found)
    assert head.split()[0] == "pages"
    assert alone.split() == ["no", "viewer", "2", "5.50", "16.50", "1.00", "1.00"]
    assert one.split()[-6:] == ["5.78", "17.32", "1.05", "1.05", "29.0", "20"]
    assert four.split()[-4:-2] == ["1.20", "1.20"]
    assert four.startswith("4 and 1 that hangs")
