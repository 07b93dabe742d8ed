"""The numbers that the paper prints, out of the solvers."""

import json

import numpy as np
import pytest
from click.testing import CliRunner

from contactsense.benchmarks.solvers.paper_command import four_contacts, paper
from contactsense.benchmarks.solvers.paper_tables import (
    CORRECTED,
    FORCE_OF_TABLE_3,
    MISPRINTS,
    PRINTED_FORCE_OF_TABLE_3,
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
    axis, exact, _ = TABLE_3[moment_z]
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


def _differing_figures(radius: float) -> list[tuple[float, float]]:
    """Printed and own figures of table 1 that differ when ours are rounded."""
    pairs = []
    for case, printed in TABLE_1.items():
        wrench = four_contacts(*case, radius)
        for method, figure in zip(("exact", "wrench_axis"), printed, strict=True):
            ours = float(solve(Sphere(radius), *wrench, method).centroid[0])
            if round(ours, 3) != figure:
                pairs.append((figure, ours))
    return pairs


def test_the_radius_of_table_1_is_inferred() -> None:
    """Three figures are cut off instead of rounded; other radii than about 10 leave more that differ."""
    differing = _differing_figures(RADIUS_OF_TABLE_1)
    assert len(differing) == 3
    assert all(np.floor(1000.0 * ours) == 1000.0 * printed for printed, ours in differing)
    assert all(len(_differing_figures(radius)) <= 3 for radius in np.linspace(9.98, 10.13, 16))
    assert all(
        len(_differing_figures(radius)) > 3
        for radius in (*np.linspace(5.0, 9.97, 50), *np.linspace(10.14, 20.0, 50))
    )


@pytest.mark.parametrize("case", TABLE_1, ids=str)
def test_with_all_points_of_table_1_on_the_x_axis_x_is_zero(case: tuple[float, float]) -> None:
    friction, delta = case
    x = delta * np.array((1.0, 8.0, -1.0, -8.0))
    points = np.column_stack((x, 0.0 * x, np.sqrt(RADIUS_OF_TABLE_1**2 - x**2)))
    forces = np.array([(-friction, friction, -1.0)] * 2 + [(friction, friction, -1.0)] * 2)
    wrench = forces.sum(axis=0), np.cross(points, forces).sum(axis=0)
    for method in ("exact", "wrench_axis"):
        assert abs(solve(Sphere(RADIUS_OF_TABLE_1), *wrench, method).centroid[0]) < 1e-12


@pytest.mark.parametrize("moment_z", TABLE_3)
def test_with_the_printed_force_of_table_3_no_printed_point_is_a_contact(moment_z: float) -> None:
    force, moment = np.array(PRINTED_FORCE_OF_TABLE_3), np.array((0.01, 0.01, moment_z))
    assert 1.58 < np.linalg.norm(np.cross(force, moment)) / (force @ force) < 1.69
    assert solve(Sphere(1.0), force, moment, "wrench_axis").status == Status.MISS
    found = solve(Sphere(1.0), force, moment)
    assert all(np.linalg.norm(found.centroid - printed) > 0.5 for printed in TABLE_3[moment_z][1:])


def test_the_iteration_of_table_3_had_not_converged_in_its_third_row() -> None:
    for moment_z, (_, exact, iterative) in TABLE_3.items():
        assert (exact != iterative) == (moment_z == 0.50)
        found = solve(Sphere(1.0), FORCE_OF_TABLE_3, (0.01, 0.01, moment_z), "descent")
        reference = solve(Sphere(1.0), FORCE_OF_TABLE_3, (0.01, 0.01, moment_z))
        np.testing.assert_allclose(found.centroid, reference.centroid, atol=1e-6)


@pytest.mark.slow
def test_the_command_prints_them() -> None:
    shown = CliRunner().invoke(paper)
    assert shown.exit_code == 0
    assert "| 0.7 | 0.5   | 0.039" in shown.output
    assert "(-0.758, 0.620, 0.204)" in shown.output
    assert "radius 10 (inferred)" in shown.output
    assert all(
        one.printed in shown.output and one.reason in shown.output for one in sum(MISPRINTS.values(), ())
    )
    told = json.loads(CliRunner().invoke(paper, ["--json"]).output)
    assert list(told) == ["Table 1", "Table 2", "Table 3"]
    assert told["Table 1"][-1]["wrench_axis"] == pytest.approx(1.0)
