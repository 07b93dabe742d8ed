"""Components of a broad known place, against a general optimizer and known contacts in their own right."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
import pytest
from scipy.optimize import minimize

from contactsense.multi_contact.joint.contact_step import set_contact, vector_of
from contactsense.multi_contact.joint.known_rows import Known
from contactsense.multi_contact.known_contacts.known_components import COMPONENT_WIDTH, COMPONENTS
from contactsense.multi_contact.memory.buffers import KNOWN_NUMBERS
from contactsense.multi_contact.memory.joint_layout import NX, OFFSET_STEP, PX, SX, TX
from contactsense.robots.jit.lanes import LANES
from contactsense.solvers.posterior.contact_prior import STUDENT_DOF, Prior
from tests.contactsense.multi_contact.smooth_arm import Case, draw_known, empty_case

pytestmark = pytest.mark.slow  # its kernels compile for long

ALONG, ACROSS = 0.02, 0.01
"""Standard deviations of the known place along the surface and along its normal [m]."""
HELD = 0.5
"""Drift of held forces [N]."""


@pytest.fixture(scope="module")
def case() -> Case:
    return empty_case()


def _know(case: Case, count: int) -> int:
    """Contacts that are known broadly, and their measurement. Number of rows."""
    _, m = draw_known(case, count)
    for i in range(count):
        s, t, n = (np.array(vector_of(case.buffers.joint.contact[i], axis, 0)) for axis in (SX, TX, NX))
        along = np.outer(s, s) + np.outer(t, t)
        case.buffers.known.covariance[i] = ALONG**2 * along + ACROSS**2 * np.outer(n, n)
    return m


def _means(case: Case, count: int) -> np.ndarray:
    """Point, force, torsion and offset of each known contact in each lane, shape (count, 8, LANES)."""
    return case.buffers.joint.known_mean[:count].reshape(count, KNOWN_NUMBERS, LANES).copy()


def test_the_components_have_the_mean_and_covariance_of_a_standard_normal_distribution() -> None:
    assert COMPONENTS.shape == (LANES, 3)
    np.testing.assert_allclose(COMPONENTS.mean(axis=0), 0.0, atol=1e-12)
    second = COMPONENTS.T @ COMPONENTS / LANES + COMPONENT_WIDTH**2 * np.eye(3)
    np.testing.assert_allclose(second, np.eye(3), atol=1e-12)


def _wrench(x: np.ndarray, point: np.ndarray, normal: np.ndarray) -> np.ndarray:
    """Of a contact with the unknowns x: force, torsion and offset."""
    moment = np.cross(point + x[4] * normal, x[:3]) + x[3] * normal
    return np.concatenate((x[:3], moment))


class _Fixed(NamedTuple):
    """A contact at a fixed place."""

    rows: np.ndarray
    """Rows of the measurement by its wrench, shape (m, 6)."""
    point: np.ndarray
    normal: np.ndarray
    deviation: float
    """Standard deviation of its offset [m]."""


def _energy(x: np.ndarray, prior: Prior, y: np.ndarray, contacts: Sequence[_Fixed]) -> float:
    """Energy of the contacts with the measurement y; five unknowns of each."""
    total = 0.0
    for c, own in zip(contacts, x.reshape(-1, 5), strict=True):
        F = -c.normal @ own[:3]
        if F <= 0.0:
            return np.inf
        ratio = np.linalg.norm(own[:3] + F * c.normal) / (prior.friction_ratio * F)
        y = y - c.rows @ _wrench(own, c.point, c.normal)
        total += 0.5 * np.log(F / prior.force) ** 2 + 0.5 * (own[4] / c.deviation) ** 2
        total += 0.5 * (STUDENT_DOF + 2.0) * np.log(1.0 + ratio**2 / STUDENT_DOF)
        total += 0.5 * (own[3] / (prior.torsion_lever * F)) ** 2
    return float(total + 0.5 * y @ y)


@pytest.mark.parametrize("count", [1, 2])
def test_forces_are_those_which_the_earlier_sample_measured_there(case: Case, count: int) -> None:
    """The sample that the stated contacts predict, with the places given, is solved by a general
    optimizer."""
    prior, rows, joint = case.constants.prior, case.buffers.rows, case.buffers.joint
    scale = np.tile((1.0, 1.0, 1.0, 0.01, 0.001), count)
    for _ in range(2):
        m = _know(case, count)
        known = case.buffers.known
        A = [rows.matrix[case.constants.surfaces.link[p], :m] for p in known.primitive[:count]]
        y = np.zeros(m)
        for i in range(count):
            stated = np.array([*known.force[i], known.torsion[i], 0.0])
            y += A[i] @ _wrench(stated, known.point[i], np.array(vector_of(joint.contact[i], NX, 0)))
        held = Known(count, HELD, measured=True)
        case.steps.fill_component_priors(case.problem(m, count), held, 0)
        means = _means(case, count)
        for lane in range(0, LANES, 3):
            contacts = []
            for i in range(count):
                point, block = means[i, :3, lane], joint.contact[i]
                set_contact(case.surface, prior, joint, lane, i, known.primitive[i], tuple(point), (0, 0, 0))
                np.testing.assert_allclose(vector_of(block, PX, lane), point, atol=1e-9)
                normal = np.array(vector_of(block, NX, lane))
                contacts.append(_Fixed(A[i], point, normal, block[OFFSET_STEP + lane]))
            found = means[:, 3:, lane].ravel()
            least = minimize(
                lambda x, *given: _energy(x * scale, *given), found / scale, (prior, y, contacts),
                method="Powell", tol=1e-10,
            )  # fmt: skip
            assert _energy(found, prior, y, contacts) == pytest.approx(float(least.fun), abs=0.05)


@pytest.mark.parametrize("drift", [HELD, np.inf])
@pytest.mark.parametrize("count", [1, 2])
def test_a_component_is_a_known_contact_in_its_own_right(case: Case, count: int, drift: float) -> None:
    buffers = case.buffers
    known = Known(count, drift, measured=True)
    problem = case.problem(_know(case, count), count)
    found = case.steps.fill_component_priors(problem, known, 0)
    means = _means(case, count)
    in_lanes = buffers.joint.known_rows[:count].reshape(count, -1, KNOWN_NUMBERS, LANES)[:, : found.rows]
    in_lanes, covariance = in_lanes.copy(), buffers.known_prior.place_covariance[:count].copy()
    for lane in range(LANES):
        for i in range(count):
            buffers.known.point[i], buffers.known.covariance[i] = means[i, :3, lane], covariance[i]
            if np.isfinite(drift):
                buffers.known.force[i], buffers.known.torsion[i] = means[i, 3:6, lane], means[i, 6, lane]
        stated = case.steps.fill_known_prior(problem, known)
        assert stated == found
        expected = buffers.joint.known_rows[:count].reshape(count, -1, KNOWN_NUMBERS, LANES)
        expected = expected[:, : stated.rows, :, 0]
        largest = np.abs(expected).max(axis=(0, 1))[None, None]
        np.testing.assert_allclose(
            in_lanes[..., lane] / np.maximum(largest, 1e-9), expected / np.maximum(largest, 1e-9), atol=0.01
        )
