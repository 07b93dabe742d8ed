"""Vectors of 3 numbers as tuples, which kernels keep in registers, and products of spatial vectors (screws,
wrenches, momenta, each 6 numbers)."""

import numpy as np

from contactsense.robots.jit.kernel import kernel

Vector = tuple[float, float, float]


@kernel
def dot(a: Vector, b: Vector) -> float:
    """Scalar product."""
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


@kernel
def cross(a: Vector, b: Vector) -> Vector:
    """Vector product a x b."""
    return a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]


@kernel
def add(a: Vector, b: Vector) -> Vector:
    """Sum a + b."""
    return a[0] + b[0], a[1] + b[1], a[2] + b[2]


@kernel
def subtract(a: Vector, b: Vector) -> Vector:
    """Difference a - b."""
    return a[0] - b[0], a[1] - b[1], a[2] - b[2]


@kernel
def vector(array: np.ndarray) -> Vector:
    """The first three numbers of an array."""
    return array[0], array[1], array[2]


@kernel
def rotate(R: np.ndarray, v: Vector) -> Vector:
    """R v, with R of shape (3, 3)."""
    return (
        R[0, 0] * v[0] + R[0, 1] * v[1] + R[0, 2] * v[2],
        R[1, 0] * v[0] + R[1, 1] * v[1] + R[1, 2] * v[2],
        R[2, 0] * v[0] + R[2, 1] * v[1] + R[2, 2] * v[2],
    )


@kernel
def rotate_back(R: np.ndarray, v: Vector) -> Vector:
    """Transpose of R times v, with R of shape (3, 3)."""
    return (
        R[0, 0] * v[0] + R[1, 0] * v[1] + R[2, 0] * v[2],
        R[0, 1] * v[0] + R[1, 1] * v[1] + R[2, 1] * v[2],
        R[0, 2] * v[0] + R[1, 2] * v[1] + R[2, 2] * v[2],
    )


@kernel
def dot6(a: np.ndarray, b: np.ndarray) -> float:
    """Scalar product of two 6-vectors, a screw with a wrench or a momentum."""
    return float(a[0] * b[0] + a[1] * b[1] + a[2] * b[2] + a[3] * b[3] + a[4] * b[4] + a[5] * b[5])


@kernel
def component_about(origin: np.ndarray, i: int) -> tuple[float, float, float, float, float, float]:
    """Row whose product with a wrench (f, m) about the base origin is component i of the same wrench about
    the point `origin`: of the force, or of the moment m - o x f."""
    x, y, z = origin[0], origin[1], origin[2]
    if i < 3:
        return 1.0 * (i == 0), 1.0 * (i == 1), 1.0 * (i == 2), 0.0, 0.0, 0.0
    if i == 3:
        return 0.0, z, -y, 1.0, 0.0, 0.0
    if i == 4:
        return -z, 0.0, x, 0.0, 1.0, 0.0
    return y, -x, 0.0, 0.0, 0.0, 1.0
