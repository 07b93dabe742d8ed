"""The logarithm without a call, which would prevent the vectorization of a loop."""

import math

import numpy as np

from contactsense.robots.jit.kernel import inlined_fused_kernel

_LOG_2 = math.log(2.0)
_MANTISSA_BITS = 52
_ROOT_OF_HALF = int(np.float64(math.sqrt(0.5)).view(np.int64))
"""Its bits, as a whole number."""


@inlined_fused_kernel
def logarithm(x: float) -> float:
    """log(x) for a positive normal number x, to 1e-13 of it. Other values give some
    finite number."""
    bits = np.float64(x).view(np.int64)
    # x = 2^exponent m with m from sqrt(1/2) to sqrt(2).
    exponent = (bits - _ROOT_OF_HALF) >> _MANTISSA_BITS
    m = np.int64(bits - (exponent << _MANTISSA_BITS)).view(np.float64)
    # log(m) = 2 artanh(s)
    s = (m - 1.0) / (m + 1.0)
    z = s * s
    series = 1.0 + z * (
        1.0 / 3.0
        + z * (1.0 / 5.0 + z * (1.0 / 7.0 + z * (1.0 / 9.0 + z * (1.0 / 11.0 + z * (1.0 / 13.0 + z / 15.0)))))
    )
    return float(exponent * _LOG_2 + 2.0 * s * series)
