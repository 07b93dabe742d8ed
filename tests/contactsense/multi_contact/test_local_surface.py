"""Contacts of a set are on the surface of their cells: where the real one is on average, and how far it may
be from that."""

import numpy as np
import pytest

from contactsense import Scene
from contactsense.multi_contact.explanations.stored_explanations import store_explanation
from contactsense.multi_contact.joint.contact_step import move_to_cells, set_contact, vector_of
from contactsense.multi_contact.memory.buffers import empty_multi_contact_buffers
from contactsense.multi_contact.memory.joint_layout import (
    ENERGY,
    FRICTION_RATIO,
    FX,
    NX,
    OFFSET_STEP,
    PX,
    TILT,
    TORSION,
)
from contactsense.robots.jit.lanes import LANES
from contactsense.robots.surface.convex_primitives import project
from contactsense.scene_model.constants import build_constants
from tests.contactsense.localization.placed_arm import placed

pytestmark = pytest.mark.slow  # its kernels compile for long

LANE = 3


@pytest.mark.parametrize("detail", ["fine", "coarse"])
def test_a_contact_begins_on_the_mean_surface_with_the_deviations_of_its_cell(detail: str) -> None:
    """Against the samples of the mean surface, which are moved when the constants are built."""
    constants = build_constants(Scene(robot="ur5e", detail=detail))
    joint = empty_multi_contact_buffers(constants).joint
    surfaces, cells, prior = constants.surfaces, constants.deviations, constants.prior
    (state, surface), block = placed(constants, np.full(6, 0.3)), joint.contact[0]
    owner = np.repeat(np.arange(len(surfaces.kind)), np.diff(constants.samples.start))
    on_it, looked_at = 0, range(0, len(owner), 7)
    for s in looked_at:
        p = int(owner[s])
        body = constants.sensors.depth[surfaces.link[p]]
        R, o = state.motion.rotation[body], state.motion.origin[body]
        point, normal = R @ constants.samples.point[s] + o, R @ constants.samples.normal[s]
        set_contact(surface, prior, joint, LANE, 0, p, tuple(point), (0.0, 0.0, 0.0))
        below = surfaces.rotation[p].T @ (constants.samples.point[s] - surfaces.origin[p])
        below = np.array(project(surfaces.kind[p], surfaces.size[p], *below)[1:4])
        first = cells.start[p]
        near = np.linalg.norm(cells.point[first : cells.start[p + 1]] - below, axis=1)
        offset, friction, tilt = 1.0, 0.0, block[TILT + LANE]
        if len(near):
            cell = first + int(near.argmin())
            offset, friction, tilt = cells.ratio[cell], cells.tilt[cell], cells.tilt[cell]
        assert block[OFFSET_STEP + LANE] == pytest.approx(prior.surface_deviation * offset)
        assert block[FRICTION_RATIO + LANE] == pytest.approx(np.hypot(prior.friction_ratio, friction))
        assert block[TILT + LANE] == pytest.approx(tilt)
        if np.linalg.norm(np.subtract(vector_of(block, PX, LANE), point)) < 1e-6:
            on_it += 1
            np.testing.assert_allclose(vector_of(block, NX, LANE), normal, atol=1e-6)
    # Where the surface is moved along itself, the place below a sample may be in the next cell.
    assert on_it > (0.99 if detail == "fine" else 0.8) * len(looked_at)


def _surface(block: np.ndarray) -> list[float]:
    """Place, normal and deviations in the lane."""
    place = [*vector_of(block, PX, LANE), *vector_of(block, NX, LANE)]
    return [*place, *(float(block[quantity + LANE]) for quantity in (FRICTION_RATIO, OFFSET_STEP, TILT))]


def test_a_contact_that_has_left_its_cell_is_set_to_the_surface_of_the_one_it_is_in() -> None:
    constants = build_constants(Scene(robot="ur5e", detail="coarse"))
    joint = empty_multi_contact_buffers(constants).joint
    cells, prior, p = constants.deviations, constants.prior, int(constants.surfaces.start[2])
    (state, surface), block = placed(constants, np.full(6, 0.3)), joint.contact[0]
    R, o = state.frames.rotation[p], state.frames.origin[p]
    near, far = (R @ cells.point[i] + o for i in (cells.start[p], cells.start[p + 1] - 1))
    joint.lane[ENERGY] = np.inf
    joint.lane[ENERGY, LANE] = 0.0
    set_contact(surface, prior, joint, LANE, 0, p, tuple(near), (0.0, 0.0, 0.0))
    assert not move_to_cells(surface, prior, 0, 1, LANE + 1, joint)
    force = -20.0 * np.array(vector_of(block, NX, LANE))
    for k in range(3):
        block[PX + k * LANES + LANE], block[FX + k * LANES + LANE] = far[k], force[k]
    block[TORSION + LANE] = 0.1
    assert move_to_cells(surface, prior, 0, 1, LANE + 1, joint)
    there = _surface(block)
    assert block[TORSION + LANE] == 0.1
    set_contact(surface, prior, joint, LANE, 0, p, tuple(far), tuple(force))
    assert there == _surface(block)


def test_a_tilt_of_the_surface_makes_the_place_of_a_torsion_uncertain() -> None:
    """The torsion xi turned by the tilt d is a moment xi d, which a force F explains by a step xi d / F."""
    constants = build_constants(Scene(robot="ur5e"))
    buffers = empty_multi_contact_buffers(constants)
    _, surface = placed(constants, np.full(6, 0.3))
    joint, explanations = buffers.joint, buffers.explanations
    set_contact(surface, constants.prior, joint, LANE, 0, 0, (0.1, 0.1, 0.1), (0.0, 0.0, 0.0))
    block = joint.contact[0]
    n = np.array(vector_of(block, NX, LANE))
    set_contact(surface, constants.prior, joint, LANE, 0, 0, (0.1, 0.1, 0.1), tuple(-20.0 * n))
    block[TORSION + LANE], block[TILT + LANE], block[OFFSET_STEP + LANE] = 0.1, 0.3, 1e-3
    joint.covariance[:] = 0.0
    store_explanation(joint, LANE, 1, 0.0, explanations, 0)
    expected = (0.3 * 0.1 / 20.0) ** 2 * (np.eye(3) - np.outer(n, n)) + 1e-6 * np.outer(n, n)
    np.testing.assert_allclose(explanations.covariance[0, 0], expected, atol=1e-12)
