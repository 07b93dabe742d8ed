"""Forward kinematics: link poses and joint screws.

All quantities are in base axes, moments and angular momenta about the base origin. A wrench is (force,
moment). The kernels fill arrays of the caller and allocate nothing. They do not check shapes; callers do.
"""

import numpy as np

from contactsense.kinematics.body_motion import (
    Rows,
    matvec,
    point_in_base,
    product,
    rotation_about,
    rows_of,
)
from contactsense.kinematics.model import Model, Motion
from contactsense.kinematics.trigonometry import sine_and_versine
from contactsense.robots.jit.kernel import inlined_kernel, kernel
from contactsense.robots.vectors import Vector, cross, vector


@kernel
def forward_kinematics(model: Model, q: np.ndarray, motion: Motion) -> None:
    """Forward kinematics: fill `rotation`, `origin` and `screw` of `motion` for joint positions q [rad]."""
    # From joint to joint the pose stays in registers: stores to an array would have to be waited for.
    a, b, c = (1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0)
    o = (0.0, 0.0, 0.0)
    _store_pose(motion, 0, (a, b, c), o)
    for j in range(q.shape[0]):
        o = point_in_base((a, b, c), o, vector(model.translation[j]))
        a, b, c = product((a, b, c), rows_of(model.rotation[j]))
        axis = vector(model.axis[j])
        z = matvec((a, b, c), axis)
        m, s = cross(o, z), motion.screw[j]
        s[0], s[1], s[2], s[3], s[4], s[5] = m[0], m[1], m[2], z[0], z[1], z[2]
        sine, versine = sine_and_versine(q[j])
        if axis == (0.0, 0.0, 1.0):
            # The same digits with a third of the products.
            cosine = 1.0 - versine
            a, b, c = (
                (a[0] * cosine + a[1] * sine, a[1] * cosine - a[0] * sine, a[2]),
                (b[0] * cosine + b[1] * sine, b[1] * cosine - b[0] * sine, b[2]),
                (c[0] * cosine + c[1] * sine, c[1] * cosine - c[0] * sine, c[2]),
            )
        else:
            a, b, c = product((a, b, c), rotation_about(axis, sine, versine))
        _store_pose(motion, j + 1, (a, b, c), o)


@inlined_kernel
def _store_pose(motion: Motion, body: int, rows: Rows, o: Vector) -> None:
    R, origin = motion.rotation[body], motion.origin[body]
    for i in range(3):
        R[0, i], R[1, i], R[2, i], origin[i] = rows[0][i], rows[1][i], rows[2][i], o[i]
