"""The numbers that the paper prints, out of the solvers."""

import numpy as np
import pytest

from contactsense.solvers import Sphere, Status, solve
from service.bench.solvers.paper_tables import FORCE_OF_TABLE_3, RADIUS_OF_TABLE_1, TABLE_1, TABLE_3


def four_contacts(friction: float, delta: float) -> tuple[np.ndarray, np.ndarray]:
    """Wrench of the paper's figure 8: four contacts on top of a sphere."""
    x = np.array((delta, 0.0, -delta, 0.0))
    y = np.array((0.0, 8.0 * delta, 0.0, -8.0 * delta))
    points = np.column_stack((x, y, np.sqrt(RADIUS_OF_TABLE_1**2 - x**2 - y**2)))
    forces = np.array([(-friction, friction, -1.0)] * 2 + [(friction, friction, -1.0)] * 2)
    return forces.sum(axis=0), np.cross(points, forces).sum(axis=0)


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
    digits = 3 if moment_z == 0.48 else 2
    np.testing.assert_array_equal(np.round(found.centroid, digits), exact)
    line = solve(Sphere(1.0), FORCE_OF_TABLE_3, moment, "wrench_axis")
    if axis is None:
        assert line.status == Status.MISS
    else:
        # The last digit is printed rounded or cut.
        np.testing.assert_allclose(line.centroid, axis, atol=0.0101)
