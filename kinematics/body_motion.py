"""Pose, momentum and weight of one body as formulas of vectors. The kernels for one sample and those for
eight at once share them, and so have the same digits: sums keep their order, unlike those of
`contactsense.kinematics.wrench_information`.

All quantities are in base axes, moments and angular momenta about the base origin, unless stated otherwise.
"""

import numpy as np

from contactsense.robots.jit.kernel import inlined_kernel
from contactsense.robots.vectors import Vector, add_cross, cross, dot, scale, vector

Rows = tuple[Vector, Vector, Vector]
"""A 3 x 3 matrix, row by row."""


@inlined_kernel
def rows_of(matrix: np.ndarray) -> Rows:
    """The rows of an array of shape (3, 3)."""
    return vector(matrix[0]), vector(matrix[1]), vector(matrix[2])


@inlined_kernel
def matvec(matrix: Rows, v: Vector) -> Vector:
    """A matrix times a vector."""
    return dot(matrix[0], v), dot(matrix[1], v), dot(matrix[2], v)


@inlined_kernel
def transposed_matvec(matrix: Rows, v: Vector) -> Vector:
    """The transpose of a matrix times a vector."""
    x, y, z = matrix
    return (
        x[0] * v[0] + y[0] * v[1] + z[0] * v[2],
        x[1] * v[0] + y[1] * v[1] + z[1] * v[2],
        x[2] * v[0] + y[2] * v[1] + z[2] * v[2],
    )


@inlined_kernel
def product(first: Rows, second: Rows) -> Rows:
    """The product of two matrices."""
    return (
        transposed_matvec(second, first[0]),
        transposed_matvec(second, first[1]),
        transposed_matvec(second, first[2]),
    )


@inlined_kernel
def rotation_about(axis: Vector, sine: float, versine: float) -> Rows:
    """Rotation matrix by Rodrigues' formula, for an angle with this sine and 1 - cosine."""
    s, v = sine, versine
    x, y, z = axis
    return (
        (1.0 - v * (y * y + z * z), v * x * y - s * z, v * x * z + s * y),
        (v * x * y + s * z, 1.0 - v * (x * x + z * z), v * y * z - s * x),
        (v * x * z - s * y, v * y * z + s * x, 1.0 - v * (x * x + y * y)),
    )


@inlined_kernel
def point_in_base(rotation: Rows, origin: Vector, point: Vector) -> Vector:
    """A point of a body in the base frame [m], from the pose of its frame."""
    a, b, c = rotation
    return (
        origin[0] + a[0] * point[0] + a[1] * point[1] + a[2] * point[2],
        origin[1] + b[0] * point[0] + b[1] * point[1] + b[2] * point[2],
        origin[2] + c[0] * point[0] + c[1] * point[1] + c[2] * point[2],
    )


@inlined_kernel
def screw_rate(velocity: Vector, angular: Vector, moment: Vector, axis: Vector) -> tuple[Vector, Vector]:
    """Rate of a screw (moment, axis) that moves with the twist (velocity, angular)."""
    return add_cross(cross(angular, moment), velocity, axis), cross(angular, axis)


@inlined_kernel
def apply_inertia(rotation: Rows, inertia: Rows, v: Vector) -> Vector:
    """R J R^T v: an inertia tensor J in body axes applied to a vector in base axes."""
    return matvec(rotation, matvec(inertia, transposed_matvec(rotation, v)))


@inlined_kernel
def momentum_of_body(
    mass: float, com: Vector, spin: Vector, velocity: Vector, angular: Vector
) -> tuple[Vector, Vector]:
    """Linear and angular momentum of a body [Ns, Nms].

    Args:
        mass: [kg].
        com: Centre of mass [m].
        spin: Angular momentum about the centre of mass [Nms].
        velocity, angular: Velocity of the body at the base origin [m/s] and angular velocity [rad/s].
    """
    linear = scale(mass, add_cross(velocity, angular, com))
    return linear, add_cross(spin, com, linear)


@inlined_kernel
def weight_of_body(mass: float, com: Vector, gravity: Vector) -> tuple[Vector, Vector]:
    """Gravity wrench of a body [N, Nm], from mass [kg], centre of mass [m] and gravity [m/s^2]."""
    force = scale(mass, gravity)
    return force, cross(com, force)
