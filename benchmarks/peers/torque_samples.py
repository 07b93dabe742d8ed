"""Contacts from joint torques alone: the residual of a small QP at each sample of the arm's surface.

After Pang, Umenberger & Tedrake (ICRA 2021): it finds all places on the surface and forces within friction
that explain the torques. Often there are many, far apart: a residual of zero does not mean that a place is
correct. The one with the smallest residual is the answer. Joints distal to the link count, with a torque of
zero.
"""

import numpy as np

from contactsense import Scene
from contactsense.benchmarks.peers.method import Answers
from contactsense.benchmarks.peers.single import add_contact, new_problem, solve_contacts
from contactsense.benchmarks.peers.skin_table import Table, spread
from contactsense.benchmarks.peers.stage import Stage, build_stage, given, measure, to_base
from contactsense.kinematics.forward_kinematics import forward_kinematics
from contactsense.robots.jit.kernel import allocating_kernel

SPACING = 0.008
"""Distance between neighbouring samples [m]."""


class TorqueSamples:
    """The QP at all samples of the surface."""

    name = "torque QP on samples"

    def __init__(self, scene: Scene, spacing: float = SPACING) -> None:
        """Sample the surface of the arm of a scene that has joint torques only."""
        if scene.base_wrench is not None:
            raise ValueError("base_wrench: expected a scene of joint torques alone")
        self._stage = build_stage(scene)
        self._table = spread(self._stage.surfaces, spacing)

    def __call__(
        self, q: np.ndarray, base_wrench: np.ndarray | None, joint_torque: np.ndarray | None
    ) -> Answers:
        q, _, joint_torque = given(q, base_wrench, joint_torque)
        n = len(q)
        answers = Answers(np.empty(n, dtype=np.int64), np.zeros((n, 3)))
        for i in range(n):
            answers.link[i] = _search(self._stage, self._table, q[i], joint_torque[i], answers.point_base[i])
        return answers


@allocating_kernel
def _search(
    stage: Stage, table: Table, q: np.ndarray, joint_torque: np.ndarray, point_base: np.ndarray
) -> int:
    """Link of the sample with the least squared residual; fills its place (3,), base frame."""
    forward_kinematics(stage.model, q, stage.motion)
    m = q.shape[0] + 6
    problem = new_problem(1, m)
    measure(stage.noise, joint_torque, np.zeros(6), problem.b)
    square = 0.0
    for i in range(m):
        square += problem.b[i] * problem.b[i]
    least, best = np.inf, 0
    for i in range(table.link.shape[0]):
        link, point = table.link[i], table.point[i]
        add_contact(stage, link, point, table.normal[i], 0, problem)
        cost = solve_contacts(problem, square, 1)
        if cost < least:
            least, best = cost, link
            point_base[0], point_base[1], point_base[2] = to_base(
                stage.motion, link, point[0], point[1], point[2]
            )
    return best
