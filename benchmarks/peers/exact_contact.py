"""The paper's methods without refinement: wrench axis and closed form on each primitive.

Bicchi, Salisbury & Brock (1993) know the touched body. Here the link is unknown: the wrench is fused from
base sensor and joint torques under each link's hypothesis (theory, section 3), and the most probable link
with a contact is chosen. On a link with several primitives, the contact must be outside the other ones. Of
several contacts, the one with the least torsion relative to its normal force is chosen; for the wrench axis,
the one that it enters first.
"""

from math import sqrt

import numpy as np

from contactsense import Scene
from contactsense.benchmarks.peers.method import Answers
from contactsense.benchmarks.peers.stage import build_stage, given, measure, to_base, turned_to_link
from contactsense.kinematics.forward_kinematics import forward_kinematics
from contactsense.robots.jit.kernel import allocating_kernel, kernel
from contactsense.robots.surface.convex_primitives import ELLIPSOID, REVOLVED
from contactsense.robots.surface.union import nearest
from contactsense.solvers.packed_primitive import solve_primitive
from contactsense.solvers.solution import OK
from contactsense.solvers.wrench_axis import (
    wrench_axis_box,
    wrench_axis_ellipsoid,
    wrench_axis_revolved,
)

_MAX_DEPTH = 1e-6
"""A contact deeper inside another primitive of its link is rejected [m]."""


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
        answers = Answers(np.empty(n, dtype=np.int64), np.zeros((n, 3)), np.zeros((n, 3)))
        _run(self._stage, self._closed_form, *given(q, base_wrench, joint_torque), *answers[:3])
        return answers


@allocating_kernel
def _run(stage, closed_form, q, base_wrench, joint_torque, link, point_base, force_base):  # type: ignore[no-untyped-def]
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
            k = np.argmin(cost)
            found, x, y, z = _on_link(motion, surfaces, closed_form, k, wrench[k])
            if found:
                link[i], point_base[i], force_base[i] = k, to_base(motion, k, x, y, z), wrench[k, :3]
                break
            cost[k] = np.inf


@allocating_kernel
def _fuse(noise, motion, b, L, h, wrench, cost):  # type: ignore[no-untyped-def]
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


@kernel
def _on_link(motion, surfaces, closed_form, link, wrench):  # type: ignore[no-untyped-def]
    """Contact of a wrench (base frame) on one link: whether there is one, and its point, link frame."""
    ox, oy, oz = to_base(motion, link, 0.0, 0.0, 0.0)
    fx, fy, fz = turned_to_link(motion, link, wrench[0], wrench[1], wrench[2])
    mx, my, mz = turned_to_link(
        motion,
        link,
        wrench[3] - (oy * wrench[2] - oz * wrench[1]),
        wrench[4] - (oz * wrench[0] - ox * wrench[2]),
        wrench[5] - (ox * wrench[1] - oy * wrench[0]),
    )
    first, last = surfaces.start[link], surfaces.start[link + 1]
    least, found = np.inf, False
    bx, by, bz = 0.0, 0.0, 0.0
    f = sqrt(fx * fx + fy * fy + fz * fz)
    for p in range(first, last):
        status, x, y, z, nx, ny, nz, xi = _on_primitive(surfaces, closed_form, p, fx, fy, fz, mx, my, mz)
        push = -(fx * nx + fy * ny + fz * nz)
        if status != OK or push <= 0.0:
            continue
        d, _, _, _, _, _, _, _ = nearest(
            surfaces.kind, surfaces.rotation, surfaces.origin, surfaces.size, surfaces.radius,
            first, last, x, y, z,
        )  # fmt: skip
        if d < -_MAX_DEPTH:
            continue
        # The entry of the wrench axis farthest back along the force, or the least torsion relative to the
        # force.
        order = abs(xi) / push if closed_form else (fx * x + fy * y + fz * z) / f
        if order < least:
            least, found = order, True
            bx, by, bz = x, y, z
    return found, bx, by, bz


@kernel
def _on_primitive(surfaces, closed_form, p, fx, fy, fz, mx, my, mz):  # type: ignore[no-untyped-def]
    """Contact on one primitive: status, point, normal, torsion, link frame."""
    R, o, size, kind = surfaces.rotation[p], surfaces.origin[p], surfaces.size[p], surfaces.kind[p]
    tx, ty, tz = (
        mx - (o[1] * fz - o[2] * fy),
        my - (o[2] * fx - o[0] * fz),
        mz - (o[0] * fy - o[1] * fx),
    )
    gx, gy, gz = _rotate_transposed(R, fx, fy, fz)
    lx, ly, lz = _rotate_transposed(R, tx, ty, tz)
    if closed_form:
        status, x, y, z, nx, ny, nz, xi, _, _ = solve_primitive(kind, size, gx, gy, gz, lx, ly, lz)
    elif kind == REVOLVED:
        status, x, y, z, nx, ny, nz, xi, _, _ = wrench_axis_revolved(
            gx, gy, gz, lx, ly, lz, size[0], size[1], size[2], size[3]
        )
    elif kind == ELLIPSOID:
        status, x, y, z, nx, ny, nz, xi, _, _ = wrench_axis_ellipsoid(
            gx, gy, gz, lx, ly, lz, size[0], size[1], size[2]
        )
    else:
        status, x, y, z, nx, ny, nz, xi, _, _ = wrench_axis_box(
            gx, gy, gz, lx, ly, lz, size[0], size[1], size[2], size[3]
        )
    px, py, pz = _rotate(R, x, y, z)
    nx, ny, nz = _rotate(R, nx, ny, nz)
    return status, px + o[0], py + o[1], pz + o[2], nx, ny, nz, xi


@kernel
def _rotate_transposed(R, x, y, z):  # type: ignore[no-untyped-def]
    """R^T v."""
    return (
        R[0, 0] * x + R[1, 0] * y + R[2, 0] * z,
        R[0, 1] * x + R[1, 1] * y + R[2, 1] * z,
        R[0, 2] * x + R[1, 2] * y + R[2, 2] * z,
    )


@kernel
def _rotate(R, x, y, z):  # type: ignore[no-untyped-def]
    """R v."""
    return (
        R[0, 0] * x + R[0, 1] * y + R[0, 2] * z,
        R[1, 0] * x + R[1, 1] * y + R[1, 2] * z,
        R[2, 0] * x + R[2, 1] * y + R[2, 2] * z,
    )
