"""Log evidence of a known contact before the measurement."""

import numpy as np
import pytest

from contactsense import Scene
from contactsense.multi_contact.joint.joint_problem import JointProblem
from contactsense.multi_contact.joint.known_rows import Known, KnownRows
from contactsense.multi_contact.memory.buffers import Measurement, empty_multi_contact_buffers
from contactsense.robots.primitives import Sphere
from contactsense.scene_model.constants import Constants, build_constants
from tests.contactsense.localization.placed_arm import placed
from tests.contactsense.multi_contact.joint_steps import JointSteps
from tests.plain_arm import plain_ur5e_on

pytestmark = pytest.mark.slow  # its kernels compile for long

RADIUS = 0.09
CENTER = np.array([0.0, 0.0, 0.05])
NORMAL = np.array([0.0, 0.6, 0.8])


def _constants() -> tuple[Constants, JointSteps]:
    """An arm whose base is a sphere."""
    robot = plain_ur5e_on((Sphere(center=(0.0, 0.0, 0.05), radius=RADIUS),))
    constants = build_constants(Scene(robot=robot))
    _, surface = placed(constants, np.zeros(6))
    return constants, JointSteps(surface, empty_multi_contact_buffers(constants))


def log_known(covariance: np.ndarray, force: np.ndarray, drift: float) -> float:
    """Log evidence of one contact on the sphere before any measurement of a stream, and the prior's area."""
    constants, steps = _constants()
    prior, contact = constants.prior, steps.buffers.known
    problem = JointProblem(constants.surfaces, prior, Measurement(steps.buffers.rows, 0), KnownRows(0, 0), 1)
    contact.primitive[0] = 0
    contact.point[0], contact.force[0] = CENTER + RADIUS * NORMAL, force
    contact.covariance[0] = covariance
    rows = steps.fill_known_prior(problem, Known(1, drift, measured=False))
    return steps.known_evidence(problem._replace(known=rows)) + float(np.log(prior.area))


@pytest.mark.parametrize("sigma", [0.003, 0.006])
def test_the_evidence_of_a_known_point_is_its_share_of_the_area(sigma: float) -> None:
    """The prior probability of a known point is its share of the area."""
    log_evidence = log_known(sigma**2 * np.eye(3), -20.0 * NORMAL, np.inf)
    assert log_evidence == pytest.approx(np.log(2.0 * np.pi * sigma**2), abs=0.02)


def test_the_evidence_of_a_known_force_agrees_with_monte_carlo() -> None:
    """Against Monte Carlo integration of the prior times the likelihood of the force."""
    prior = _constants()[0].prior
    tangent = np.cross(NORMAL, (1.0, 0.0, 0.0))
    force, drift = -25.0 * NORMAL + 2.0 * tangent, 0.5
    without, known = (log_known(1e-6 * np.eye(3), force, width) for width in (np.inf, drift))
    rng = np.random.default_rng(0)
    draws = force + drift * rng.standard_normal((200_000, 3))
    normal_force = -draws @ NORMAL
    squared_ratio = ((draws**2).sum(axis=1) - normal_force**2) / (prior.friction_ratio * normal_force) ** 2
    log_density = -0.5 * np.log(normal_force / prior.force) ** 2 - 3.0 * np.log1p(squared_ratio / 4.0)
    log_density -= np.log(normal_force**3 * prior.friction_ratio**2)
    expected = np.log(np.mean(np.exp(log_density))) + 3.0 * np.log(drift)
    assert known - without == pytest.approx(expected, abs=0.05)


def test_a_grazing_known_force_has_less_evidence_than_a_normal_one() -> None:
    """The normal at an uncertain known point may not fit the known force: the contact then moves to where
    it does."""
    force, broad = 20.0 * np.cross(NORMAL, (1.0, 0.0, 0.0)) - 2.0 * NORMAL, 0.05**2 * np.eye(3)
    grazing, square = log_known(broad, force, 0.5), log_known(broad, -20.0 * NORMAL, 0.5)
    assert square - 8.0 < grazing < square
