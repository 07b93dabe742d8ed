"""The exponential function without a call, which would prevent the vectorization of a loop."""

from contactsense.robots.jit.kernel import inlined_fused_kernel


@inlined_fused_kernel
def exponential(x: float) -> float:
    """exp(x) for x from -40 to 2: to 1e-8 of it from -12 on, below to 1e-4."""
    x *= 1.0 / 64.0
    y = 1.0 + x * (
        1.0
        + x / 2.0 * (1.0 + x / 3.0 * (1.0 + x / 4.0 * (1.0 + x / 5.0 * (1.0 + x / 6.0 * (1.0 + x / 7.0)))))
    )
    y *= y
    y *= y
    y *= y
    y *= y
    y *= y
    return y * y
