"""What the sensors can tell of several contacts: rows and their rank."""

from typing import NamedTuple

import numpy as np
import pytest

from contactsense import Scene, WrenchSensor
from contactsense.arm import Arm, build_arm
from contactsense.memory import Memory, empty_memory
from contactsense.pipeline import rest
from contactsense.several.memory import Several, empty_several
from contactsense.several.rows import fill_rows, rank_of
from kinematics.core import move
from robots.primitives import Capsule
from robots.tool import Tool
from tests.plain_arm import plain_ur5e

Q = np.array([0.3, -1.1, 1.4, -0.7, 0.9, 0.2])
TOOL = Tool(name="tool", mass=0.5, primitives=(Capsule(a=(0, 0, 0.05), b=(0, 0, 0.15), radius=0.03),))


class Case(NamedTuple):
    arm: Arm
    memory: Memory
    several: Several


@pytest.fixture(scope="module")
def case() -> Case:
    scene = Scene(
        robot=plain_ur5e(),
        tool=TOOL,
        base_wrench=WrenchSensor(translation=(0.05, -0.1, -0.2)),
        wrist_wrench=WrenchSensor(force_noise=0.5, moment_noise=0.02),
    )
    arm = build_arm(scene)
    return Case(arm, empty_memory(arm), empty_several(arm))


def _fill(case: Case, *sensors: bool, lag: float = 0.0) -> int:
    arm, memory = case.arm, case.memory
    parts = (memory.base_wrench, memory.torque, memory.wrist_wrench)
    origin = memory.wrist_origin
    return int(
        fill_rows(
            arm.sensors, memory.motion, parts, arm.sensors.base_information, arm.sensors.torque_variance,
            origin, sensors, 1.0, lag, case.several.rows,
        )
    )  # fmt: skip


def _take(case: Case, wrenches: dict[int, np.ndarray]) -> None:
    """The exact measurement of wrenches on links."""
    zero = np.zeros(6)
    rest(case.arm, case.memory, Q, zero, zero, zero, True)
    total = sum(wrenches.values(), np.zeros(6))
    torque = np.zeros(6)
    for link, wrench in wrenches.items():
        torque[:link] -= case.memory.motion.screw[:link] @ wrench
    beyond = wrenches.get(7, np.zeros(6))
    rest(case.arm, case.memory, Q, torque, total, beyond, True)


@pytest.mark.parametrize("sensors", [(True, True, True), (True, False, False), (False, True, True)])
@pytest.mark.parametrize("links", [(2,), (0, 5), (3, 7), (1, 4, 7)])
def test_rows_times_wrenches_are_the_measurement(
    case: Case, sensors: tuple[bool, bool, bool], links: tuple[int, ...]
) -> None:
    chance = np.random.default_rng(sum(links))
    wrenches = {link: chance.standard_normal(6) * 10.0 for link in links}
    _take(case, wrenches)
    m = _fill(case, *sensors)
    assert m == 6 * sum(sensors)
    rows = case.several.rows
    explained = sum(rows.matrix[link, :m] @ wrench for link, wrench in wrenches.items())
    np.testing.assert_allclose(explained, rows.value[:m], atol=1e-9)


def test_noise_of_the_base_sensor_has_unit_variance_in_the_rows(case: Case) -> None:
    _take(case, {})
    _fill(case, True, False, False)
    U = case.several.rows.matrix[3, :6]
    np.testing.assert_allclose(U @ case.arm.sensors.base_covariance @ U.T, np.eye(6), atol=1e-9)


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
    """Base and torques tell 6 + (l - k) numbers of two contacts on links k <= l."""
    _take(case, {})
    m = _fill(case, *sensors)
    rows, scratch = case.several.rows, case.several.stack.jacobian
    assert rank_of(rows, m, np.array(links), len(links), scratch) == rank
    # Oracle: NumPy's singular values of the stacked map.
    stacked = np.hstack([rows.matrix[link, :m] for link in links])
    assert np.linalg.matrix_rank(stacked) == rank


@pytest.mark.parametrize("link", [1, 3, 6, 7])
def test_rows_of_a_moving_arm_lag_as_the_observers_do(case: Case, link: int) -> None:
    """A wrench at rest on a link of an arm in motion, low-passed by numbers, is what the rows make of it."""
    lag, qd = 0.016, np.array([1.0, -0.7, 0.9, 1.2, -0.8, 1.1])
    wrench = np.array([5.0, -20.0, 10.0, 1.0, 2.0, -3.0])
    body, model, motion = min(link, 6), case.arm.model, case.memory.motion
    ages = np.linspace(0.0, 12.0 * lag, 1201)
    base, torque, beyond = np.zeros((len(ages), 6)), np.zeros((len(ages), 6)), np.zeros((len(ages), 6))
    for i in range(len(ages) - 1, -1, -1):
        # The last is the newest: it leaves the motion as it is now.
        move(model, Q - qd * ages[i], qd, case.arm.gravity, motion)
        R, o = motion.rotation[body], motion.origin[body]
        force = R @ wrench[:3]
        now = np.concatenate((force, R @ wrench[3:] + np.cross(o, force)))
        base[i], torque[i, :body] = now, motion.screw[:body] @ now
        beyond[i] = now if link == 7 else 0.0
    weight = np.exp(-ages / lag) / lag
    parts = tuple(np.trapezoid(part * weight[:, None], ages, axis=0) for part in (base, torque, beyond))
    arm, memory, rows = case.arm, case.memory, case.several.rows
    sensors, origin = arm.sensors, motion.origin[6] + motion.rotation[6] @ [0, 0, 0.1]
    noise = sensors.base_information, sensors.torque_variance
    left = []
    for delay in (lag, 0.0):
        m = fill_rows(sensors, memory.motion, parts, *noise, origin, (True,) * 3, 1.0, delay, rows)
        left.append(np.abs(rows.matrix[link, :m] @ now - rows.value[:m]).max())
    assert left[0] < 0.06 * left[1], "what is left is of the second order of the lag"
