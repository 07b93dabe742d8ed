"""Answers to readings with noise, against first-order theory where it holds and against closed forms."""

import numpy as np
import pytest

from contactsense.benchmarks.accuracy.static_cases import Noise
from contactsense.benchmarks.accuracy.surface_map import scene_of
from contactsense.kinematics.forward_kinematics import forward_kinematics
from contactsense.kinematics.model import empty_motion
from contactsense.localization.ranking import LINE_OF_ACTION_DEVIATION
from contactsense.scene_model.constants import build_constants
from contactsense.solvers.posterior.contact_prior import STUDENT_DOF
from contactsense.surface_map.cell_evidence import cell_evidence, posterior
from contactsense.surface_map.expected_answers import expected_answers
from contactsense.surface_map.noise_points import readings
from contactsense.surface_map.place_error import (
    line_of_action_known,
    place_covariance,
    push_jacobian,
    radius_of_share,
    step_jacobian,
)
from contactsense.surface_map.places import on_surface, touchable_places
from contactsense.surface_map.sensor_response import sensor_response

Q = np.array([0.0, -1.3, 1.6, -1.9, -1.57, 0.0])
FORCE = 20.0


def test_half_of_the_points_are_within_the_median_radius() -> None:
    rng = np.random.default_rng(3)
    for rows in (2, 6, 12):
        gain, push = rng.standard_normal((2, rows)), rng.standard_normal((rows, 4))
        moved = (readings(push, gain, 0.0) - push[:, 0]) @ gain.T
        radius = radius_of_share((gain @ gain.T)[None], 0.5)[0]
        assert np.median(np.linalg.norm(moved, axis=1)) == pytest.approx(radius, rel=0.05)


def test_the_points_have_the_moments_of_noise_and_push() -> None:
    rng = np.random.default_rng(4)
    gain, push = rng.standard_normal((2, 12)), np.zeros((12, 4))
    noise = readings(push, gain, 0.0)
    np.testing.assert_allclose(noise.mean(axis=0), 0.0, atol=1e-9)
    np.testing.assert_allclose(noise.T @ noise / len(noise), np.eye(12), atol=1e-9)
    # A uniform distribution on a disc has half its radius as standard deviation along each axis.
    push[:3, 1:] = np.eye(3)
    inclined = (readings(push, gain, 4.0) - noise)[:, :3]
    np.testing.assert_allclose(inclined.std(axis=0), (2.0, 2.0, 1.0), rtol=0.1)


def test_small_noise_moves_the_answers_as_the_covariance_says() -> None:
    scene = scene_of("ur5e", Noise(0.05, 0.01, 0.3), "all")
    constants, motion = build_constants(scene), empty_motion(6)
    forward_kinematics(constants.model, Q, motion)
    response = sensor_response(scene, constants, motion)
    coarse, fine = (
        cell_evidence(response[cells.link], cells, constants.prior, FORCE)
        for cells in (
            touchable_places(constants, motion, samples)
            for samples in (constants.samples, constants.subsamples)
        )
    )
    places = coarse.cells
    # The flattest places: elsewhere the step of a covariance leaves the surface.
    flat = np.argsort(np.linalg.norm(places.turn, axis=(1, 2)))[:20]
    push = push_jacobian(response[places.link], places, constants.prior, FORCE)
    covariance = place_covariance(response[places.link], places, constants.prior, FORCE, 0.0)[0]
    predicted = radius_of_share(covariance, 0.5)
    found = []
    for i in flat:
        answers = expected_answers(coarse, fine, push[i, :, 0], readings(push[i], coarse.gain[i], 0.0))
        on_link = answers.link == places.link[i]
        if on_link.mean() < 0.9:
            # Beside another link that has the same face.
            continue
        point = on_surface(constants, motion, answers.link, answers.point)
        error = np.median(np.linalg.norm(point[on_link] - places.point[i], axis=1))
        found.append(error / predicted[i])
    assert len(found) >= 15
    assert np.median(found) == pytest.approx(1.0, abs=0.05)


def test_the_evidence_of_a_cell_is_that_of_normally_distributed_readings() -> None:
    scene = scene_of("ur5e", Noise(1.0, 0.2, 3.0), "all")
    constants, motion = build_constants(scene), empty_motion(6)
    forward_kinematics(constants.model, Q, motion)
    cells = touchable_places(constants, motion, constants.samples)
    response = sensor_response(scene, constants, motion)[cells.link]
    push = push_jacobian(response, cells, constants.prior, FORCE)
    step = step_jacobian(response, cells, FORCE, turning=False) * cells.spread[:, None, None]
    jacobian = np.concatenate((push, step), axis=2)
    # Student's t has this variance about its mode, in units of its scale.
    variance = np.diag([1.0, *[STUDENT_DOF / (STUDENT_DOF + 2.0)] * 2, 1.0, 1.0, 1.0])
    prepared = cell_evidence(response, cells, constants.prior, FORCE)
    for cell in range(0, len(push), 100):
        covariance = np.eye(push.shape[1]) + jacobian[cell] @ variance @ jacobian[cell].T
        mean, shift = push[cell, :, 0], 0.1 * push[cell, :, 1]
        found = posterior(prepared, np.stack((mean, mean + shift, mean - shift))).evidence[cell]
        # Two sides, as a larger force makes the rest more exact.
        drop = found[0] - found[1:].mean()
        assert drop == pytest.approx(0.5 * shift @ np.linalg.solve(covariance, shift), rel=0.02)


def test_places_are_moved_to_the_surface() -> None:
    scene = scene_of("ur5e", Noise(0.25, 0.05, 1.0), "all")
    constants, motion = build_constants(scene), empty_motion(6)
    forward_kinematics(constants.model, Q, motion)
    places = touchable_places(constants, motion, constants.samples)
    lifted = places.point + 0.003 * places.normal
    moved = on_surface(constants, motion, places.link, lifted)
    # At concave edges another primitive may be nearer than the one below.
    apart = np.linalg.norm(moved - places.point, axis=1)
    assert np.mean(apart < 1e-6) > 0.9
    assert apart.max() < 0.006
    np.testing.assert_array_equal(on_surface(constants, motion, np.full(len(lifted), -1), lifted), lifted)


def test_the_line_of_action_is_known_if_the_moment_is() -> None:
    origin = np.array([[0.3, -0.2, 0.5]])
    # With an exact force the moment is as uncertain about any point: its trace is three variances.
    limit = LINE_OF_ACTION_DEVIATION * FORCE / np.sqrt(3.0)
    for moment, expected in ((0.99 * limit, True), (1.01 * limit, False)):
        response = np.diag([1e6] * 3 + [1.0 / moment] * 3)[None]
        assert line_of_action_known(response, origin, FORCE)[0] == expected
    # An uncertain force has a lever to the link's origin.
    force = LINE_OF_ACTION_DEVIATION * FORCE / np.sqrt(2.0) / np.linalg.norm(origin)
    for std, expected in ((0.99 * force, True), (1.01 * force, False)):
        response = np.diag([1.0 / std] * 3 + [1e6] * 3)[None]
        assert line_of_action_known(response, origin, FORCE)[0] == expected
    # Five readings leave a wrench open.
    assert not line_of_action_known(np.eye(6)[None, :5] * 1e6, origin, FORCE)[0]
