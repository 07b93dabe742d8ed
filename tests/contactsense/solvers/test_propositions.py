"""Propositions 1 and 2 of the paper, on random bodies."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from contactsense.benchmarks.solvers.sampling import unit
from contactsense.solvers import (
    Box,
    Capsule,
    Ellipsoid,
    Polytope,
    Revolved,
    Status,
    Superquadric,
    Surface,
    TaperedCapsule,
    solve,
)
from tests.contactsense.solvers.contacts import POINTS

LENGTHS = st.floats(0.02, 0.2)
ROUNDINGS = st.floats(0.005, 0.05)

BODIES = st.one_of(
    st.builds(Ellipsoid, LENGTHS, LENGTHS, LENGTHS),
    st.builds(Capsule, LENGTHS, LENGTHS),
    st.builds(TaperedCapsule, st.floats(0.15, 0.3), LENGTHS, LENGTHS),
    st.builds(Revolved, LENGTHS, LENGTHS, LENGTHS, ROUNDINGS),
    st.builds(Box, LENGTHS, LENGTHS, LENGTHS, ROUNDINGS),
    st.builds(Superquadric, LENGTHS, LENGTHS, LENGTHS),
    st.builds(
        lambda seed, rounding: Polytope(
            0.1 * unit(np.random.default_rng(seed).normal(size=(12, 3))), rounding
        ),
        st.integers(0, 50),
        ROUNDINGS,
    ),
)


@pytest.mark.slow
@settings(max_examples=300)
@given(body=BODIES, seed=st.integers(0, 2**32 - 1))
def test_proposition_1_the_centroid_lies_on_the_side_of_the_contacts(body: Surface, seed: int) -> None:
    """Several contacts on one side of a plane, their tractions' projections inside: so is the centroid on
    that side."""
    rng = np.random.default_rng(seed)
    points, normals = POINTS[type(body)](body, rng, 60)
    direction = unit(rng.normal(size=3))
    heights = points @ direction
    outside_distance = np.argsort(heights)[-rng.integers(2, 6) :]
    level = float(heights[outside_distance].min())
    touched, outward = points[outside_distance], normals[outside_distance]
    forces = -outward * rng.lognormal(size=(len(outside_distance), 1))
    sideways = 0.3 * rng.normal(size=forces.shape)
    forces += np.linalg.norm(forces, axis=1, keepdims=True) * (
        sideways - outward * np.sum(sideways * outward, axis=1)[:, None]
    )
    if np.any(np.sum(forces * outward, axis=1) >= 0.0) or np.any(forces @ direction >= -1e-3):
        return
    # Where each traction's line meets the plane must be inside the body (Proposition 1).
    feet = touched + forces * ((level - heights[outside_distance]) / (forces @ direction))[:, None]
    if not _inside(body, feet, points, normals):
        return
    found = solve(body, forces.sum(axis=0), np.cross(touched, forces).sum(axis=0))
    assert found.status == Status.OK
    assert found.centroid @ direction >= level - 1e-9


def _inside(body: Surface, feet: np.ndarray, points: np.ndarray, normals: np.ndarray) -> bool:
    """Whether all feet, shape (N, 3), lie inside all tangent planes of many surface points."""
    more, outward = POINTS[type(body)](body, np.random.default_rng(0), 400)
    planes, at = np.vstack((normals, outward)), np.vstack((points, more))
    return bool(np.all(feet @ planes.T - np.sum(at * planes, axis=1) <= 1e-12))


@pytest.mark.slow
@settings(max_examples=300)
@given(body=BODIES, seed=st.integers(0, 2**32 - 1))
def test_proposition_2_the_contact_is_the_only_one(body: Surface, seed: int) -> None:
    """Whatever pushing contact makes the wrench, it is the one that is found."""
    rng = np.random.default_rng(seed)
    points, normals = POINTS[type(body)](body, rng, 3)
    for c, n in zip(points, normals, strict=True):
        f = unit(rng.normal(size=3))
        f *= -np.sign(f @ n)
        if abs(f @ n) < 0.05:
            continue
        found = solve(body, f, np.cross(c, f) + 0.03 * rng.normal() * n)
        assert found.ok
        np.testing.assert_allclose(found.centroid, c, atol=1e-9)


@settings(max_examples=200)
@given(body=BODIES, seed=st.integers(0, 2**32 - 1))
def test_every_wrench_with_a_torsion_has_a_contact(body: Surface, seed: int) -> None:
    """Theory, section 4: on a bounded convex body a pushing contact exists for every wrench with f.m other
    than zero."""
    rng = np.random.default_rng(seed)
    force, moment = rng.normal(size=3), 0.3 * rng.normal(size=3)
    found = solve(body, force, moment)
    assert found.status == Status.OK
    assert found.residual < 1e-9
    assert force @ found.normal < 0.0


def test_a_concave_pair_has_two_answers() -> None:
    """Uniqueness needs convexity: a force through two balls touches either."""
    force = np.array((0.0, 0.0, -1.0))
    answers = [solve(Ellipsoid(0.1, 0.1, 0.1), force, np.cross((0.0, 0.0, z), force)) for z in (0.0, -0.5)]
    assert all(answer.ok for answer in answers)
    assert answers[0].torsion == pytest.approx(answers[1].torsion)
