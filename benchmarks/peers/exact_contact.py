"""The paper's methods without refinement: wrench axis and closed form on each primitive.

Bicchi, Salisbury & Brock (1993) know the touched body. Here the link is unknown: the wrench is fused from
base sensor and joint torques under each link's hypothesis (`contactsense.isolation.link_hypotheses`), and the
most probable link with a contact is chosen. On that link: `contactsense.localization.intrinsic_contact`.
"""

import numpy as np

from contactsense import Scene
from contactsense.benchmarks.peers.method import Answers
from contactsense.benchmarks.peers.stage import Noise, Stage, build_stage, given, measure
from contactsense.kinematics.forward_kinematics import forward_kinematics
from contactsense.kinematics.model import Motion
from contactsense.localization.intrinsic_contact import contact_on_link
from contactsense.robots.jit.kernel import allocating_kernel
from contactsense.robots.vectors import add, rotate, vector
from contactsense.solvers.wrench import Wrench, in_frame


class ExactContact:
    """Wrench axis or closed form at the fused wrench."""

    def __init__(self, scene: Scene, closed_form: bool) -> None:
        """For a scene's arm, with torsion (`closed_form`) or without (wrench axis)."""
        self.name = "closed form, unrefined" if closed_form else "wrench axis, unrefined"
        if scene.base_wrench is None:
            raise ValueError("base_wrench: expected a base sensor, the scene has none")
        self._stage = build_stage(scene)
        self._closed_form = closed_form

    def __call__(
        self, q: np.ndarray, base_wrench: np.ndarray | None, joint_torque: np.ndarray | None
    ) -> Answers:
        n = len(q)
        answers = Answers(np.empty(n, dtype=np.int64), np.zeros((n, 3)))
        _run(self._stage, self._closed_form, *given(q, base_wrench, joint_torque), *answers[:2])
        return answers


@allocating_kernel
def _run(
    stage: Stage,
    closed_form: bool,
    q: np.ndarray,
    base_wrench: np.ndarray,
    joint_torque: np.ndarray,
    link: np.ndarray,
    point_base: np.ndarray,
) -> None:
    motion, surfaces, noise = stage.motion, stage.surfaces, stage.noise
    n = q.shape[1]
    links = len(surfaces.start) - 1
    b, L, h = np.empty(n + 6), np.empty((6, 6)), np.empty(6)
    wrench, cost = np.empty((links, 6)), np.empty(links)
    for i in range(q.shape[0]):
        forward_kinematics(stage.model, q[i], motion)
        measure(noise, joint_torque[i], base_wrench[i], b)
        _fuse(noise, motion, b, L, h, wrench, cost)
        link[i] = -1
        for _ in range(links):
            k = int(np.argmin(cost))
            R, origin = motion.rotation[k], vector(motion.origin[k])
            local = in_frame(Wrench(vector(wrench[k]), vector(wrench[k, 3:])), R, origin)
            primitive, point, _, _ = contact_on_link(surfaces, k, local, closed_form)
            if primitive >= 0:
                link[i], point_base[i] = k, add(origin, rotate(R, point))
                break
            cost[k] = np.inf


@allocating_kernel
def _fuse(
    noise: Noise,
    motion: Motion,
    b: np.ndarray,
    L: np.ndarray,
    h: np.ndarray,
    wrench: np.ndarray,
    cost: np.ndarray,
) -> None:
    """Least-squares wrench under each link's hypothesis, and -2 log evidence up to a constant.

    The evidence of a linear Gaussian model: squared residual plus the logarithm of the information's
    determinant.
    """
    n = motion.screw.shape[0]
    for i in range(6):
        h[i] = 0.0
        for k in range(6):
            L[i, k] = 0.0
    square = 0.0
    for r in range(6):
        square += b[n + r] * b[n + r]
        for i in range(6):
            h[i] += noise.base[r, i] * b[n + r]
            for k in range(6):
                L[i, k] += noise.base[r, i] * noise.base[r, k]
    for j in range(n):
        square += b[j] * b[j]
    for link in range(wrench.shape[0]):
        if 0 < link <= n:
            j = link - 1
            weight = noise.torque[j]
            for i in range(6):
                h[i] += weight * motion.screw[j, i] * b[j]
                for k in range(6):
                    L[i, k] += weight * weight * motion.screw[j, i] * motion.screw[j, k]
        w = np.linalg.solve(L, h)
        wrench[link] = w
        cost[link] = square - np.dot(h, w) + np.log(np.linalg.det(L))
