"""How noise and instants of the velocities enter the covariances of the residuals and of their averages."""

import numpy as np
import pytest

from contactsense import Scene
from contactsense.residuals.wrench_velocity_error import noise_share_in_average
from contactsense.robots.jit.kernel import kernel
from contactsense.runtime.buffers import Buffers, KernelBuffers, buffer_views
from contactsense.runtime.no_contact_hypothesis import update_bias_filter, update_covariances
from contactsense.runtime.state import empty_state
from contactsense.runtime.stream_restart import restart_state
from contactsense.scene_model.constants import build_constants
from tests.contactsense.link_sensors.truth import ARM, BASE, SENSOR, TORQUE
from tests.kinematics.test_decorrelation import decorrelated

SCENE = Scene(robot=ARM, base_wrench=BASE, joint_torque=TORQUE, link_wrenches=(SENSOR,))
NEWEST = 0.06


@kernel
def _update(buffers: Buffers, variance_ratio: float) -> None:
    constants, state = buffer_views(buffers)
    update_covariances(constants, state, variance_ratio)


@kernel
def _learn(buffers: Buffers) -> None:
    constants, state = buffer_views(buffers)
    update_bias_filter(constants, state, True, False, NEWEST)


@pytest.fixture
def buffers() -> KernelBuffers:
    """Of a moving arm, with any biases and any errors of the two sensors."""
    constants = build_constants(SCENE)
    found, chance = KernelBuffers(constants, empty_state(constants)), np.random.default_rng(0)
    state = found.state
    of_links = state.link_velocity_error
    state.stream.clock[0].variance_ratio, state.noise_scale.noise[0].scale = NEWEST, 1.5
    state.link_origin[:] = 0.3, -0.2, 0.5
    of_base, biases = state.base_velocity_error, state.bias_filter.base_covariance
    masses = state.link_mass_covariance[0]
    places = (biases, masses, of_base.noise, of_base.instants, of_links.noise[0], of_links.instants[0])
    for place in places:
        root = chance.standard_normal((6, 6))
        place[:] = root @ root.T
    return found


@pytest.mark.parametrize("ratio", [NEWEST, 0.01, 0.001])
def test_they_are_those_of_the_average(buffers: KernelBuffers, ratio: float) -> None:
    """What decays as the residual does has the share of low-passed noise, white noise less."""
    constants, state = buffers.constants, buffers.state
    _update(buffers.arguments, ratio)
    share = ratio / NEWEST
    of_noise = noise_share_in_average(share, constants.bandwidth)
    assert of_noise == 1.0 if ratio == NEWEST else of_noise < 0.5 * share
    error, biases = state.base_velocity_error, state.bias_filter.base_covariance
    sensor = 1.5 * constants.sensors.base_covariance
    expected = ratio * sensor + of_noise * error.noise + share * error.instants + biases
    np.testing.assert_allclose(ratio * state.base_covariance, expected, rtol=1e-9)
    np.testing.assert_allclose(state.base_information, np.linalg.inv(state.base_covariance), rtol=1e-6)
    # That of which `tracking` makes averages.
    whole = sensor + (error.noise + error.instants) / NEWEST
    np.testing.assert_allclose(state.base_noise, whole, rtol=1e-9)
    links = state.link_velocity_error
    model = of_noise * links.noise[0] + share * links.instants[0] + state.link_mass_covariance[0]
    sensor = ratio * constants.sensors.link_variance[0]
    rows, variances = decorrelated(state.link_origin[0], (sensor[0], sensor[1]), model)
    np.testing.assert_allclose(state.link_row[0], rows, rtol=1e-9)
    np.testing.assert_allclose(state.link_variance[0], variances, rtol=1e-9)


@pytest.mark.parametrize("part", ["noise", "instants"])
def test_each_of_the_two_alone_is_in_the_inverse(buffers: KernelBuffers, part: str) -> None:
    state = buffers.state
    state.noise_scale.noise[0].scale, state.bias_filter.base_covariance[:] = 1.0, 0.0
    for name in {"noise", "instants"} - {part}:
        getattr(state.base_velocity_error, name)[:] = 0.0
    _update(buffers.arguments, NEWEST)
    np.testing.assert_allclose(state.base_information, np.linalg.inv(state.base_covariance), rtol=1e-6)


@pytest.mark.parametrize("part", ["noise", "instants"])
def test_biases_are_not_learnt_from_what_velocities_do(part: str) -> None:
    learnt = []
    for variance in (0.0, 1e6):
        constants = build_constants(SCENE)
        buffers = KernelBuffers(constants, empty_state(constants))
        state = buffers.state
        restart_state(SCENE, buffers.constants, state)
        status = state.bias_filter.status[0]
        status.time_since_update, status.time_since_contact = 1e3, 1e3
        state.bias_filter.covariance[:] = np.eye(len(state.bias_filter.covariance))
        state.base_wrench[:] = 1.0
        getattr(state.base_velocity_error, part)[:] = variance * np.eye(6)
        state.stream.clock[0].variance_ratio = NEWEST
        _update(buffers.arguments, NEWEST)
        _learn(buffers.arguments)
        assert status.time_since_update == 0.0
        learnt.append(np.abs(state.bias_filter.bias[:6]).max())
    assert learnt[0] > 0.5
    assert learnt[1] < 1e-4
