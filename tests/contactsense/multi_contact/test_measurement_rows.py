"""The measurement rows of several contacts, and their rank."""

from typing import NamedTuple

import numpy as np
import pytest

from contactsense import Localizer, Scene, WrenchSensor
from contactsense.kinematics.decorrelation import decorrelate
from contactsense.kinematics.momenta import kinematics_and_momenta
from contactsense.multi_contact.measurement_rows import Variances, fill_measurement_rows, rank_of
from contactsense.multi_contact.memory.buffers import (
    Measurement,
    MultiContactBuffers,
    empty_multi_contact_buffers,
)
from contactsense.robots.primitives import Capsule
from contactsense.robots.tool import Tool
from contactsense.runtime.state import State
from contactsense.scene_model.constants import Constants
from tests.plain_arm import plain_ur5e

pytestmark = pytest.mark.slow  # its kernels compile for long

Q = np.array([0.3, -1.1, 1.4, -0.7, 0.9, 0.2])
TOOL = Tool(name="tool", mass=0.5, primitives=(Capsule(a=(0, 0, 0.05), b=(0, 0, 0.15), radius=0.03),))


class Case(NamedTuple):
    localizer: Localizer
    constants: Constants
    state: State
    buffers: MultiContactBuffers


@pytest.fixture(scope="module")
def case() -> Case:
    scene = Scene(
        robot=plain_ur5e(),
        tool=TOOL,
        base_wrench=WrenchSensor(translation=(0.05, -0.1, -0.2)),
        wrist_wrench=WrenchSensor(force_noise=0.5, moment_noise=0.02),
    )
    localizer = Localizer(scene)
    constants, state = localizer._buffers.constants, localizer._buffers.state
    return Case(localizer, constants, state, empty_multi_contact_buffers(constants))


def _fill(case: Case, *sensors: bool, lag: float = 0.0) -> int:
    constants, state = case.constants, case.state
    external = (state.base_wrench, state.torque, state.link_wrench)
    base, torque, link = sensors
    return int(
        fill_measurement_rows(
            constants.sensors, state.motion, external,
            Variances(
                constants.sensors.base_information, 1.0, constants.sensors.torque_variance,
                state.link_row, state.link_variance,
            ),
            (base, torque, int(link)), lag, case.buffers.rows,
        )
    )  # fmt: skip


def _take(case: Case, wrenches: dict[int, np.ndarray]) -> None:
    """Exact measurement of wrenches on links, as the localizer takes it."""
    zero = np.zeros(6)

    def take(base: np.ndarray, torque: np.ndarray, wrist: np.ndarray) -> None:
        case.localizer.locate(Q, base_wrench=base, joint_torque=torque, wrist_wrench=wrist, detect=False)

    take(zero, zero, zero)
    torque = np.zeros(6)
    for link, wrench in wrenches.items():
        torque[:link] -= case.state.motion.screw[:link] @ wrench
    take(sum(wrenches.values(), zero), torque, wrenches.get(7, zero))


@pytest.mark.parametrize("sensors", [(True, True, True), (True, False, False), (False, True, True)])
@pytest.mark.parametrize("links", [(2,), (0, 5), (3, 7), (1, 4, 7)])
def test_rows_times_wrenches_equal_the_measurement(
    case: Case, sensors: tuple[bool, bool, bool], links: tuple[int, ...]
) -> None:
    rng = np.random.default_rng(sum(links))
    wrenches = {link: rng.standard_normal(6) * 10.0 for link in links}
    _take(case, wrenches)
    m = _fill(case, *sensors)
    assert m == 6 * sum(sensors)
    rows = case.buffers.rows
    explained = sum(rows.matrix[link, :m] @ wrench for link, wrench in wrenches.items())
    np.testing.assert_allclose(explained, rows.value[:m], atol=1e-9)


def test_noise_of_the_base_sensor_has_unit_variance_in_the_rows(case: Case) -> None:
    _take(case, {})
    _fill(case, True, False, False)
    U = case.buffers.rows.matrix[3, :6]
    np.testing.assert_allclose(U @ case.constants.sensors.base_covariance @ U.T, np.eye(6), atol=1e-9)


@pytest.mark.parametrize(
    ("sensors", "links", "rank"),
    [
        ((True, True, False), (4,), 6),
        ((True, True, False), (2, 6), 10),
        ((True, True, False), (3, 4), 7),
        ((True, True, False), (3, 3), 6),
        ((True, True, False), (1, 3, 6), 11),
        ((True, False, False), (1, 6), 6),
        ((False, True, False), (2, 5), 5),
        ((False, True, False), (0, 0), 0),
        ((True, True, True), (3, 7), 12),
        ((True, False, True), (3, 7), 12),
        ((True, True, True), (7, 7), 6),
    ],
)
def test_rank(case: Case, sensors: tuple[bool, bool, bool], links: tuple[int, ...], rank: int) -> None:
    """Base sensor and torques give 6 + (l - k) independent measurements of two contacts on links k <= l."""
    _take(case, {})
    m = _fill(case, *sensors)
    rows, scratch = case.buffers.rows, case.buffers.rank.matrix
    assert rank_of(Measurement(rows, m), np.array(links), len(links), scratch) == rank
    # Oracle: NumPy's singular values of the stacked map.
    stacked = np.hstack([rows.matrix[link, :m] for link in links])
    assert np.linalg.matrix_rank(stacked) == rank


@pytest.mark.parametrize("link", [1, 3, 6, 7])
def test_rows_of_a_moving_arm_include_the_lag_of_the_observers(case: Case, link: int) -> None:
    """Rows of a constant wrench on a link of a moving arm, against numerical low-pass filtering."""
    lag, qd = 0.016, np.array([1.0, -0.7, 0.9, 1.2, -0.8, 1.1])
    wrench = np.array([5.0, -20.0, 10.0, 1.0, 2.0, -3.0])
    body, model, motion = min(link, 6), case.constants.model, case.state.motion
    ages = np.linspace(0.0, 12.0 * lag, 1201)
    base, torque, beyond = np.zeros((len(ages), 6)), np.zeros((len(ages), 6)), np.zeros((len(ages), 6))
    for i in range(len(ages) - 1, -1, -1):
        # The newest sample comes last, so that `motion` is the current one.
        kinematics_and_momenta(model, Q - qd * ages[i], qd, case.constants.gravity, motion)
        R, o = motion.rotation[body], motion.origin[body]
        force = R @ wrench[:3]
        current = np.concatenate((force, R @ wrench[3:] + np.cross(o, force)))
        base[i], torque[i, :body] = current, motion.screw[:body] @ current
        beyond[i] = current if link == 7 else 0.0
    weight = np.exp(-ages / lag) / lag
    base, torque, beyond = (
        np.trapezoid(values * weight[:, None], ages, axis=0) for values in (base, torque, beyond)
    )
    external = (base, torque, beyond[None])
    constants, state, rows = case.constants, case.state, case.buffers.rows
    sensors, origin = constants.sensors, motion.origin[6] + motion.rotation[6] @ [0, 0, 0.1]
    row, link_variance = np.zeros((1, 6, 6)), np.zeros((1, 6))
    decorrelate(origin, tuple(sensors.link_variance[0]), np.zeros((6, 6)), row[0], link_variance[0])
    noise = Variances(sensors.base_information, 1.0, sensors.torque_variance, row, link_variance)
    residual = []
    for delay in (lag, 0.0):
        m = fill_measurement_rows(sensors, state.motion, external, noise, (True, True, 1), delay, rows)
        residual.append(np.abs(rows.matrix[link, :m] @ current - rows.value[:m]).max())
    assert residual[0] < 0.06 * residual[1], "the residual is of second order in the lag"
