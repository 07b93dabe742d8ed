"""Laws that hold for the map of any sensors, and the map against simulated pushes."""

from typing import Any

import numpy as np
import pytest

from contactsense import Detectability, JointTorqueSensor, Scene, WrenchSensor, detectability
from contactsense.benchmarks.accuracy.surface_map import compare, scene_of
from contactsense.benchmarks.static_truth.cases import Noise
from contactsense.detection.thresholds import SampleThresholds
from contactsense.robots import load
from contactsense.robots.link_poses import link_poses
from contactsense.robots.primitives import Sphere
from contactsense.robots.surroundings import Body
from contactsense.surface_map.smallest_force import detected_size
from tests.shared import shared

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
        force=2.0 * both.force,
    )
    found = inclined(noisy)
    np.testing.assert_allclose(found.smallest_force, 2.0 * both.smallest_force, rtol=1e-9)
    # The same ratio of force to noise: the same errors.
    np.testing.assert_allclose(found.error, both.error, rtol=1e-6)
    np.testing.assert_allclose(found.link_probability, both.link_probability, atol=1e-6)


@pytest.mark.slow
def test_places_are_on_the_skin_as_the_answers_are() -> None:
    """In a few places the base is millimetres from its primitives, and the map took that for errors."""
    precise = WrenchSensor(force_noise=0.005, moment_noise=0.001)
    arm = Scene(robot="ur10e", base_wrench=precise, joint_torque=None, touchable=("base",))
    found, on_primitives = (
        detectability(of, Q)
        for of in (arm.model_copy(update={"detail": "skin", "meshes": shared("ur_visual/ur10e")}), arm)
    )
    moved = np.linalg.norm(found.point_base - on_primitives.point_base, axis=1)
    assert moved.max() > 0.003
    assert np.quantile(found.error, 0.95) < 2e-4
    np.testing.assert_allclose(found.smallest_force, on_primitives.smallest_force, rtol=1e-6)


def test_errors_fall_with_the_force(both: Detectability) -> None:
    stronger = inclined(scene(base_wrench=BASE, joint_torque=TORQUE), force=3.0 * both.force)
    # Not where another link explains the same readings as well: it is named then, more surely for a stronger
    # the push.
    told = both.link_probability > 0.5
    assert told.mean() > 0.95
    assert (stronger.error < both.error)[told].all()
    assert stronger.share @ stronger.link_probability > both.share @ both.link_probability


def test_a_base_sensor_makes_nothing_worse(both: Detectability, torques: Detectability) -> None:
    # Noise alone is larger in more residuals, so the threshold is higher.
    sizes = [
        detected_size(scene(base_wrench=base, joint_torque=TORQUE), torques.detection)
        for base in (BASE, None)
    ]
    assert (both.smallest_force <= torques.smallest_force * sizes[0] / sizes[1]).all()
    assert (both.smallest_force < 5.0).all()


def test_a_base_sensor_makes_errors_smaller(both: Detectability, torques: Detectability) -> None:
    assert np.isfinite(both.error).mean() > 0.98
    # Without it at most six torques are left, and the place is open.
    told = np.isfinite(torques.error) & np.isfinite(both.error)
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
    told = np.isfinite(both.error)
    ratio = turned.error[told] / both.error[told]
    assert np.median(ratio) == pytest.approx(1.0, abs=0.02)
    assert np.mean(np.abs(ratio - 1.0) < 0.2) > 0.9
    assert both.share @ np.abs(turned.link_probability - both.link_probability) < 0.02


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


@pytest.mark.parametrize(
    ("fields", "message"),
    [
        ({"force": 0.0}, "force: expected a positive number of newtons, at most 5000, got 0.0"),
        ({"force": 1e300}, r"force: expected a positive number of newtons, at most 5000, got 1e\+300"),
        ({"detection": 1.0}, "detection: expected a probability between 0 and 1, got 1.0"),
        ({"friction": -0.1}, "friction: expected a coefficient of at least 0, got -0.1"),
        ({"every": 0}, "every: expected a whole number of at least 1, got 0"),
        ({"every": 1.5}, "every: expected a whole number of at least 1, got 1.5"),
        ({"force": "20"}, "force: expected a positive number of newtons, at most 5000, got '20'"),
        ({"detection": None}, "detection: expected a probability between 0 and 1, got None"),
        ({"friction": "dry"}, "friction: expected a coefficient of at least 0, got 'dry'"),
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
@pytest.mark.parametrize("sensors", ["all", "torques"])
@pytest.mark.parametrize("noise", [Noise(0.05, 0.01, 0.3), Noise(1.0, 0.2, 3.0)])
def test_the_map_agrees_with_other_draws_of_the_noise(noise: Noise, sensors: str) -> None:
    found = compare(scene_of("ur5e", noise, sensors), Q, 20.0, 0.0, 150, np.random.default_rng(0), every=8)
    for ratio in (found.force_ratio, found.error_ratio):
        agreement = found.within(ratio)
        assert agreement is not None
        assert agreement >= 0.9
    assert found.share @ np.abs(found.link_difference) < 0.04
