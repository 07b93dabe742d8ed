"""Contacts from joint torques alone: the residual of a small QP at each sample of the arm's surface.

After Pang, Umenberger & Tedrake (ICRA 2021): it finds all places on the surface and forces within friction
that explain the torques. Often there are many, far apart: a residual of zero does not mean that a place is
correct. All are reported as candidates; the one with the smallest residual is the answer. Joints distal to
the link count, with a torque of zero.
"""

from typing import NamedTuple

import numpy as np

from contactsense import Scene
from contactsense.benchmarks.peers.method import Answers
from contactsense.benchmarks.peers.single import add_contact, force_of, new_problem, solve_contacts
from contactsense.benchmarks.peers.skin_table import Table, spread
from contactsense.benchmarks.peers.stage import Stage, build_stage, given, measure, to_base
from contactsense.kinematics.forward_kinematics import forward_kinematics
from contactsense.robots.jit.kernel import allocating_kernel

SPACING = 0.008
"""Distance between neighbouring samples [m]."""
MAX_EXCESS = 9.0
"""Candidates exceed the lowest squared residual by at most this, in units of the noise: 3 sigma."""
MIN_SEPARATION = 0.05
"""Candidates on one link within this distance count as one [m]."""


class Candidates(NamedTuple):
    """Points that explain one measurement about equally well, best first, base frame."""

    link: np.ndarray
    """Shape (C,), int64."""
    point_base: np.ndarray
    """Shape (C, 3) [m]."""
    residual: np.ndarray
    """Root of the squared residual in units of the noise, shape (C,)."""


class TorqueSamples:
    """The QP at all samples of the surface."""

    name = "torque QP on samples"

    def __init__(self, scene: Scene, spacing: float = SPACING) -> None:
        """Sample the surface of the arm of a scene that has joint torques only."""
        if scene.base_wrench is not None:
            raise ValueError("base_wrench: expected a scene of joint torques alone")
        self._stage = build_stage(scene)
        self.table = spread(self._stage.surfaces, spacing)

    def __call__(
        self, q: np.ndarray, base_wrench: np.ndarray | None, joint_torque: np.ndarray | None
    ) -> Answers:
        q, _, joint_torque = given(q, base_wrench, joint_torque)
        n = len(q)
        answers = Answers(np.empty(n, dtype=np.int64), np.empty((n, 3)), np.empty((n, 3)))
        cost = np.empty(len(self.table.link))
        for i in range(n):
            best = _search(self._stage, self.table, q[i], joint_torque[i], cost)
            answers.link[i], answers.point_base[i], answers.force_base[i] = best[0], best[1:4], best[4:7]
        return answers

    def candidates(self, q: np.ndarray, joint_torque: np.ndarray) -> Candidates:
        """All places that explain one measurement, `q` and `joint_torque` of shape (n,)."""
        cost = np.empty(len(self.table.link))
        (q,), _, (torque,) = given(np.array([q]), None, np.array([joint_torque]))
        _search(self._stage, self.table, q, torque, cost)
        motion = self._stage.motion
        link = self.table.link
        point = np.einsum("nij,nj->ni", motion.rotation[link], self.table.point) + motion.origin[link]
        kept: list[int] = []
        for i in np.argsort(cost, kind="stable"):
            if cost[i] > cost.min() + MAX_EXCESS:
                break
            if all(link[i] != link[k] or np.linalg.norm(point[i] - point[k]) > MIN_SEPARATION for k in kept):
                kept.append(int(i))
        return Candidates(link[kept], point[kept], np.sqrt(cost[kept]))


@allocating_kernel
def _search(
    stage: Stage, table: Table, q: np.ndarray, joint_torque: np.ndarray, cost: np.ndarray
) -> np.ndarray:
    """Squared residual at each sample, into `cost` (M,); the best one's link, place and force, base axes."""
    forward_kinematics(stage.model, q, stage.motion)
    m = q.shape[0] + 6
    problem = new_problem(1, m)
    best = np.zeros(7)
    measure(stage.noise, joint_torque, np.zeros(6), problem.b)
    square = 0.0
    for i in range(m):
        square += problem.b[i] * problem.b[i]
    least = np.inf
    force = np.empty(3)
    for i in range(table.link.shape[0]):
        link, point = table.link[i], table.point[i]
        add_contact(stage, link, point, table.normal[i], 0, problem)
        cost[i] = solve_contacts(problem, square, 1)
        if cost[i] < least:
            least = cost[i]
            force_of(problem, 0, force)
            best[0] = link
            best[1], best[2], best[3] = to_base(stage.motion, link, point[0], point[1], point[2])
            best[4:7] = force
    return best
