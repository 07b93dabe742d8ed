"""Sine and 1 - cosine of an angle by arithmetic alone, so that loops over several angles are vectorized, and
give the same digits as one angle at a time."""

import math

from contactsense.robots.jit.kernel import inlined_kernel

# pi / 2 in three parts of 33 bits: products with whole numbers up to 2^20 are exact.
_HALF_PI = (1.5707963267341256, 6.077100506303966e-11, 2.0222662487959506e-21)
_HIGH, _MIDDLE, _LOW = _HALF_PI
_INVERSE_PI = 1.0 / math.pi
# Taylor coefficients of sine from x^3 to x^17 and of cosine from x^4 to x^18: below pi / 4 the rest is less
# than a unit in the last place.
_S3, _S5, _S7, _S9, _S11, _S13, _S15, _S17 = ((-1.0) ** k / math.factorial(2 * k + 1) for k in range(1, 9))
_C4, _C6, _C8, _C10, _C12, _C14, _C16, _C18 = ((-1.0) ** k / math.factorial(2 * k) for k in range(2, 10))


@inlined_kernel
def sine_and_versine(angle: float) -> tuple[float, float]:
    """Sine and 1 - cosine, the latter exact for small angles, too.

    Errors are below 1e-15 for angles up to 1e6 rad.
    """
    # Half the angle, reduced to [-pi/4, pi/4] by whole multiples of pi / 2.
    count = math.floor(angle * _INVERSE_PI + 0.5)
    x = ((0.5 * angle - count * _HIGH) - count * _MIDDLE) - count * _LOW
    z = x * x
    s = x + x * z * (
        _S3 + z * (_S5 + z * (_S7 + z * (_S9 + z * (_S11 + z * (_S13 + z * (_S15 + z * _S17))))))
    )
    c = 1.0 - (
        0.5 * z
        - z * z * (_C4 + z * (_C6 + z * (_C8 + z * (_C10 + z * (_C12 + z * (_C14 + z * (_C16 + z * _C18)))))))
    )
    odd = count - 2.0 * math.floor(0.5 * count)
    # An odd multiple of pi / 2 exchanges sine and cosine; signs cancel in both results.
    side = c if odd > 0.5 else s
    return (1.0 - 2.0 * odd) * (2.0 * s * c), 2.0 * side * side
