"""Covariance of a stored contact against contacts on surfaces whose normal is drawn at random."""

import numpy as np
import pytest

from contactsense import Scene
from contactsense.localization.candidates.candidate_buffers import store_candidate
from contactsense.localization.surface.local_prior import MAX_TILT, TILT_LENGTH, SurfaceError, tilt_in_cell
from contactsense.localization.surface.primitive_frames import Frame
from contactsense.robots.vectors import tangents
from contactsense.runtime.state import empty_state
from contactsense.scene_model.constants import build_constants
from contactsense.solvers.posterior.contact_prior import Contact
from contactsense.solvers.posterior.mode import Mode


@pytest.mark.parametrize("torsion", [0.0, 0.08, -0.3])
@pytest.mark.parametrize("tilt", [0.01, 0.1])
def test_a_tilted_normal_moves_the_point_by_the_torsion_over_the_force(torsion: float, tilt: float) -> None:
    normal, force = np.array([0.6, 0.0, 0.8]), 20.0
    t1, t2 = (np.array(t) for t in tangents(tuple(normal)))
    d = tilt * np.random.default_rng(3).standard_normal((20000, 2))
    tilted = normal + d[:, :1] * t1 + d[:, 1:] * t2
    tilted /= np.linalg.norm(tilted, axis=1, keepdims=True)
    # The torsion is about the tilted normal. About the assumed one, the same wrench is that of another point,
    # c' with (c' - c) x f = xi (n' - n).
    f = -force * normal
    moved = np.cross(f, torsion * (tilted - normal)) / force**2
    sampled = moved.T @ moved / len(moved)

    candidates = empty_state(build_constants(Scene(robot="ur5e"))).candidates
    contact = Contact((0.0, 0.0, 0.0), tuple(normal), tuple(f), torsion)
    mode = Mode(0.0, 0.0, contact, (0.0, 0.0, 0.0), (tuple(t1), tuple(t2)))
    store_candidate(candidates, 0, 0, Frame(np.eye(3), np.zeros(3)), mode, SurfaceError(0.0, tilt, 1.0))
    np.testing.assert_allclose(candidates.covariance[0], sampled, atol=0.05 * (tilt * torsion / force) ** 2)


def test_the_tilt_is_that_of_the_cell_and_follows_from_the_offset_without_one() -> None:
    scene = build_constants(Scene(robot="ur3e"))
    cells, prior = scene.deviations, scene.prior
    for i in range(len(cells.tilt)):
        assert tilt_in_cell(prior, cells, i) == cells.tilt[i]
    for offset, expected in ((0.0007, 0.0007 / TILT_LENGTH), (0.004, MAX_TILT)):
        assert tilt_in_cell(prior._replace(surface_deviation=offset), cells, -1) == pytest.approx(expected)
