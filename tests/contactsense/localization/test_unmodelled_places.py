"""Touches at places that the primitives do not model."""

from collections.abc import Iterator

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.integrate import quad
from scipy.stats import multivariate_normal

from contactsense import Localizer, Scene
from contactsense.localization.unmodelled_candidates import (
    STEEP_TILT,
    add_unmodelled_candidates,
    least_tilted,
)
from contactsense.robots.link_poses import link_poses
from contactsense.scene_model.constants import build_constants
from contactsense.scene_model.unmodelled_places import SHARE_PER_SQUARED_TILT
from contactsense.sensors.settings import JointTorqueSensor, WrenchSensor
from tests.contactsense.localization.latest_search import latest_search

Q = np.array([0.0, -1.3, 1.6, -1.9, -1.57, 0.0])
UPPER_ARM, FOREARM, WRIST_3 = 2, 3, 6
EXACT = Scene(
    robot="ur5e",
    base_wrench=WrenchSensor(force_noise=0.002, moment_noise=0.0004),
    joint_torque=JointTorqueSensor(noise=0.002),
)

unit = st.tuples(*[st.floats(-1.0, 1.0)] * 3).map(np.array).filter(lambda v: np.linalg.norm(v) > 0.1)


@pytest.fixture(scope="module")
def localizer() -> Localizer:
    return Localizer(EXACT)


def test_their_probability_is_that_of_the_tilt() -> None:
    constants = build_constants(EXACT)
    samples, moments = constants.samples, constants.unmodelled
    weight = np.exp(samples.log_share) * SHARE_PER_SQUARED_TILT * samples.tilt**2
    owner = constants.surfaces.link[samples.primitive]
    for link in range(len(EXACT.link_names)):
        own = weight[owner == link]
        assert np.exp(moments.log_weight[link]) == pytest.approx(own.sum())
        mean = np.average(samples.point[owner == link], axis=0, weights=own)
        np.testing.assert_allclose(moments.centre[link], mean, atol=1e-12)
        spread = np.cov(samples.point[owner == link].T, aweights=own, bias=True)
        np.testing.assert_allclose(moments.covariance[link], spread, atol=1e-12)


def test_with_equal_links_their_probability_is_that_of_the_link() -> None:
    area = build_constants(EXACT)
    equal = build_constants(EXACT.model_copy(update={"link_prior": "equal"}))
    np.testing.assert_allclose(
        equal.unmodelled.log_weight - area.unmodelled.log_weight,
        equal.prior.log_link_density - area.prior.log_link_density,
        atol=1e-9,
    )


def _push(link: int, force: np.ndarray, point: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Base wrench and joint torques of a force at a point of a link, base axes; weight subtracted."""
    poses = link_poses(EXACT.robot, Q[None])[0]
    torque = np.zeros(6)
    for joint in range(link):
        axis, origin = poses[joint + 1, :3, 2], poses[joint + 1, :3, 3]
        torque[joint] = -axis @ np.cross(point - origin, force)
    return np.concatenate([force, np.cross(point, force)]), torque


def _samples(localizer: Localizer, link: int) -> tuple[np.ndarray, np.ndarray]:
    """Points and normals of the samples on a link, base frame, by falling tilt."""
    constants = localizer.constants
    samples = constants.samples
    rows = np.flatnonzero(constants.surfaces.link[samples.primitive] == link)
    rows = rows[np.argsort(-samples.tilt[rows])]
    R, o = np.split(link_poses(EXACT.robot, Q[None])[0, link, :3], [3], axis=1)
    return samples.point[rows] @ R.T + o.T, samples.normal[rows] @ R.T


def _rib_pushes(localizer: Localizer, link: int) -> Iterator[tuple[np.ndarray, np.ndarray, np.ndarray]]:
    """Places of ribs a centimetre above the steepest places of a link, and what a push from the side
    measures: the line of action grazes the primitives or misses them."""
    chance = np.random.default_rng(0)
    points, normals = _samples(localizer, link)
    for place, normal in zip(points[:8], normals[:8], strict=True):
        along = np.cross(normal, chance.standard_normal(3))
        force = 20.0 * (along / np.linalg.norm(along) + 0.1 * normal)
        rib = place + 0.01 * normal
        yield rib, *_push(link, force, rib)


@pytest.mark.parametrize("link", [UPPER_ARM, FOREARM, WRIST_3])
def test_a_force_that_no_primitive_explains_is_on_its_link(localizer: Localizer, link: int) -> None:
    errors = []
    for rib, base, torque in _rib_pushes(localizer, link):
        estimate = localizer.locate(Q, base_wrench=base, joint_torque=torque)
        assert np.argmax(estimate.link_probability) == link
        assert estimate.contacts[0].link_index == link
        listed = sum(contact.probability for contact in estimate.contacts)
        assert listed <= estimate.link_probability.sum() + 1e-9 <= 1.0 + 1e-6
        errors.append(np.linalg.norm(estimate.contacts[0].point_base - rib))
    assert np.median(errors) < 0.03


def _steepness(angle: np.ndarray | float) -> np.ndarray:
    return np.exp(-0.5 * np.square(angle / STEEP_TILT))


@pytest.mark.slow
def test_the_evidence_is_that_of_the_samples(localizer: Localizer) -> None:
    """Sum over all samples of a link, against that of the normal variable of the same moments; and all
    candidates are on the line of action."""
    for link in (UPPER_ARM, FOREARM, WRIST_3):
        for _, base, torque in _rib_pushes(localizer, link):
            localizer.locate(Q, base_wrench=base, joint_torque=torque)
            constants, state = localizer._buffers.constants, localizer._buffers.state
            problem, arrays = latest_search(localizer)
            state.surface_cells.unassigned_evidence[link] = 3.0
            count = add_unmodelled_candidates(problem, arrays, link, -1e9, 0)
            rows = state.candidates.order[:count]
            scores = state.candidates.score[rows]
            fused = np.array(state.hypotheses.wrench[link])
            for place in state.candidates.point[rows]:
                rest = fused[3:] - np.cross(place, fused[:3])
                np.testing.assert_allclose(np.cross(fused[:3], rest), 0.0, atol=1e-9)
            found = np.logaddexp.reduce([*scores, state.surface_cells.unassigned_evidence[link]])

            pose = link_poses(EXACT.robot, Q[None])[0, link]
            R, o, samples, moments = pose[:3, :3], pose[:3, 3], constants.samples, constants.unmodelled
            f, F = R.T @ fused[:3], np.linalg.norm(fused[:3])
            m = R.T @ (fused[3:] - np.cross(o, fused[:3]))
            centre = o + R @ moments.centre[link]
            J = np.hstack([np.cross(np.eye(3), centre), np.eye(3)])
            variance = np.trace(J @ np.array(state.hypotheses.covariance[link]) @ J.T) / (2.0 * F * F)
            variance += constants.prior.surface_deviation**2 + constants.prior.torsion_lever**2
            plane = np.linalg.svd(f[None])[2][1:]
            line = plane @ np.cross(f, m) / (F * F)
            own = constants.surfaces.link[samples.primitive] == link
            share = np.exp(samples.log_share[own]) * samples.tilt[own] ** 2
            density = np.array(
                [
                    multivariate_normal(plane @ c, (variance + spread**2) * np.eye(2)).pdf(line)
                    for c, spread in zip(samples.point[own], samples.spread[own], strict=True)
                ]
            )
            angle = np.arccos(np.clip(-samples.normal[own] @ f / F, -1.0, 1.0))
            over_sphere = quad(lambda a: 0.5 * np.sin(a) * np.exp(-0.5 * (a / STEEP_TILT) ** 2), 0.0, np.pi)[
                0
            ]
            favour = np.exp(-0.5 * (angle / STEEP_TILT) ** 2) / over_sphere
            spread = plane @ moments.covariance[link] @ plane.T + variance * np.eye(2)
            expected = 3.0 + np.log(share @ (density * favour) / share.sum())
            expected -= multivariate_normal(plane @ moments.centre[link], spread).logpdf(line)
            assert found == pytest.approx(expected, abs=1e-5)


def test_with_one_error_for_the_whole_surface_there_are_none() -> None:
    constants = build_constants(EXACT.model_copy(update={"surface_error": 0.001}))
    assert np.isneginf(constants.unmodelled.log_weight).all()


def test_a_push_on_a_plain_face_keeps_its_certainty(localizer: Localizer) -> None:
    points, normals = _samples(localizer, FOREARM)
    base, torque = _push(FOREARM, -20.0 * normals[-1], points[-1])
    estimate = localizer.locate(Q, base_wrench=base, joint_torque=torque)
    assert estimate.contacts[0].link == "forearm"
    assert estimate.contacts[0].probability > 0.99
    assert np.linalg.norm(estimate.contacts[0].point_base - points[-1]) < 0.002


@given(normal=unit, force=unit, friction=st.floats(0.05, 2.0))
def test_the_tilted_normal_has_the_force_in_its_friction_cone(
    normal: np.ndarray, force: np.ndarray, friction: float
) -> None:
    normal = normal / np.linalg.norm(normal)
    found = np.array(least_tilted(tuple(normal), tuple(force), friction))
    assert np.linalg.norm(found) == pytest.approx(1.0)
    pressing = -found @ force
    tangential = np.linalg.norm(force + pressing * found)
    assert tangential <= friction * pressing * (1.0 + 1e-6) + 1e-12
    inward = -force / np.linalg.norm(force)
    if np.arctan2(np.linalg.norm(np.cross(normal, inward)), normal @ inward) <= np.arctan(friction):
        np.testing.assert_allclose(found, normal, atol=1e-9)
    else:
        # It is in the plane of both, on the side of the given normal, at the edge of the cone.
        assert abs(found @ np.cross(normal, inward)) < 1e-6
        assert tangential == pytest.approx(friction * pressing, rel=1e-6)


def test_a_normal_opposite_to_the_force_is_tilted_to_some_side() -> None:
    found = np.array(least_tilted((0.0, 0.0, 1.0), (0.0, 0.0, 5.0), 0.5))
    assert np.linalg.norm(found) == pytest.approx(1.0)
    assert -found[2] == pytest.approx(1.0 / np.hypot(1.0, 0.5))
