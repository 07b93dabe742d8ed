"""Sum of two evidences that are given as logarithms."""

import math

from contactsense.robots.jit.kernel import fused_kernel


@fused_kernel
def log_add(a: float, b: float) -> float:
    """log(exp(a) + exp(b)); either or both may be -infinity."""
    high, low = max(a, b), min(a, b)
    return high if low == -math.inf else high + math.log1p(math.exp(low - high))
