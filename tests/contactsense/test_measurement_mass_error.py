"""One measurement of an arm whose masses are wrong within their stated error."""

from dataclasses import replace

import numpy as np
import pytest

from contactsense import Localizer, Readings, Scene, WrenchSensor, forward_model
from contactsense.benchmarks.motion.model_error import heavier, with_drawn_masses
from contactsense.robots import Robot
from tests.contactsense.link_sensors.truth import SENSOR
from tests.plain_arm import plain_ur5e

pytestmark = pytest.mark.slow  # its kernels compile for long

ARM = plain_ur5e()
Q = np.array([0.3, -1.1, 1.3, -0.8, -1.2, 0.5])
PLACE, NO_FORCE, PUSH = np.array([-0.2, 0.04, 0.007]), np.zeros(3), np.array([0.0, 0.0, -25.0])
ERROR = 0.05
BASE = WrenchSensor(force_noise=0.25, moment_noise=0.05, translation=(0.02, -0.01, -0.1))
SCENE = Scene(robot=ARM, base_wrench=BASE, link_wrenches=(SENSOR,), inertia_error=ERROR)


def _readings(robot: Robot, force: np.ndarray = NO_FORCE) -> Readings:
    return forward_model(SCENE.model_copy(update={"robot": robot}), Q, "forearm", PLACE, force)


def _given(readings: Readings) -> dict[str, object]:
    return {
        "base_wrench": readings.base_wrench,
        "joint_torque": readings.joint_torque,
        "link_wrenches": readings.link_wrenches,
    }


@pytest.fixture(scope="module")
def localizer() -> Localizer:
    return Localizer(SCENE)


def test_the_covariances_are_those_of_the_masses(localizer: Localizer) -> None:
    """Against the readings of arms of which one link is heavier by one standard deviation."""
    exact, state = _readings(ARM), localizer._buffers.state
    localizer.locate(Q, **_given(exact), external=False)
    base, torque, link = np.zeros((6, 6)), np.zeros(6), np.zeros((6, 6))
    for k, part in enumerate(heavier(ARM, ERROR).links):
        links = (*ARM.links[:k], part, *ARM.links[k + 1 :])
        other = _readings(replace(ARM, links=links))
        change = other.base_wrench - exact.base_wrench
        base += np.outer(change, change)
        torque += (other.joint_torque - exact.joint_torque) ** 2
        change = other.link_wrenches["forearm"] - exact.link_wrenches["forearm"]
        link += np.outer(change, change)
    np.testing.assert_allclose(state.bias_filter.base_covariance, base, rtol=1e-9, atol=1e-12)
    np.testing.assert_allclose(state.bias_filter.torque_variance, torque, rtol=1e-9, atol=1e-12)
    np.testing.assert_allclose(state.link_mass_covariance[0], link, rtol=1e-9, atol=1e-12)
    assert base[2, 2] > 1.0
    # Who has subtracted the weight, has done so with masses that he knows.
    localizer.locate(Q, **_given(exact), external=True, detect=False)
    assert not state.bias_filter.base_covariance.any()
    assert not state.bias_filter.torque_variance.any()
    assert not state.link_mass_covariance.any()


@pytest.mark.parametrize(("told", "touched"), [(ERROR, False), (0.0, True)])
def test_a_heavier_arm_is_no_contact(told: float, touched: bool) -> None:
    localizer = Localizer(SCENE.model_copy(update={"inertia_error": told}))
    readings = _readings(heavier(ARM, ERROR))
    found = localizer.locate(Q, **_given(readings), external=False)
    assert (found.status != "none") is touched
    batch = localizer.locate_batch(
        Q[None], base_wrench=readings.base_wrench[None], joint_torque=readings.joint_torque[None],
        link_wrenches={"forearm": readings.link_wrenches["forearm"][None]}, external=False,
    )  # fmt: skip
    assert batch.detected[0] == touched


def test_a_push_beyond_it_is_found_as_surely_as_stated(localizer: Localizer) -> None:
    """The squared error of the place, in units of its covariance, over arms that are drawn as stated."""
    chance, squared, known = np.random.default_rng(4), [], 0
    true = localizer.locate(Q, **_given(_readings(ARM, PUSH)), external=False).contacts[0].point_base
    for seed in range(40):
        drawn = with_drawn_masses(SCENE, ERROR, seed).robot
        given = _given(_readings(drawn, PUSH))
        noise = np.repeat([BASE.force_noise, BASE.moment_noise], 3) * chance.standard_normal(6)
        given["base_wrench"] = np.asarray(given["base_wrench"]) + noise
        found = localizer.locate(Q, **given, external=False)
        assert found.contacts
        best = found.contacts[0]
        known += best.link == "forearm"
        if best.link == "forearm":
            error = best.point_base - true
            squared.append(error @ np.linalg.pinv(best.covariance, rcond=1e-3) @ error)
    assert known >= 36
    assert np.median(squared) < 3.0


def test_the_detectable_force_is_that_of_the_covariance(localizer: Localizer) -> None:
    exact, variance = _given(_readings(ARM)), 0.25**2
    detectable = [localizer.locate(Q, **exact, external=False).detectable]
    zero = {
        "base_wrench": np.zeros(6),
        "joint_torque": np.zeros(6),
        "link_wrenches": {"forearm": np.zeros(6)},
    }
    detectable.append(localizer.locate(Q, **zero, external=True).detectable)
    weight = ERROR * 9.81 * np.array([link.inertia.mass for link in ARM.links])
    expected = np.sqrt((variance + weight @ weight) / variance)
    assert detectable[0] / detectable[1] == pytest.approx(expected, rel=1e-6)
