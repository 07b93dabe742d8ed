"""Products of spatial vectors: screws, wrenches, momenta, each 6 numbers."""

import numpy as np

from contactsense.robots.jit.kernel import kernel


@kernel
def dot6(a: np.ndarray, b: np.ndarray) -> float:
    """Scalar product of two 6-vectors, a screw with a wrench or a momentum."""
    return float(a[0] * b[0] + a[1] * b[1] + a[2] * b[2] + a[3] * b[3] + a[4] * b[4] + a[5] * b[5])
