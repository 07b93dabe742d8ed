"""A cell is given up at first sight where no force brings the moment about it near enough, and where it would
have to be pulled."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from contactsense.glance import PULL, STRONGEST, glance
from contactsense.lanes import LANES, LENGTH, NX, OUT, SPREAD, X

LEVER = 0.003


def _block(point: np.ndarray, normal: np.ndarray, spread: np.ndarray) -> np.ndarray:
    lanes = np.zeros(LENGTH)
    for i in range(3):
        lanes[X + i * LANES : X + (i + 1) * LANES] = point[:, i]
        lanes[NX + i * LANES : NX + (i + 1) * LANES] = normal[:, i]
    lanes[SPREAD : SPREAD + LANES] = spread
    return lanes


def _out(lanes: np.ndarray) -> np.ndarray:
    return lanes[OUT : OUT + LANES] > 0.0


@pytest.mark.parametrize("seed", range(20))
def test_the_energy_of_the_moment_about_a_place_decides(seed: int) -> None:
    chance = np.random.default_rng(seed)
    root = chance.normal(size=(6, 6))
    P, w, o = root @ root.T, chance.normal(size=6), chance.normal(size=3)
    R = Rotation.from_rotvec(chance.normal(size=3)).as_matrix()
    point, spread = chance.normal(size=(LANES, 3)), chance.uniform(0.01, 1.0, LANES)
    # Normals against the force: no cell is given up as pulled.
    normal = np.tile(-R.T @ w[:3] / np.linalg.norm(w[:3]), (LANES, 1))
    ff, loose = float(w[:3] @ w[:3]), float(np.trace(P[:3, :3]))
    room = (np.sqrt(ff) + STRONGEST * np.sqrt(loose)) ** 2
    energy = np.empty(LANES)
    for j in range(LANES):
        x, y, z = R @ point[j] + o
        about = np.hstack((-np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]]), np.eye(3)))
        C = about @ P @ about.T + room * (spread[j] ** 2 + LEVER**2) * np.eye(3)
        energy[j] = 0.5 * about @ w @ np.linalg.solve(C, about @ w)
    for limit in energy:
        lanes = _block(point, normal, spread)
        glance(w, P, R, o, ff, loose, LEVER, limit * (1.0 + 1e-6), lanes)
        np.testing.assert_array_equal(_out(lanes), energy > limit * (1.0 + 1e-6))


def test_a_pull_is_given_up() -> None:
    w = np.array([0.0, 0.0, 2.0, 0.0, 0.0, 0.0])
    lean = np.linspace(0.0, 3.0, LANES)
    normal = np.column_stack((np.sin(lean), np.zeros(LANES), np.cos(lean)))
    lanes = _block(np.zeros((LANES, 3)), normal, np.full(LANES, 0.01))
    glance(w, 1e-4 * np.eye(6), np.eye(3), np.zeros(3), 4.0, 3e-4, LEVER, np.inf, lanes)
    np.testing.assert_array_equal(_out(lanes), np.cos(lean) > PULL)
