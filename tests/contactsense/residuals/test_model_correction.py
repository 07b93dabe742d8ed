"""A corrected model leaves the observers as if they had known it from the start."""

import numpy as np
import pytest

from contactsense import JointTorqueSensor, robots
from contactsense.kinematics.model import Model, build_model, empty_motion
from contactsense.kinematics.momenta import kinematics_and_momenta
from contactsense.residuals.bias_filter import BiasFilter, predict, restart
from contactsense.residuals.equations_of_motion import (
    advance_base,
    advance_torques,
    observe_wrench,
    observe_wrench_difference,
)
from contactsense.residuals.joint_friction import joint_torque_model
from contactsense.residuals.model_correction import MIN_RELATIVE_CHANGE, apply_correction
from contactsense.residuals.momentum_observer import MomentumObserver
from contactsense.residuals.observers import Observers, start_steps
from contactsense.robots import Inertia
from contactsense.robots.jit.flat_buffers import zeros
from contactsense.robots.tool import join_inertia
from contactsense.sensors.settings import Friction
from tests.contactsense.residuals.test_filter_covariance import phi

N, FIRST_BODY = 6, 4
"""Joints; first link that the link sensor carries."""
SIZE = 9 + 3 * N
"""Number of estimates."""
PAYLOAD, PLACE = 1.5, np.array([0.02, -0.03, 0.1])
"""Mass of the payload [kg] and its place in the last link's frame [m]."""
BANDWIDTH, DT = 10.0, 0.004
GRAVITY = np.array([0.5, -1.0, -9.7])
Q, QD = np.array([0.2, -1.1, 1.3, -0.8, -1.2, 0.5]), np.array([0.5, -0.3, 0.8, -0.6, 1.0, -0.9])
"""They stay as they are, as nothing else is needed for a constant friction: the observers settle."""
BASE_NOISE, TORQUE_NOISE = 0.01 * np.eye(6), np.full(N, 0.02)


def only(groups: MomentumObserver) -> MomentumObserver:
    """The observer of the only link sensor."""
    return MomentumObserver(*(array[0] for array in groups))


class Arm:
    """An arm and its observers."""

    def __init__(self, speed: float) -> None:
        self.qd = speed * QD
        arrays = build_model(robots.load("ur5e"))
        self.model = Model(*(np.array(array) for array in arrays))
        self.drive = joint_torque_model(JointTorqueSensor(friction=Friction(coulomb=3.0, error=0.2)), N)
        self.observers = zeros(Observers, joints=N, link_sensors=1)
        self.filter = zeros(BiasFilter, joints=N)
        restart(self.filter, 0.05, np.zeros(6), self.drive.friction_error)
        self.bare = Inertia(float(self.model.mass[N]), self.model.com[N].copy(), self.model.inertia[N].copy())
        self.filter.status[0].payload_mass, self.filter.gravity[:] = PAYLOAD, GRAVITY
        self.load(PLACE)
        self.motion, self.spread = empty_motion(N), np.zeros(N)
        chance = np.random.default_rng(0)
        self.torque, self.wrench, self.link = (10.0 * chance.standard_normal(6) for _ in range(3))
        self.samples = 0

    def load(self, place: np.ndarray) -> None:
        """Put the payload there."""
        self.filter.payload_place[:] = place
        last = join_inertia(self.bare, Inertia(PAYLOAD, place, np.zeros((3, 3))))
        self.model.mass[N], self.model.com[N], self.model.inertia[N] = last.mass, last.com, last.tensor

    def know(self, correction: np.ndarray) -> None:
        """Correct the model alone."""
        self.filter.bias[:] = correction[:6]
        self.drive.bias[:] += correction[6:12]
        self.drive.friction_factor[:] *= 1.0 + correction[12:18]
        self.load(PLACE + correction[24:])
        self.model.mass[1:] *= 1.0 + correction[18:24]
        self.model.inertia[1:] *= (1.0 + correction[18:24])[:, None, None]
        self.filter.status[0].payload_mass *= 1.0 + correction[23]

    def step(self, count: int) -> None:
        for _ in range(count):
            dt = DT if self.samples else 0.0
            self.samples += 1
            kinematics_and_momenta(self.model, Q, self.qd, GRAVITY, self.motion)
            found, time = self.observers, (dt, BANDWIDTH)
            wrench = self.wrench - self.filter.bias
            load = self.motion.momentum[FIRST_BODY], self.motion.gravity[FIRST_BODY]
            of_base, of_joints, of_difference = start_steps(found, np.full(3, dt), BANDWIDTH)
            advance_base(self.motion, wrench, of_base, found.base)
            advance_torques(
                self.model, self.drive, self.motion, (self.qd, self.torque, wrench), (dt, dt),
                (of_joints, of_difference), found, self.spread, self.filter.friction_regressor,
            )  # fmt: skip
            observe_wrench(*load, self.link, *time, only(found.links))
            difference = only(found.link_difference)
            observe_wrench_difference(self.motion, *load, self.link, wrench, *time, difference)
            predict(self.filter, self.drive, self.motion, BASE_NOISE, TORQUE_NOISE, 0.1, dt, DT, BANDWIDTH)

    def correct(self, correction: np.ndarray) -> None:
        self.filter.correction[:] = correction
        first = np.array([FIRST_BODY], dtype=np.int64)
        apply_correction(self.filter, self.model, self.drive, self.motion, BANDWIDTH, self.observers, first)

    def residuals(self) -> np.ndarray:
        return np.concatenate([np.ravel(group.residual) for group in self.observers])


@pytest.mark.slow
@pytest.mark.parametrize(
    ("part", "speed"),
    [
        (slice(0, 6), 1.0),
        (slice(6, 12), 1.0),
        (slice(12, 18), 1.0),
        (slice(18, 24), 0.0),
        (slice(24, 27), 0.0),
        (slice(24), 0.0),
    ],
)
def test_the_residuals_are_those_of_the_corrected_model(part: slice, speed: float) -> None:
    """Biases of base wrench or torques, friction, masses, the payload's place, and all but that, which is
    multiplied with its mass. With masses the arm is at rest: what they add is low-passed in each link's
    frame, which turns, and carried over as it is."""
    correction = np.zeros(SIZE)
    correction[part] = np.random.default_rng(1).uniform(-0.4, 0.6, SIZE)[part]
    corrected, known = Arm(speed), Arm(speed)
    corrected.step(800)
    before = corrected.residuals()
    corrected.correct(correction)
    known.know(correction)
    known.step(800)
    np.testing.assert_allclose(corrected.model.inertia, known.model.inertia, atol=1e-12)
    np.testing.assert_allclose(corrected.residuals(), known.residuals(), atol=1e-8)
    assert np.abs(corrected.residuals() - before).max() > 0.1
    for _ in range(5):
        corrected.step(1)
        known.step(1)
        np.testing.assert_allclose(corrected.residuals(), known.residuals(), atol=1e-8)


@pytest.mark.slow
def test_what_an_error_of_a_mass_does_is_that_of_the_corrected_mass() -> None:
    """In motion: a link's momentum jumps with its mass, but what it adds to the residuals must not."""
    correction = np.zeros(SIZE)
    correction[18:24] = 0.3, -0.2, 0.1, 0.4, -0.3, 0.2
    corrected, known = Arm(1.0), Arm(1.0)
    corrected.step(800)
    corrected.correct(correction)
    known.know(correction)
    known.step(800)
    for _ in range(5):
        expected = known.filter.mass_regressor.residual
        assert np.abs(expected).max() > 10.0
        np.testing.assert_allclose(corrected.filter.mass_regressor.residual, expected, atol=1e-9)
        corrected.step(1)
        known.step(1)


@pytest.mark.slow
def test_a_correction_leaves_what_is_not_known_as_it_is() -> None:
    """The covariance of the residuals is that before, and so is that with the mass of the link without its
    payload, which no correction changes: they are the same numbers in other units."""
    arm, correction = Arm(1.0), np.random.default_rng(2).uniform(-0.4, 0.6, SIZE)
    arm.step(400)
    spread = np.random.default_rng(3).standard_normal(2 * (SIZE,))
    arm.filter.covariance[:] = 1e-3 * spread @ spread.T
    arm.filter.bare_covariance[:] = spread[0]
    before = phi(arm.filter) @ arm.filter.covariance @ phi(arm.filter).T
    with_bare = phi(arm.filter) @ spread[0]
    arm.correct(correction)
    after = phi(arm.filter) @ arm.filter.covariance @ phi(arm.filter).T
    np.testing.assert_allclose(after, before, rtol=1e-9, atol=1e-12)
    np.testing.assert_allclose(phi(arm.filter) @ arm.filter.bare_covariance, with_bare, rtol=1e-9)
    assert np.abs(before).max() > 1.0


@pytest.mark.slow
def test_no_mass_and_no_friction_falls_below_half_at_once() -> None:
    arm = Arm(1.0)
    mass = arm.model.mass.copy()
    arm.step(2)
    arm.correct(np.concatenate((np.zeros(12), np.full(6, -0.9), np.full(6, -3.0), np.zeros(3))))
    np.testing.assert_allclose(arm.model.mass[1:], (1.0 + MIN_RELATIVE_CHANGE) * mass[1:])
    np.testing.assert_allclose(arm.drive.friction_factor, 1.0 + MIN_RELATIVE_CHANGE)
    assert MIN_RELATIVE_CHANGE == -0.5
