"""Force line of the base sensor, link by the last loaded joint.

The oldest method and, with better sensors, the one used at DLR (Iskandar et al. 2021, 2024; Eberman &
Salisbury 1989 for the line of a hand's force): beyond the touched link no joint measures the contact, so the
link is the one after the last joint whose torque exceeds a threshold, and the contact lies where the line of
the force measured at the base enters that link's surface.
"""

from math import sqrt

import numpy as np

from contactsense import Scene
from contactsense.benchmarks.peers.method import Answers
from contactsense.benchmarks.peers.stage import Stage, build_stage, given, to_base, to_link, turned_to_link
from contactsense.kinematics.forward_kinematics import forward_kinematics
from contactsense.robots.jit.kernel import kernel
from contactsense.robots.surface.convex_primitives import Surfaces
from contactsense.robots.surface.union import nearest

THRESHOLD = 3.0
"""A joint counts as loaded above this many standard deviations of its torque."""
_TOLERANCE = 1e-6
"""Distance from the surface that counts as on it [m]."""
_MIN_STEP = 1e-5
"""Minimum step along the line [m]."""
_MAX_STEPS = 2000


class ForceLine:
    """Line of action of the base wrench, on the link given by the last loaded joint."""

    name = "force line, last loaded joint"

    def __init__(self, scene: Scene, threshold: float = THRESHOLD) -> None:
        """For a scene's arm with base sensor and joint torques."""
        self._stage = build_stage(scene)
        self._threshold = threshold

    def __call__(
        self, q: np.ndarray, base_wrench: np.ndarray | None, joint_torque: np.ndarray | None
    ) -> Answers:
        if base_wrench is None or joint_torque is None:
            raise ValueError("base_wrench, joint_torque: expected both sensors")
        n = len(q)
        answers = Answers(np.empty(n, dtype=np.int64), np.empty((n, 3)))
        measured = given(q, base_wrench, joint_torque)
        _run(self._stage, self._threshold, *measured, answers.link, answers.point_base)
        return answers


@kernel
def _run(
    stage: Stage,
    threshold: float,
    q: np.ndarray,
    base_wrench: np.ndarray,
    joint_torque: np.ndarray,
    link: np.ndarray,
    point_base: np.ndarray,
) -> None:
    motion, surfaces = stage.motion, stage.surfaces
    for i in range(q.shape[0]):
        forward_kinematics(stage.model, q[i], motion)
        touched = 0
        for j in range(q.shape[1]):
            if abs(joint_torque[i, j]) * stage.noise.torque[j] > threshold:
                touched = j + 1
        fx, fy, fz, mx, my, mz = base_wrench[i]
        ff = fx * fx + fy * fy + fz * fz
        link[i] = touched
        if not ff > 0.0:
            link[i] = -1
            point_base[i] = 0.0
            continue
        # Point of the line nearest to the base origin, then point and direction in the link's frame.
        x, y, z = to_link(
            motion, touched, (fy * mz - fz * my) / ff, (fz * mx - fx * mz) / ff, (fx * my - fy * mx) / ff
        )
        f = sqrt(ff)
        ux, uy, uz = turned_to_link(motion, touched, fx / f, fy / f, fz / f)
        x, y, z = enter(surfaces, touched, x, y, z, ux, uy, uz)[1:]
        point_base[i] = to_base(motion, touched, x, y, z)


@kernel
def enter(
    surfaces: Surfaces, link: int, x: float, y: float, z: float, ux: float, uy: float, uz: float
) -> tuple[float, float, float, float]:
    """Where a line first enters the union of a link's primitives.

    Args:
        surfaces: Packed primitives.
        link: Number of the link.
        x, y, z: Point of the line, link frame [m].
        ux, uy, uz: Its direction, a unit vector.

    Returns:
        Distance of the line from the surface, 0 if it enters [m], and the surface point where it enters, or
        otherwise the surface point nearest to it (3 floats), link frame.
    """
    first, last = surfaces.start[link], surfaces.start[link + 1]
    reach = 0.0
    for i in range(first, last):
        o = surfaces.origin[i]
        reach = max(reach, sqrt(o[0] * o[0] + o[1] * o[1] + o[2] * o[2]) + surfaces.radius[i])
    middle = -(x * ux + y * uy + z * uz)
    s = middle - 1.01 * reach
    gap, gx, gy, gz = np.inf, 0.0, 0.0, 0.0
    for _ in range(_MAX_STEPS):
        d, _, (px, py, pz), _ = nearest(surfaces, first, last, (x + s * ux, y + s * uy, z + s * uz))
        if d < _TOLERANCE:
            return 0.0, px, py, pz
        if d < gap:
            gap, gx, gy, gz = d, px, py, pz
        # No surface is nearer than that, so none is skipped.
        s += max(d, _MIN_STEP)
        if s > middle + 1.01 * reach:
            break
    return gap, gx, gy, gz
