"""Products of spatial vectors: screws, wrenches and momenta, each 6 numbers."""

import numpy as np

from contactsense.robots.jit.typed_kernel import kernel

Six = tuple[float, float, float, float, float, float]


@kernel
def dot6(a: np.ndarray | Six, b: np.ndarray | Six) -> float:
    """Scalar product of two 6-vectors, a screw with a wrench or a momentum."""
    return float(a[0] * b[0] + a[1] * b[1] + a[2] * b[2] + a[3] * b[3] + a[4] * b[4] + a[5] * b[5])
