"""Derivatives of the contact centroid against finite differences."""

import numpy as np
import pytest

from contactsense.solvers import (
    Box,
    Capsule,
    Cone,
    Cylinder,
    Ellipsoid,
    Fingertip,
    Paraboloid,
    Placed,
    Plane,
    Polytope,
    Revolved,
    Sphere,
    Superquadric,
    Surface,
    TaperedCapsule,
    sensitivity,
    solve,
)
from tests.contactsense.solvers.contacts import draw
from tests.contactsense.solvers.test_general import STONE

SURFACES: list[Surface] = [
    Sphere(0.05),
    Ellipsoid(0.05, 0.1, 0.2),
    Cylinder(0.06),
    Cone(0.1, 0.2),
    Plane((1.0, -2.0, 3.0), 0.1),
    Capsule(0.2, 0.06),
    TaperedCapsule(0.2, 0.08, 0.05),
    Revolved(0.1, 0.04, 0.02, 0.01),
    Box(0.1, 0.04, 0.07, 0.01),
    Polytope(STONE, 0.01),
    Fingertip(0.05),
    Superquadric(0.05, 0.07, 0.1),
    Paraboloid(20.0, 10.0, 0.1),
]


@pytest.mark.parametrize("surface", SURFACES, ids=lambda surface: type(surface).__name__)
def test_derivatives_are_those_of_the_solution(surface: Surface) -> None:
    contacts = draw(surface, np.random.default_rng(12), 60, 0.1)
    checked = 0
    for force, moment in zip(contacts.force, contacts.moment, strict=True):
        solution = solve(surface, force, moment)
        if not solution.ok or solution.condition > 20.0:
            continue
        found = sensitivity(surface, solution)
        shift = found.tangents @ np.hstack((found.by_force, found.by_moment))
        size = np.linalg.norm(force)
        differences = np.empty((3, 6))
        for k in range(6):
            step = np.zeros(6)
            step[k] = 1e-6 * size * (1.0 if k < 3 else 0.1)
            plus = solve(surface, force + step[:3], moment + step[3:])
            minus = solve(surface, force - step[:3], moment - step[3:])
            differences[:, k] = (plus.centroid - minus.centroid) / (2.0 * step[k])
        scale = np.abs(shift).max()
        if np.abs(differences - shift).max() < 1e-3 * scale:
            checked += 1
    # Steps across a seam, where the curvature jumps, are not compared.
    assert checked > 20


@pytest.mark.parametrize("passing_by", [False, True])
def test_the_unit_of_the_wrench_does_not_matter(passing_by: bool) -> None:
    """Squares of forces, or squares of those, may be beyond the range of floats; `solve` takes them."""
    surface = Ellipsoid(0.05, 0.1, 0.2)
    force, moment = np.array([1.0, 2.0, -20.0]), np.array([0.4, 0.1, 0.05])
    if passing_by:
        moment = moment + np.cross([0.0, 0.3, 0.0], force)
    units = 1.0, 2.0**-400, 2.0**400, 2.0**-540, 2.0**540
    here, *others = (sensitivity(surface, solve(surface, unit * force, unit * moment)) for unit in units)
    assert (here.twin is not None) == passing_by
    for unit, there in zip(units[1:], others, strict=True):
        np.testing.assert_array_equal(there.by_force, here.by_force / unit)
        np.testing.assert_array_equal(there.by_moment, here.by_moment / unit)
    covariance = np.diag([0.5, 0.5, 0.5, 0.02, 0.02, 0.02])
    expected = here.covariance(covariance)
    for unit, there in zip(units[1:3], others, strict=False):
        np.testing.assert_allclose(there.covariance(unit**2 * covariance), expected, rtol=1e-9)


def test_covariance_of_a_placed_surface_turns_with_it() -> None:
    rng = np.random.default_rng(13)
    axes, _ = np.linalg.qr(rng.normal(size=(3, 3)))
    own = Ellipsoid(0.05, 0.1, 0.2)
    placed = Placed(own, np.zeros(3), axes)
    contacts = draw(own, rng, 1)
    force, moment = contacts.force[0], contacts.moment[0]
    here = sensitivity(own, solve(own, force, moment)).covariance(np.eye(6))
    there = sensitivity(placed, solve(placed, axes @ force, axes @ moment * np.linalg.det(axes)))
    if np.linalg.det(axes) > 0.0:
        np.testing.assert_allclose(there.covariance(np.eye(6)), axes @ here @ axes.T, rtol=1e-6)
    assert np.linalg.matrix_rank(here, tol=1e-9 * np.abs(here).max()) == 2


def test_only_contacts_have_derivatives() -> None:
    with pytest.raises(ValueError, match="MISS"):
        sensitivity(Sphere(0.1), solve(Sphere(0.1), (0.0, 0.0, 1.0), (1.0, 0.0, 0.0)))
