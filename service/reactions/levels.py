"""Probability that a contact's force exceeds a level."""

import math
from collections.abc import Sequence

_SQRT2 = math.sqrt(2.0)


def exceedance(force: Sequence[float], covariance: Sequence[Sequence[float]], level: float) -> float:
    """Probability that the force's magnitude is above `level`.

    The standard deviation of the magnitude is taken along the force, which is its first-order propagation. It
    is valid if the force is large compared with its standard deviation. An infinite standard deviation or a
    force that is not finite gives 0.5: nothing is known.

    Args:
        force: Estimated force [N], 3 numbers.
        covariance: Its covariance [N^2], 3 x 3.
        level: The level [N].
    """
    x, y, z = force
    magnitude = math.sqrt(x * x + y * y + z * z)
    if not math.isfinite(magnitude):
        return 0.5
    if magnitude > 0.0:
        u = (x / magnitude, y / magnitude, z / magnitude)
        variance = sum(u[i] * u[j] * covariance[i][j] for i in range(3) for j in range(3))
    else:
        variance = (covariance[0][0] + covariance[1][1] + covariance[2][2]) / 3.0
    if not math.isfinite(variance):
        return 0.5
    if variance <= 0.0:
        return 1.0 if magnitude > level else 0.0
    return 0.5 * math.erfc((level - magnitude) / (_SQRT2 * math.sqrt(variance)))
