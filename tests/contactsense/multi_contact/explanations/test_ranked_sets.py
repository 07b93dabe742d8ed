"""What is stored of a set of contacts."""

import numpy as np
import pytest

from contactsense.multi_contact.explanations.stored_explanations import store_explanation
from contactsense.multi_contact.joint.contact_step import vector_of
from contactsense.multi_contact.joint.joint_covariance import covariance_of, fill_covariances
from contactsense.robots.jit.lanes import LANES
from contactsense.robots.surface.convex_primitives import curvature
from contactsense.solvers.posterior.contact_prior import Contact
from contactsense.solvers.posterior.friction_tails import with_friction_tails
from tests.contactsense.multi_contact.smooth_arm import empty_case, take

from contactsense.multi_contact.memory.joint_layout import (  # isort: skip
    BNX, BX, FRICTION_RATIO, FX, NX, OFFSET_STEP, PX, R00, SX, TILT, TORSION, TX,
)  # fmt: skip

pytestmark = pytest.mark.slow  # its kernels compile for long


def test_the_covariance_of_a_place_has_the_tails_of_the_friction() -> None:
    """As for a single contact."""
    case, widened = empty_case(), []
    surfaces, buffers = case.constants.surfaces, case.buffers
    joint, explanations = buffers.joint, buffers.explanations
    for _ in range(10):
        m = take(case, case.trials.draw(2, 20.0, "different"), 0.3, 2)
        case.steps.find_joint_modes(case.problem(m, 2), LANES)
        fill_covariances(2, joint)
        store_explanation(joint, 3, 2, 0.0, explanations, 0)
        for i, block in enumerate(joint.contact[:2]):
            point, normal, force, place, place_normal = (
                np.array(vector_of(block, quantity, 3)) for quantity in (PX, NX, FX, BX, BNX)
            )
            tangents = np.array([vector_of(block, quantity, 3) for quantity in (SX, TX)])
            rotation = np.array([block[R00 + k * LANES + 3] for k in range(9)]).reshape(3, 3)
            p = joint.primitive[i, 3]
            xx, xy, xz, yy, yz, zz = curvature(surfaces.kind[p], surfaces.size[p], *place, *place_normal)
            S = np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
            K = tangents @ rotation @ S @ rotation.T @ tangents.T
            laplace = [covariance_of(joint, 2 * i + a, 2 * i + b, 3) for a, b in ((0, 0), (1, 0), (1, 1))]
            torsion = float(block[TORSION + 3])
            contact = Contact(tuple(point), tuple(normal), tuple(force), torsion)
            v11, v12, v22 = with_friction_tails(
                tuple(laplace), (K[0, 0], K[0, 1], K[1, 1]), contact, float(block[FRICTION_RATIO + 3])
            )
            shift = block[TILT + 3] * torsion / (force @ normal)
            along = np.array([[v11, v12], [v12, v22]]) + shift**2 * np.eye(2)
            expected = tangents.T @ along @ tangents
            expected += block[OFFSET_STEP + 3] ** 2 * np.outer(normal, normal)
            np.testing.assert_allclose(explanations.covariance[0, i], expected, rtol=1e-6, atol=1e-12)
            widened.append(v11 * v22 - v12 * v12 > 1.05 * (laplace[0] * laplace[2] - laplace[1] ** 2))
    assert any(widened)
