"""Forward kinematics: link poses and joint screws (theory, section 1).

All quantities are in base axes, moments and angular momenta about the base origin. A wrench is (force,
moment). The kernels fill arrays of the caller and allocate nothing. They do not check shapes; callers do.
"""

import numpy as np

from contactsense.kinematics.model import Model, Motion
from contactsense.kinematics.trigonometry import sine_and_versine
from contactsense.robots.jit.kernel import kernel


@kernel
def _rotate_about(axis: np.ndarray, angle: float, before: np.ndarray, after: np.ndarray) -> None:
    """Set `after = before @ Rot(axis, angle)` by Rodrigues' formula."""
    s, v = sine_and_versine(angle)
    x, y, z = axis[0], axis[1], axis[2]
    r00 = 1.0 - v * (y * y + z * z)
    r01 = v * x * y - s * z
    r02 = v * x * z + s * y
    r10 = v * x * y + s * z
    r11 = 1.0 - v * (x * x + z * z)
    r12 = v * y * z - s * x
    r20 = v * x * z - s * y
    r21 = v * y * z + s * x
    r22 = 1.0 - v * (x * x + y * y)
    for i in range(3):
        b0, b1, b2 = before[i, 0], before[i, 1], before[i, 2]
        after[i, 0] = b0 * r00 + b1 * r10 + b2 * r20
        after[i, 1] = b0 * r01 + b1 * r11 + b2 * r21
        after[i, 2] = b0 * r02 + b1 * r12 + b2 * r22


@kernel
def forward_kinematics(model: Model, q: np.ndarray, motion: Motion) -> None:
    """Forward kinematics: fill `rotation`, `origin` and `screw` of `motion` for joint positions q [rad]."""
    rotation, origin, screw = motion.rotation, motion.origin, motion.screw
    for i in range(3):
        for k in range(3):
            rotation[0, i, k] = 1.0 if i == k else 0.0
        origin[0, i] = 0.0
    for j in range(q.shape[0]):
        parent = rotation[j]
        child = rotation[j + 1]
        for i in range(3):
            origin[j + 1, i] = (
                origin[j, i]
                + parent[i, 0] * model.translation[j, 0]
                + parent[i, 1] * model.translation[j, 1]
                + parent[i, 2] * model.translation[j, 2]
            )
            for k in range(3):
                child[i, k] = (
                    parent[i, 0] * model.rotation[j, 0, k]
                    + parent[i, 1] * model.rotation[j, 1, k]
                    + parent[i, 2] * model.rotation[j, 2, k]
                )
        axis = model.axis[j]
        zx = child[0, 0] * axis[0] + child[0, 1] * axis[1] + child[0, 2] * axis[2]
        zy = child[1, 0] * axis[0] + child[1, 1] * axis[1] + child[1, 2] * axis[2]
        zz = child[2, 0] * axis[0] + child[2, 1] * axis[1] + child[2, 2] * axis[2]
        ox, oy, oz = origin[j + 1, 0], origin[j + 1, 1], origin[j + 1, 2]
        screw[j, 0] = oy * zz - oz * zy
        screw[j, 1] = oz * zx - ox * zz
        screw[j, 2] = ox * zy - oy * zx
        screw[j, 3] = zx
        screw[j, 4] = zy
        screw[j, 5] = zz
        _rotate_about(axis, q[j], child, child)
