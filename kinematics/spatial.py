"""Products of spatial vectors: screws, wrenches and momenta, each 6 numbers."""

import numpy as np

from contactsense.robots.jit.kernel import kernel

Six = tuple[float, float, float, float, float, float]


@kernel
def dot6(a: np.ndarray | Six, b: np.ndarray | Six) -> float:
    """Scalar product of two 6-vectors, a screw with a wrench or a momentum."""
    return float(a[0] * b[0] + a[1] * b[1] + a[2] * b[2] + a[3] * b[3] + a[4] * b[4] + a[5] * b[5])


@kernel
def product6(C: np.ndarray, a: np.ndarray | Six) -> Six:
    """C a, with C of shape (6, 6): the covariance of a wrench w of covariance C with a . w."""
    return dot6(C[0], a), dot6(C[1], a), dot6(C[2], a), dot6(C[3], a), dot6(C[4], a), dot6(C[5], a)


@kernel
def add_outer(C: np.ndarray, a: np.ndarray | Six, factor: float) -> None:
    """Add `factor` a a^T to C, shape (6, 6)."""
    for i in range(6):
        for k in range(6):
            C[i, k] += factor * a[i] * a[k]


@kernel
def quadratic_form(C: np.ndarray, a: np.ndarray | Six) -> float:
    """a . C a, with C of shape (6, 6): the variance of a . w for a wrench w of covariance C."""
    return float(dot6(a, product6(C, a)))


@kernel
def component_about(origin: np.ndarray | tuple[float, float, float], i: int) -> Six:
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
