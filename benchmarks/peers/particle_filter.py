"""Contact particle filter after Manuelli & Tedrake (IROS 2016), for one contact.

50 particles on the surface of the arm. Each round moves them at random along the surface, weights each by how
well the best force within friction at its place explains the measurement (a small QP), and resamples by those
weights. The answer is the place with the largest weight in the last round.
"""

import numpy as np

from contactsense import Scene
from contactsense.benchmarks.peers.friction import EDGES, solve
from contactsense.benchmarks.peers.method import Answers
from contactsense.benchmarks.peers.single import add_contact, force_of, resample
from contactsense.benchmarks.peers.skin_table import scattered
from contactsense.benchmarks.peers.stage import build_stage, given, measure, to_base
from contactsense.benchmarks.peers.walk import walk
from contactsense.kinematics.forward_kinematics import forward_kinematics
from contactsense.robots.jit.kernel import allocating_kernel

PARTICLES = 50
ROUNDS = 50
"""Number of rounds for one constant measurement, in place of the filter's sampling rate."""
STEP = 0.05
"""Standard deviation of a particle's step [m]."""
LEAST_TORQUE = 0.3
"""Minimum noise assumed for joint torques [Nm]: with a sharper likelihood, 50 particles are too few. The
paper's values for step and noise are not known to us; these are the best of nine tried on the UR5e."""
LEAST_MOMENT = 0.1
"""The same for the moment at the base [Nm]."""
_DENSITY = 4000.0
"""Density of random starting places [1/m^2]."""


class ParticleFilter:
    """The filter, restarted for each measurement."""

    def __init__(self, scene: Scene, seed: int = 0) -> None:
        """For a scene's arm. A base sensor, if the scene has one, adds six rows to the QP; the paper has
        none."""
        self.name = "particle filter" if scene.base_wrench is None else "particle filter with base wrench"
        self._stage = build_stage(scene, LEAST_TORQUE, LEAST_MOMENT)
        self._friction = scene.friction
        self._seed = seed
        self._table = scattered(self._stage.surfaces, _DENSITY, seed)

    def __call__(
        self, q: np.ndarray, base_wrench: np.ndarray | None, joint_torque: np.ndarray | None
    ) -> Answers:
        n = len(q)
        answers = Answers(np.empty(n, dtype=np.int64), np.empty((n, 3)), np.empty((n, 3)))
        _run(
            self._stage, self._friction, *self._table[:3], *given(q, base_wrench, joint_torque),
            np.random.default_rng(self._seed), PARTICLES, ROUNDS, STEP, *answers[:3],
        )  # fmt: skip
        return answers


@allocating_kernel
def _run(  # type: ignore[no-untyped-def]
    stage, friction, points, normals, links, q, base_wrench, joint_torque,
    rng, particles, rounds, step, link, point_base, force_base,
):  # fmt: skip
    m = q.shape[1] + 6
    motion = stage.motion
    b, rows, directions = np.empty(m), np.empty((m, 3)), np.empty((EDGES, 3))
    A, G, h = np.empty((EDGES, m)), np.empty((EDGES, EDGES)), np.empty(EDGES)
    x, L, s = np.empty(EDGES), np.empty((EDGES, EDGES)), np.empty(EDGES)
    order = np.empty(EDGES, dtype=np.int64)
    on, new_on = np.empty(particles, dtype=np.int64), np.empty(particles, dtype=np.int64)
    at, new_at = np.empty((particles, 3)), np.empty((particles, 3))
    out, new_out = np.empty((particles, 3)), np.empty((particles, 3))
    cost, chosen = np.empty(particles), np.empty(particles, dtype=np.int64)
    for i in range(q.shape[0]):
        forward_kinematics(stage.model, q[i], motion)
        measure(stage.noise, joint_torque[i], base_wrench[i], b)
        square = 0.0
        for r in range(m):
            square += b[r] * b[r]
        for k in range(particles):
            start = rng.integers(0, points.shape[0])
            on[k], at[k], out[k] = links[start], points[start], normals[start]
        least = np.inf
        for turn in range(rounds):
            least = np.inf
            for k in range(particles):
                new_on[k] = walk(rng, stage, step, on[k], at[k], out[k], new_at[k], new_out[k])
                add_contact(
                    stage.noise, motion, friction, new_on[k], new_at[k], new_out[k],
                    b, 0, A, G, h, directions, rows,
                )  # fmt: skip
                cost[k] = solve(G, h, square, EDGES, x, L, s, order)
                if cost[k] < least:
                    least = cost[k]
                    if turn == rounds - 1:
                        link[i] = new_on[k]
                        point_base[i] = to_base(motion, new_on[k], new_at[k, 0], new_at[k, 1], new_at[k, 2])
                        force_of(directions, x, 0, force_base[i])
            resample(rng, cost, chosen)
            for k in range(particles):
                on[k], at[k], out[k] = new_on[chosen[k]], new_at[chosen[k]], new_out[chosen[k]]
