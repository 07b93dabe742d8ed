"""Laws that hold for the map of any sensors, and the map against simulated pushes."""

from typing import Any

import numpy as np
import pytest

from contactsense import Detectability, JointTorqueSensor, Scene, WrenchSensor, detectability
from contactsense.benchmarks.accuracy.static_cases import Noise
from contactsense.benchmarks.accuracy.surface_map import compare, scene_of
from contactsense.detection.thresholds import SampleThresholds
from contactsense.kinematics.forward_kinematics import forward_kinematics
from contactsense.kinematics.model import empty_motion
from contactsense.robots import load
from contactsense.robots.link_poses import link_poses
from contactsense.robots.primitives import Sphere
from contactsense.robots.surroundings import Body
from contactsense.scene_model.constants import build_constants
from contactsense.surface_map.place_error import place_covariance, radius_of_share
from contactsense.surface_map.places import touchable_places
from contactsense.surface_map.sensor_response import sensor_response
from contactsense.surface_map.smallest_force import detected_size

Q = np.array([0.0, -1.3, 1.6, -1.9, -1.57, 0.0])
BASE = WrenchSensor(force_noise=0.25, moment_noise=0.05)
TORQUE = JointTorqueSensor(noise=1.0)
EVERY = 3


def scene(**fields: Any) -> Scene:
    return Scene(robot=load("ur5e"), detail="coarse", **fields)


def inclined(of: Scene, q: np.ndarray = Q, force: float | None = None) -> Detectability:
    """The map for pushes that are inclined as the localizer assumes, at some of its places: each obeys the
    laws by itself."""
    return detectability(of, q, force=force, friction=of.friction, every=EVERY)


@pytest.fixture(scope="module")
def both() -> Detectability:
    return inclined(scene(base_wrench=BASE, joint_torque=TORQUE))


@pytest.fixture(scope="module")
def torques() -> Detectability:
    return inclined(scene(base_wrench=None, joint_torque=TORQUE))


@pytest.mark.slow
def test_twice_the_noise_needs_twice_the_force(both: Detectability) -> None:
    noisy = scene(
        base_wrench=WrenchSensor(force_noise=0.5, moment_noise=0.1),
        joint_torque=JointTorqueSensor(noise=2.0),
    )
    found = inclined(noisy, force=2.0 * both.force)
    np.testing.assert_allclose(found.smallest_force, 2.0 * both.smallest_force, rtol=1e-9)
    # The same ratio of force to noise: the same errors.
    np.testing.assert_allclose(found.error, both.error, rtol=1e-6)
    np.testing.assert_allclose(found.link_probability, both.link_probability, atol=1e-6)


def test_errors_fall_with_the_force(both: Detectability) -> None:
    stronger = inclined(scene(base_wrench=BASE, joint_torque=TORQUE), force=3.0 * both.force)
    assert (stronger.error < both.error).all()
    assert stronger.share @ stronger.link_probability > both.share @ both.link_probability


def test_a_base_sensor_makes_nothing_worse(both: Detectability, torques: Detectability) -> None:
    # Noise alone is larger in more residuals, so the threshold is higher.
    sizes = [
        detected_size(scene(base_wrench=base, joint_torque=TORQUE), torques.detection)
        for base in (BASE, None)
    ]
    assert (both.smallest_force <= torques.smallest_force * sizes[0] / sizes[1]).all()
    assert (both.smallest_force < 5.0).all()


def test_joint_torques_make_no_covariance_larger(both: Detectability, torques: Detectability) -> None:
    constants, motion = build_constants(scene(base_wrench=BASE, joint_torque=TORQUE)), empty_motion(6)
    forward_kinematics(constants.model, Q, motion)
    places = touchable_places(constants, motion, constants.samples)
    radii = []
    for torque in (TORQUE, None):
        response = sensor_response(scene(base_wrench=BASE, joint_torque=torque), constants, motion)
        covariance, _ = place_covariance(response[places.link], places, constants.prior, both.force, 0.5)
        radii.append(radius_of_share(covariance, 0.5))
    assert (radii[0] <= radii[1] * (1.0 + 1e-9)).all()
    assert (radii[0] < 0.99 * radii[1]).any()
    # Errors and probabilities of the map come from few points of the noise, and obey the law only roughly.
    assert np.isfinite(both.error).all()
    # Without a base sensor at most six torques are left, and the place is open.
    told = np.isfinite(torques.error)
    assert told.any()
    assert np.median(torques.error[told]) > 3.0 * np.median(both.error[told])


def test_joints_measure_nothing_of_a_push_on_the_base(torques: Detectability) -> None:
    on_base = torques.link == 0
    assert on_base.any()
    assert np.isinf(torques.smallest_force[on_base]).all()
    assert np.isinf(torques.error[on_base]).all()
    assert torques.by_link()[0].smallest_force == (np.inf, np.inf)


def test_the_map_turns_with_the_arm(both: Detectability) -> None:
    turned = inclined(
        scene(base_wrench=BASE, joint_torque=TORQUE), Q + np.array([1.1, 0.0, 0.0, 0.0, 0.0, 0.0])
    )
    np.testing.assert_allclose(turned.smallest_force, both.smallest_force, rtol=1e-9)
    # The points at which the noise is evaluated do not turn with it.
    assert np.median(turned.error / both.error) == pytest.approx(1.0, abs=0.02)
    assert np.mean(np.abs(turned.error / both.error - 1.0) < 0.2) > 0.95


@pytest.mark.slow
def test_a_wrist_sensor_feels_the_tool_only() -> None:
    tool = {
        "name": "rod",
        "mass": 0.5,
        "com": (0.0, 0.0, 0.1),
        "tensor": (1e-3, 0.0, 0.0, 1e-3, 0.0, 1e-3),
        "primitives": [{"kind": "capsule", "a": (0.0, 0.0, 0.03), "b": (0.0, 0.0, 0.2), "radius": 0.02}],
    }
    fields: dict[str, Any] = {"base_wrench": None, "joint_torque": TORQUE, "tool": tool}
    without = detectability(scene(**fields), Q, every=4)
    wrist = detectability(scene(**fields, wrist_wrench=WrenchSensor()), Q, every=4)
    on_tool = wrist.link == len(wrist.link_names) - 1
    assert on_tool.any()
    assert (wrist.smallest_force[on_tool] < 0.5 * without.smallest_force[on_tool]).all()
    felt = ~on_tool & np.isfinite(wrist.smallest_force)
    # The threshold is higher, the signal the same.
    assert (wrist.smallest_force[felt] > without.smallest_force[felt]).all()


def test_a_coarser_map_has_some_of_the_places(both: Detectability) -> None:
    of = scene(base_wrench=BASE, joint_torque=TORQUE)
    some = detectability(of, Q, friction=of.friction, every=20 * EVERY)
    assert some.share.sum() == pytest.approx(1.0)
    for field in ("point_base", "smallest_force", "error", "error_95", "link_probability"):
        np.testing.assert_allclose(getattr(some, field), getattr(both, field)[::20], rtol=1e-6)


def test_the_detected_size_is_detected_as_often() -> None:
    rng = np.random.default_rng(0)
    of = scene(base_wrench=BASE, joint_torque=None)
    level = SampleThresholds(of).threshold((True, False, 0))
    for detection in (0.5, 0.9):
        residuals = rng.standard_normal((200_000, 6))
        residuals[:, 0] += detected_size(of, detection)
        energy = 0.5 * (residuals**2).sum(axis=1)
        assert np.mean(energy > level) == pytest.approx(detection, abs=0.005)


def test_the_radius_holds_its_share() -> None:
    covariance = np.array([np.eye(2), np.diag([1.0, 0.0]), [[2.0, 1.0], [1.0, 3.0]]])
    radius = radius_of_share(covariance, 0.5)
    np.testing.assert_allclose(radius[:2], [np.sqrt(2.0 * np.log(2.0)), 0.67449], rtol=1e-3)
    points = np.random.default_rng(0).multivariate_normal(np.zeros(2), covariance[2], 200_000)
    assert np.mean(np.linalg.norm(points, axis=1) < radius[2]) == pytest.approx(0.5, abs=0.005)


@pytest.mark.parametrize(
    ("fields", "message"),
    [
        ({"force": 0.0}, "force: expected a positive number of newtons, at most 5000, got 0.0"),
        ({"force": 1e300}, r"force: expected a positive number of newtons, at most 5000, got 1e\+300"),
        ({"detection": 1.0}, "detection: expected a probability between 0 and 1, got 1.0"),
        ({"friction": -0.1}, "friction: expected a coefficient of at least 0, got -0.1"),
        ({"every": 0}, "every: expected at least 1, got 0"),
        ({"q": np.array([0.0, -90.0, 90.0, 0.0, 0.0, 0.0])}, "q: .* got -90; are they in degrees"),
    ],
)
def test_wrong_arguments_are_told(fields: dict[str, Any], message: str) -> None:
    with pytest.raises(ValueError, match=message):
        detectability(scene(), **{"q": Q} | fields)


def test_a_posture_in_which_bodies_cover_everything_is_refused() -> None:
    wrist = link_poses(load("ur5e"), Q)[6, :3, 3]
    ball = Sphere(center=tuple(wrist.tolist()), radius=0.3)
    covered = scene(touchable=("wrist_3",), bodies=(Body(name="hood", role="cover", primitives=(ball,)),))
    with pytest.raises(ValueError, match=r"^q: no place can be touched in this posture"):
        detectability(covered, Q)
    assert (detectability(covered, -Q, every=20).link == 6).all()


@pytest.mark.slow
def test_the_map_agrees_with_the_localizer() -> None:
    # Errors that are small beside the radius of the links: the map is linear.
    quiet = scene_of("ur5e", Noise(0.05, 0.01, 0.3), "all")
    found = compare(quiet, Q, 20.0, 0.0, 150, np.random.default_rng(0), every=4)
    for ratio in (found.force_ratio, found.error_ratio):
        agreement = found.within(ratio)
        assert agreement is not None
        assert agreement >= 0.9
    assert found.share @ np.abs(found.link_difference) < 0.05


@pytest.mark.slow
@pytest.mark.parametrize(("sensors", "at_least"), [("all", 0.8), ("torques", 0.6)])
def test_the_map_agrees_where_the_place_is_open(sensors: str, at_least: float) -> None:
    # Errors of a centimetre and more: a covariance agrees on two thirds of the surface with all sensors, and
    # tells nothing with torques alone.
    found = compare(
        scene_of("ur5e", Noise(1.0, 0.2, 3.0), sensors), Q, 20.0, 0.0, 150, np.random.default_rng(0), every=8
    )
    agreement = found.within(found.error_ratio)
    assert agreement is not None
    assert agreement >= at_least
    assert found.share @ np.abs(found.link_difference) < 0.15
