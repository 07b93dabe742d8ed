"""Vectors of 3 numbers as tuples, which kernels keep in registers."""

from math import sqrt

import numpy as np

from contactsense.robots.jit.kernel import inlined_kernel, kernel

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
def scale(factor: float, a: Vector) -> Vector:
    """Multiple of a vector."""
    return factor * a[0], factor * a[1], factor * a[2]


@kernel
def add_scaled(a: Vector, factor: float, b: Vector) -> Vector:
    """a plus a multiple of b."""
    return a[0] + factor * b[0], a[1] + factor * b[1], a[2] + factor * b[2]


@kernel
def add_cross(a: Vector, b: Vector, c: Vector) -> Vector:
    """a + b x c."""
    return (
        a[0] + b[1] * c[2] - b[2] * c[1],
        a[1] + b[2] * c[0] - b[0] * c[2],
        a[2] + b[0] * c[1] - b[1] * c[0],
    )


@kernel
def subtract_cross(a: Vector, b: Vector, c: Vector) -> Vector:
    """a - b x c."""
    return (
        a[0] - b[1] * c[2] + b[2] * c[1],
        a[1] - b[2] * c[0] + b[0] * c[2],
        a[2] - b[0] * c[1] + b[1] * c[0],
    )


@kernel
def divide(a: Vector, divisor: float) -> Vector:
    """Quotient of a vector and a number."""
    return a[0] / divisor, a[1] / divisor, a[2] / divisor


@kernel
def norm(a: Vector) -> float:
    """Length of a vector."""
    return sqrt(a[0] * a[0] + a[1] * a[1] + a[2] * a[2])


@inlined_kernel
def tangents(n: Vector) -> tuple[Vector, Vector]:
    """Two unit vectors perpendicular to the unit vector n and to each other, t1 x t2 = n.

    T. Duff et al., "Building an orthonormal basis, revisited", Journal of Computer Graphics Techniques 6
    (2017).
    """
    sign = 1.0 if n[2] >= 0.0 else -1.0
    a = -1.0 / (sign + n[2])
    b = n[0] * n[1] * a
    return (1.0 + sign * n[0] * n[0] * a, sign * b, -sign * n[0]), (b, sign + n[1] * n[1] * a, -n[1])


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
