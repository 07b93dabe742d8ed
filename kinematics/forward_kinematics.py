"""Forward kinematics: link poses and joint screws.

All quantities are in base axes, moments and angular momenta about the base origin. A wrench is (force,
moment). The kernels fill arrays of the caller and allocate nothing. They do not check shapes; callers do.
"""

import numpy as np

from contactsense.kinematics.model import Model, Motion
from contactsense.kinematics.trigonometry import sine_and_versine
from contactsense.robots.jit.kernel import inlined_kernel, kernel
from contactsense.robots.vectors import Vector, cross, dot, vector

Rows = tuple[Vector, Vector, Vector]
"""A 3 x 3 matrix, row by row."""


@inlined_kernel
def _row_times(row: Vector, matrix: Rows) -> Vector:
    """A row vector times a matrix."""
    x, y, z = matrix
    return (
        row[0] * x[0] + row[1] * y[0] + row[2] * z[0],
        row[0] * x[1] + row[1] * y[1] + row[2] * z[1],
        row[0] * x[2] + row[1] * y[2] + row[2] * z[2],
    )


@inlined_kernel
def _rotation_about(axis: Vector, angle: float) -> Rows:
    """Rotation matrix by Rodrigues' formula."""
    s, v = sine_and_versine(angle)
    x, y, z = axis
    return (
        (1.0 - v * (y * y + z * z), v * x * y - s * z, v * x * z + s * y),
        (v * x * y + s * z, 1.0 - v * (x * x + z * z), v * y * z - s * x),
        (v * x * z - s * y, v * y * z + s * x, 1.0 - v * (x * x + y * y)),
    )


@kernel
def forward_kinematics(model: Model, q: np.ndarray, motion: Motion) -> None:
    """Forward kinematics: fill `rotation`, `origin` and `screw` of `motion` for joint positions q [rad]."""
    # From joint to joint the pose stays in registers: stores to an array would have to be waited for.
    a, b, c = (1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0)
    o = (0.0, 0.0, 0.0)
    _store_pose(motion, 0, (a, b, c), o)
    for j in range(q.shape[0]):
        t = vector(model.translation[j])
        o = (
            o[0] + a[0] * t[0] + a[1] * t[1] + a[2] * t[2],
            o[1] + b[0] * t[0] + b[1] * t[1] + b[2] * t[2],
            o[2] + c[0] * t[0] + c[1] * t[1] + c[2] * t[2],
        )
        fixed = vector(model.rotation[j, 0]), vector(model.rotation[j, 1]), vector(model.rotation[j, 2])
        a, b, c = _row_times(a, fixed), _row_times(b, fixed), _row_times(c, fixed)
        axis = vector(model.axis[j])
        z = dot(a, axis), dot(b, axis), dot(c, axis)
        m, s = cross(o, z), motion.screw[j]
        s[0], s[1], s[2], s[3], s[4], s[5] = m[0], m[1], m[2], z[0], z[1], z[2]
        if axis == (0.0, 0.0, 1.0):
            # The same digits with a third of the products.
            sine, versine = sine_and_versine(q[j])
            cosine = 1.0 - versine
            a, b, c = (
                (a[0] * cosine + a[1] * sine, a[1] * cosine - a[0] * sine, a[2]),
                (b[0] * cosine + b[1] * sine, b[1] * cosine - b[0] * sine, b[2]),
                (c[0] * cosine + c[1] * sine, c[1] * cosine - c[0] * sine, c[2]),
            )
        else:
            turn = _rotation_about(axis, q[j])
            a, b, c = _row_times(a, turn), _row_times(b, turn), _row_times(c, turn)
        _store_pose(motion, j + 1, (a, b, c), o)


@inlined_kernel
def _store_pose(motion: Motion, body: int, rows: Rows, o: Vector) -> None:
    R, origin = motion.rotation[body], motion.origin[body]
    for i in range(3):
        R[0, i], R[1, i], R[2, i], origin[i] = rows[0][i], rows[1][i], rows[2][i], o[i]
