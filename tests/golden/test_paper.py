"""The numbers that the paper prints, out of the solvers."""

import json

import numpy as np
import pytest
from click.testing import CliRunner

from contactsense.benchmarks.solvers.paper_command import four_contacts, paper
from contactsense.benchmarks.solvers.paper_tables import (
    CORRECTED,
    FORCE_OF_TABLE_3,
    RADIUS_OF_TABLE_1,
    TABLE_1,
    TABLE_3,
)
from contactsense.solvers import Sphere, Status, solve


@pytest.mark.parametrize("case", TABLE_1, ids=str)
def test_table_1(case: tuple[float, float]) -> None:
    force, moment = four_contacts(*case)
    exact, axis = TABLE_1[case]
    sphere = Sphere(RADIUS_OF_TABLE_1)
    assert solve(sphere, force, moment).centroid[0] == pytest.approx(exact, abs=1e-3)
    found = solve(sphere, force, moment, "wrench_axis").centroid[0]
    assert round(float(found), 3) == axis


@pytest.mark.parametrize("moment_z", TABLE_3)
def test_table_3(moment_z: float) -> None:
    axis, exact = TABLE_3[moment_z]
    moment = (0.01, 0.01, moment_z)
    found = solve(Sphere(1.0), FORCE_OF_TABLE_3, moment)
    if moment_z in CORRECTED:
        np.testing.assert_array_equal(np.round(found.centroid, 3), CORRECTED[moment_z])
    else:
        np.testing.assert_array_equal(np.round(found.centroid, 2), exact)
    line = solve(Sphere(1.0), FORCE_OF_TABLE_3, moment, "wrench_axis")
    if axis is None:
        assert line.status == Status.MISS
    else:
        # The last digit is printed rounded or cut.
        np.testing.assert_allclose(line.centroid, axis, atol=0.0101)


def test_the_command_prints_them() -> None:
    shown = CliRunner().invoke(paper)
    assert shown.exit_code == 0
    assert "| 0.7 | 0.5   | 0.039" in shown.output
    assert "(-0.758, 0.620, 0.204)" in shown.output
    told = json.loads(CliRunner().invoke(paper, ["--json"]).output)
    assert list(told) == ["Table 1", "Table 2", "Table 3"]
    assert told["Table 1"][-1]["wrench_axis"] == pytest.approx(1.0)
