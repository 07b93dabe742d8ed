"""A broad known place, divided into a mixture of narrower ones, against sampled places."""

import numpy as np
import pytest

from contactsense.multi_contact.explanations.stored_explanations import store_explanation
from contactsense.multi_contact.joint.joint_covariance import fill_covariances
from contactsense.multi_contact.joint.joint_problem import JointProblem
from contactsense.multi_contact.joint.known_rows import Known, KnownRows
from contactsense.multi_contact.memory.buffers import (
    Measurement,
    MultiContactBuffers,
    empty_multi_contact_buffers,
)
from contactsense.robots.primitives import Box, Primitive
from contactsense.robots.vectors import Vector
from contactsense.scene import Scene
from contactsense.scene_model.constants import Constants, build_constants
from tests.contactsense.localization.placed_arm import placed
from tests.contactsense.multi_contact.joint_steps import JointSteps
from tests.plain_arm import plain_ur5e_on

pytestmark = pytest.mark.slow  # its kernels compile for long

DEVIATION = 0.015
"""Standard deviation of the known place along the surface [m]."""


class _Known:
    """A known contact on the base of an arm that has a surface of its own there; nothing is measured."""

    def __init__(
        self, shapes: tuple[Primitive, ...], point: Vector, spread: Vector = (1.0, 1.0, 0.0)
    ) -> None:
        self.constants: Constants = build_constants(Scene(robot=plain_ur5e_on(shapes)))
        self.buffers: MultiContactBuffers = empty_multi_contact_buffers(self.constants)
        _, self.surface = placed(self.constants, np.zeros(6))
        known = self.buffers.known
        known.primitive[0], known.point[0], known.force[0] = 0, point, (0.0, 0.0, -20.0)
        known.covariance[0] = DEVIATION**2 * np.diag(spread)

    def place(self, drift: float = np.inf) -> np.ndarray:
        """The only explanation's covariance of the place after it has been divided, shape (3, 3) [m^2]."""
        constants, buffers, joint = self.constants, self.buffers, self.buffers.joint
        known, steps = Known(1, drift, measured=True), JointSteps(self.surface, buffers)
        measurement = Measurement(buffers.rows, 0)
        problem = JointProblem(constants.surfaces, constants.prior, measurement, KnownRows(0, 0), 1)
        steps.known_evidence(problem._replace(known=steps.fill_known_prior(problem, known)))
        fill_covariances(1, joint)
        store_explanation(joint, 0, 1, 0.0, buffers.explanations, 0)
        steps.divide_known_places(problem, known, 1)
        return np.array(buffers.explanations.covariance[0, 0])


def test_a_place_on_a_plane_remains_as_uncertain_as_stated() -> None:
    wide = Box(center=(0.3, 0.3, 0.05), half=(0.15, 0.15, 0.05), rounding=0.002)
    covariance = _Known((wide,), (0.3, 0.3, 0.1)).place()
    along = DEVIATION**2 * np.eye(2)
    np.testing.assert_allclose(covariance[:2, :2], along, rtol=0.02, atol=1e-6)


@pytest.mark.parametrize("spread", [(1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0)])
def test_a_place_may_be_uncertain_in_one_direction_only(spread: Vector) -> None:
    wide = Box(center=(0.3, 0.3, 0.05), half=(0.15, 0.15, 0.05), rounding=0.002)
    covariance = _Known((wide,), (0.3, 0.3, 0.1), spread).place()
    along = DEVIATION**2 * np.diag(spread[:2])
    np.testing.assert_allclose(covariance[:2, :2], along, rtol=0.02, atol=1e-6)


def test_a_place_near_an_edge_may_be_on_the_next_primitive() -> None:
    """Beyond a step of 4 mm the surface is that of another primitive: the place is on both, and as far from
    the plane as that."""
    step, away = 0.004, 0.008
    high = Box(center=(0.2, 0.3, 0.05), half=(0.1, 0.15, 0.05), rounding=0.001)
    low = Box(center=(0.4, 0.3, 0.05 - 0.5 * step), half=(0.1, 0.15, 0.05 - 0.5 * step), rounding=0.001)
    covariance = _Known((high, low), (0.3 - away, 0.3, 0.1)).place()
    x = DEVIATION * np.random.default_rng(0).standard_normal(100_000)
    height = np.where(x < away, 0.0, -step)
    assert covariance[0, 0] == pytest.approx(np.mean(x * x), rel=0.1)
    assert covariance[2, 2] == pytest.approx(np.mean(height**2), rel=0.2)
    assert covariance[0, 2] == pytest.approx(np.mean(x * height), rel=0.2)


@pytest.mark.parametrize("drift", [0.5, np.inf])
def test_a_place_that_may_be_on_the_far_side_is_on_both_sides(drift: float) -> None:
    """A plate as thick as the standard deviation along the normal. Along that the place is more uncertain
    than the surface that is nearest to places drawn as stated, and less than stated."""
    thick = 0.02
    plate = Box(center=(0.3, 0.3, 0.3), half=(0.15, 0.15, 0.5 * thick), rounding=0.001)
    spread = (1.0, 1.0, (thick / DEVIATION) ** 2)
    covariance = _Known((plate,), (0.3, 0.3, 0.3 + 0.5 * thick), spread).place(drift)
    height = np.where(thick * np.random.default_rng(0).standard_normal(100_000) < -0.5 * thick, -thick, 0.0)
    assert np.mean(height**2) < covariance[2, 2] < thick**2
    np.testing.assert_allclose(covariance[:2, :2], DEVIATION**2 * np.eye(2), rtol=0.05, atol=1e-6)
