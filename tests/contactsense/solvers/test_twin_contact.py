"""The twin contact: where a force's line misses the body, the sign of a small torsion decides its side."""

import numpy as np
import pytest

from contactsense.solvers import (
    Box,
    Capsule,
    Ellipsoid,
    Paraboloid,
    Revolved,
    Sphere,
    Superquadric,
    Surface,
    sensitivity,
    solve,
    solve_batch,
)
from tests.contactsense.solvers.contacts import draw

BODIES: dict[str, Surface] = {
    "sphere": Sphere(1.0),
    "ellipsoid": Ellipsoid(0.5, 0.7, 1.0),
    "capsule": Capsule(0.5, 0.5),
    "box": Box(0.3, 0.4, 0.5, 0.2),
    "cylinder": Revolved(0.5, 0.3, 0.3, 0.2),
    "superquadric": Superquadric(0.6, 0.7, 0.8),
    "paraboloid": Paraboloid(1.0, 2.0, 1.0),
}


@pytest.mark.parametrize("torsion", [1e-15, 1e-9, 1e-4])
def test_the_condition_number_is_the_jump_over_the_shift_that_causes_it(torsion: float) -> None:
    here = solve(Sphere(1.0), (0.0, 0.0, -1.0), (0.0, 2.0, torsion))
    there = solve(Sphere(1.0), (0.0, 0.0, -1.0), (0.0, 2.0, -torsion))
    jump = float(np.linalg.norm(here.centroid - there.centroid))
    assert jump > 1.0
    assert here.condition == pytest.approx(jump / torsion, rel=1e-3)


@pytest.mark.parametrize("name", BODIES)
def test_no_answer_near_its_twin_is_called_well_conditioned(name: str) -> None:
    """Along the line of a pure force that misses, a torsion of either sign."""
    rng = np.random.default_rng(1)
    seen = 0
    for _ in range(200):
        force = rng.normal(size=3)
        force[2] = -abs(force[2])
        moment = np.cross(rng.normal(size=3), force)
        if solve(BODIES[name], force, moment, "wrench_axis").ok:
            continue
        tiny = 1e-9 * force
        both = [solve(BODIES[name], force, moment + sign * tiny) for sign in (1.0, -1.0)]
        jump = float(np.linalg.norm(both[0].centroid - both[1].centroid))
        if all(one.ok for one in both) and jump > 0.05:
            seen += 1
            assert min(one.condition for one in both) > 0.02 * jump / 1e-9
    assert seen > 10


def test_a_line_that_enters_has_no_twin() -> None:
    contacts = draw(Sphere(1.0), np.random.default_rng(2), 200, 0.0)
    found = solve_batch(Sphere(1.0), contacts.force, contacts.moment)
    cosine = -np.sum(found.force * found.normal, axis=1) / np.linalg.norm(found.force, axis=1)
    np.testing.assert_allclose(found.condition, 1.0 / cosine, rtol=1e-6)
    for force, moment in zip(contacts.force[:20], contacts.moment[:20], strict=True):
        assert sensitivity(Sphere(1.0), solve(Sphere(1.0), force, moment)).twin is None


def test_the_covariance_is_the_mean_square_of_noisy_answers() -> None:
    """Against solutions of noisy wrenches: as much noise as torsion, and much less."""
    rng = np.random.default_rng(3)
    force, moment = np.array((0.0, 0.0, -1.0)), np.array((0.0, 2.0, 1e-3))
    here = solve(Sphere(1.0), force, moment)
    for noise in (1e-3, 1e-4):
        noisy = moment + noise * rng.normal(size=(20_000, 3))
        found = solve_batch(Sphere(1.0), np.tile(force, (len(noisy), 1)), noisy)
        assert np.all(found.ok)
        error = found.centroid - here.centroid
        drawn = np.trace(error.T @ error) / len(error)
        wrench = np.diag((0.0, 0.0, 0.0, noise**2, noise**2, noise**2))
        predicted = float(np.trace(sensitivity(Sphere(1.0), here).covariance(wrench)))
        assert predicted == pytest.approx(drawn, rel=0.05)


@pytest.mark.parametrize("name", BODIES)
def test_derivatives_of_the_wrench_axis(name: str) -> None:
    body = BODIES[name]
    contacts = draw(body, np.random.default_rng(4), 60, 0.3)
    checked = compared = 0
    for force, moment in zip(contacts.force, contacts.moment, strict=True):
        here = solve(body, force, moment, "wrench_axis")
        if not here.ok or here.condition > 10.0:
            continue
        found = sensitivity(body, here)
        shift = found.tangents @ np.hstack((found.by_force, found.by_moment))
        size = float(np.linalg.norm(force))
        differences = np.empty((3, 6))
        for k in range(6):
            step = np.zeros(6)
            step[k] = 1e-6 * size
            ends = [
                solve(body, force + sign * step[:3], moment + sign * step[3:], "wrench_axis").centroid
                for sign in (1.0, -1.0)
            ]
            differences[:, k] = (ends[0] - ends[1]) / (2e-6 * size)
        compared += 1
        checked += bool(np.abs(differences - shift).max() < 1e-4 * np.abs(shift).max())
    # Steps across a seam are not compared.
    assert checked > 10
    assert checked > 0.8 * compared
