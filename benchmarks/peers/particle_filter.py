"""Contact particle filter after Manuelli & Tedrake (IROS 2016), for one contact.

50 particles on the surface of the arm. Each round moves them at random along the surface, weights each by how
well the best force within friction at its place explains the measurement (a small QP), and resamples by those
weights. The answer is the place with the largest weight in the last round.
"""

import numpy as np

from contactsense import Scene
from contactsense.benchmarks.peers.method import Answers
from contactsense.benchmarks.peers.single import (
    add_contact,
    new_problem,
    resample,
    solve_contacts,
)
from contactsense.benchmarks.peers.skin_table import Table, scattered
from contactsense.benchmarks.peers.stage import Stage, build_stage, given, measure, to_base
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
        self._seed = seed
        self._table = scattered(self._stage.surfaces, _DENSITY, seed)

    def __call__(
        self, q: np.ndarray, base_wrench: np.ndarray | None, joint_torque: np.ndarray | None
    ) -> Answers:
        n = len(q)
        answers = Answers(np.empty(n, dtype=np.int64), np.empty((n, 3)))
        _run(
            np.random.default_rng(self._seed), self._stage, self._table,
            *given(q, base_wrench, joint_torque), *answers[:2],
        )  # fmt: skip
        return answers


@allocating_kernel
def _run(
    rng: np.random.Generator,
    stage: Stage,
    table: Table,
    q: np.ndarray,
    base_wrench: np.ndarray,
    joint_torque: np.ndarray,
    link: np.ndarray,
    point_base: np.ndarray,
) -> None:
    m = q.shape[1] + 6
    motion, problem = stage.motion, new_problem(1, m)
    on, new_on = np.empty(PARTICLES, dtype=np.int64), np.empty(PARTICLES, dtype=np.int64)
    at, new_at = np.empty((PARTICLES, 3)), np.empty((PARTICLES, 3))
    out, new_out = np.empty((PARTICLES, 3)), np.empty((PARTICLES, 3))
    cost, chosen = np.empty(PARTICLES), np.empty(PARTICLES, dtype=np.int64)
    for i in range(q.shape[0]):
        forward_kinematics(stage.model, q[i], motion)
        measure(stage.noise, joint_torque[i], base_wrench[i], problem.b)
        square = 0.0
        for r in range(m):
            square += problem.b[r] * problem.b[r]
        for k in range(PARTICLES):
            start = rng.integers(0, table.link.shape[0])
            on[k], at[k], out[k] = table.link[start], table.point[start], table.normal[start]
        least = np.inf
        for turn in range(ROUNDS):
            least = np.inf
            for k in range(PARTICLES):
                new_on[k] = walk(rng, stage, STEP, on[k], at[k], out[k], new_at[k], new_out[k])
                add_contact(stage, new_on[k], new_at[k], new_out[k], 0, problem)
                cost[k] = solve_contacts(problem, square, 1)
                if cost[k] < least:
                    least = cost[k]
                    if turn == ROUNDS - 1:
                        link[i] = new_on[k]
                        point_base[i] = to_base(motion, new_on[k], new_at[k, 0], new_at[k, 1], new_at[k, 2])
            resample(rng, cost, chosen)
            for k in range(PARTICLES):
                on[k], at[k], out[k] = new_on[chosen[k]], new_at[chosen[k]], new_out[chosen[k]]
