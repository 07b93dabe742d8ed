"""Points of the noise's distribution, and the readings and answers that belong to them."""

from typing import Any

import numpy as np
import pytest

from contactsense import Localizer, Scene
from contactsense.benchmarks.accuracy.surface_map import ROD, scene_of
from contactsense.benchmarks.static_truth.cases import Noise
from contactsense.kinematics.forward_kinematics import forward_kinematics
from contactsense.kinematics.model import empty_motion
from contactsense.sensors.settings import LinkWrenchSensor, WrenchSensor
from contactsense.surface_map.noise_points import noisy_residuals
from contactsense.surface_map.place_gain import place_gain, push_jacobian
from contactsense.surface_map.places import touchable_places
from contactsense.surface_map.sensor_response import readings_of, sensor_response

Q = np.array([0.0, -1.3, 1.6, -1.9, -1.57, 0.0])
FORCE = 20.0


def test_half_of_the_points_are_within_the_median_radius() -> None:
    rng = np.random.default_rng(3)
    for rows in (2, 6, 12):
        gain, push = rng.standard_normal((2, rows)), rng.standard_normal((rows, 4))
        moved = (noisy_residuals(push, gain, 0.0) - push[:, 0]) @ gain.T
        drawn = rng.standard_normal((200_000, rows)) @ gain.T
        radius = np.median(np.linalg.norm(drawn, axis=1))
        assert np.median(np.linalg.norm(moved, axis=1)) == pytest.approx(radius, rel=0.05)


def test_the_points_have_the_moments_of_noise_and_push() -> None:
    rng = np.random.default_rng(4)
    gain, push = rng.standard_normal((2, 12)), np.zeros((12, 4))
    noise = noisy_residuals(push, gain, 0.0)
    np.testing.assert_allclose(noise.mean(axis=0), 0.0, atol=1e-9)
    np.testing.assert_allclose(noise.T @ noise / len(noise), np.eye(12), atol=1e-9)
    # A uniform distribution on a disc has half its radius as standard deviation along each axis.
    push[:3, 1:] = np.eye(3)
    inclined = (noisy_residuals(push, gain, 4.0) - noise)[:, :3]
    np.testing.assert_allclose(inclined.std(axis=0), (2.0, 2.0, 1.0), rtol=0.1)


@pytest.mark.parametrize(
    "fields",
    [
        {},
        {"base_wrench": None},
        {"joint_torque": None, "wrist_wrench": WrenchSensor(), "tool": ROD},
        {
            "wrist_wrench": WrenchSensor(),
            "tool": ROD,
            "link_wrenches": (LinkWrenchSensor(name="elbow", link="forearm"),),
        },
    ],
)
def test_readings_are_those_of_the_wrench_whose_response_is_given(fields: dict[str, Any]) -> None:
    scene = Scene.model_validate({"robot": "ur5e"} | fields)
    constants, motion = Localizer(scene, progress=False).constants, empty_motion(6)
    forward_kinematics(constants.model, Q, motion)
    response = sensor_response(scene, constants, motion)
    wrench = np.random.default_rng(5).standard_normal(6)
    readings = readings_of(scene, constants, motion, response @ wrench)
    links, joints = np.arange(len(scene.link_names)), np.arange(6)
    expected = {
        "base_wrench": np.tile(wrench, (len(links), 1)),
        # Joints beyond the touched link measure nothing.
        "joint_torque": -(motion.screw @ wrench) * (joints < links[:, None]),
        "wrist_wrench": wrench * (links >= 7)[:, None],
        "elbow": wrench * (links >= 3)[:, None],
    }
    there = {name: value for name, value in readings.items() if name != "link_wrenches" and value is not None}
    there |= readings["link_wrenches"] or {}
    assert set(there) == {
        *(["base_wrench"] if scene.base_wrench else []),
        *(["joint_torque"] if scene.joint_torque else []),
        *(["wrist_wrench"] if scene.wrist_wrench else []),
        *(sensor.name for sensor in scene.link_wrenches),
    }
    for name, value in there.items():
        np.testing.assert_allclose(value, expected[name], atol=1e-9, err_msg=name)


def test_small_noise_moves_the_answers_as_the_gain_says() -> None:
    scene = scene_of("ur5e", Noise(0.05, 0.01, 0.3), "all")
    localizer, motion = Localizer(scene, progress=False), empty_motion(6)
    constants = localizer.constants
    forward_kinematics(constants.model, Q, motion)
    places = touchable_places(constants, motion)
    response = sensor_response(scene, constants, motion)[places.link]
    push = push_jacobian(response, places, constants.prior, FORCE)
    gain = place_gain(response, places, constants.prior, FORCE)
    # The flattest places: elsewhere a step along the tangents leaves the surface.
    flat = np.argsort(np.linalg.norm(places.turn, axis=(1, 2)))[:20]
    errors = []
    for i in flat:
        residuals = noisy_residuals(push[i], gain[i], 0.0)
        readings = readings_of(scene, constants, motion, residuals)
        found = localizer.locate_batch(np.tile(Q, (len(residuals), 1)), **readings, detect=False)
        moved = (found.point_base - places.point[i]) @ places.tangents[i]
        expected = (residuals - push[i, :, 0]) @ gain[i].T
        right = found.link == places.link[i]
        errors.append(np.median(np.linalg.norm((moved - expected)[right], axis=1) / np.std(expected)))
    assert np.median(errors) < 0.01
