"""Regions of a place that joint torques alone determine: as often true as stated where it is known well.

On the last link of an arm with six joints it is: place, force and torsion have six unknowns.
"""

import math

import numpy as np
import pytest
from scipy.stats import chi2, norm

from contactsense import Contact, JointTorqueSensor, Localizer, Scene
from contactsense.kinematics.forward_kinematics import forward_kinematics
from contactsense.kinematics.model import build_model, empty_motion
from contactsense.localization.surface_search.search import search_surface
from contactsense.robots.vectors import tangents
from tests.contactsense.localization.latest_search import latest_search
from tests.plain_arm import Truth, contacts, plain_ur5e

ARM = plain_ur5e()
LAST = len(ARM.joints)
NARROW = 0.008
"""Larger standard deviation of a place that is known well [m]."""


@pytest.fixture(scope="module")
def truth() -> Truth:
    return contacts(ARM, 5000, seed=5, torsion=0.0)


def located(truth: Truth, noise: float, surface_error: float) -> list[tuple[int, np.ndarray, Contact]]:
    """Clear and narrow answers that are near the truth: its number, the true place, and the answer.

    The real surface is `surface_error` (standard deviation) away from the primitive, along its normal.
    """
    scene = Scene(
        robot=ARM,
        base_wrench=None,
        joint_torque=JointTorqueSensor(noise=noise),
        surface_error=surface_error,
    )
    localizer, rng = Localizer(scene), np.random.default_rng(6)
    model, motion = build_model(ARM), empty_motion(LAST)
    found = []
    for i in np.flatnonzero(truth.link == LAST):
        forward_kinematics(model, truth.q[i], motion)
        point = truth.point[i] + surface_error * rng.standard_normal() * truth.normal[i]
        torque = -motion.screw @ np.concatenate((truth.force[i], np.cross(point, truth.force[i])))
        torque += noise * rng.standard_normal(LAST)
        best = localizer.locate(truth.q[i], joint_torque=torque, detect=False).contacts[0]
        largest = np.sqrt(np.linalg.eigvalsh(best.covariance)[-1])
        is_near = best.link_index == LAST and np.linalg.norm(point - best.point_base) < 4.0 * NARROW
        if is_near and best.probability > 0.9 and largest < NARROW:
            found.append((int(i), point, best))
    return found


@pytest.mark.slow
def test_noise_leaves_a_place_as_open_as_stated_along_each_tangent(truth: Truth) -> None:
    """Torques seldom leave both tangents open alike."""
    inside = []
    for _, point, best in located(truth, noise=0.05, surface_error=1e-6):
        T = np.array(tangents(tuple(best.normal_base.tolist())))
        offset = T @ (point - best.point_base)
        squared = offset @ np.linalg.solve(T @ best.covariance @ T.T, offset)
        inside.append(squared < chi2.ppf(0.9, 2))
    assert len(inside) > 100
    assert np.mean(inside) == pytest.approx(0.9, abs=0.05)


@pytest.mark.slow
def test_the_surface_leaves_a_place_as_open_as_stated_along_the_tangential_force(truth: Truth) -> None:
    """What the surface is off along the normal moves the place of a slanted force: without noise, by more
    than anything else."""
    scaled = []
    for i, point, best in located(truth, noise=0.002, surface_error=0.004):
        normal, push = truth.normal[i], -truth.force[i] @ truth.normal[i]
        ratio = truth.force[i] / push + normal
        size = np.linalg.norm(ratio)
        if size > 0.1:
            along = ratio / size
            scaled.append(along @ (point - best.point_base) / np.sqrt(along @ best.covariance @ along))
    assert len(scaled) > 100
    assert np.mean(np.abs(scaled) < norm.ppf(0.95)) == pytest.approx(0.9, abs=0.06)


@pytest.mark.slow
def test_a_surface_that_is_moved_by_nothing_is_as_one_that_is_not_moved(truth: Truth) -> None:
    """A candidate often ends on another primitive than that of its mode, with another mean surface."""
    localizer = Localizer(
        Scene(robot="ur5e", detail="coarse", base_wrench=None, joint_torque=JointTorqueSensor(noise=0.1))
    )
    problem, arrays = latest_search(localizer)
    candidates, deviations = arrays.candidates, problem.scene.deviations
    deviations.rotation[:], deviations.translation[:] = np.eye(3), 0.0
    compared = 0
    for q, torque in zip(truth.q[:40], truth.torque[:40], strict=True):
        localizer.locate(q, joint_torque=torque, detect=False)
        found = []
        for displacement in (0.0, 1e-9):
            deviations.displacement[:] = displacement
            count = search_surface(problem._replace(wrench_measured=False), arrays, -math.inf)
            found.append((candidates.point[:count].copy(), candidates.covariance[:count].copy()))
        for unmoved, moved in zip(*found, strict=True):
            np.testing.assert_allclose(moved, unmoved, rtol=1e-6, atol=1e-9)
        compared += len(found[0][0])
    assert compared > 40
