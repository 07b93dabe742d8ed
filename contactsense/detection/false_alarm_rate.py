"""Detection threshold from the false-alarm rate: the energy of the no-contact hypothesis that noise alone
exceeds at that rate.

Twice that energy is the squared length R of a vector of d residuals in units of their noise. Each of them is
white noise through the observer, an Ornstein-Uhlenbeck process of correlation time 1 / K, K = 2 pi bandwidth.
So R is a diffusion with the stationary density p(R) of a chi distribution, and it crosses a high level from
below at the rate

    K p(R) (R - (d - 1) / R)

(the flux of its Fokker-Planck equation towards an absorbing level). A sampled process can exceed the level
between two samples unnoticed: the effective level is higher by 0.5826 times the standard deviation of one
step, sqrt(2 - 2 exp(-K dt)) (Siegmund's correction). As sensors have outliers, a contact begins with the
second of two consecutive samples above the level; the lesser of two neighbours is lower by another 1 /
sqrt(pi) times that step. `onset_threshold` inverts this rate. A test with simulated noise verifies it.
"""

import math

from scipy.special import chdtri, gammaln

HOUR = 3600.0
RELEASE_PROBABILITY = 0.01
"""A contact ends when noise alone exceeds the remaining energy with this probability."""
_LARGEST = 500.0
"""Upper bound of the threshold: a rate of 1e-200 per hour."""
_TOLERANCE = 1e-11
"""Accuracy of the threshold, as an energy."""
_DISCRETE_SAMPLING = 0.5826 + 0.5642
"""Siegmund's constant, -zeta(1/2) / sqrt(2 pi), and 1 / sqrt(pi): difference between the maximum of a
continuous path and that of the lesser neighbours of its samples, in standard deviations of a step. The second
was found by simulation."""


def false_alarms_per_hour(energy: float, degrees_of_freedom: int, bandwidth: float, dt: float) -> float:
    """Rate at which noise alone raises the energy of the no-contact hypothesis above a level [1/h].

    Args:
        energy: The level: half the squared residuals in units of the noise.
        degrees_of_freedom: Number of residuals.
        bandwidth: Cut-off frequency of the observer [Hz].
        dt: Sample time [s].
    """
    K = 2.0 * math.pi * bandwidth
    radius = math.sqrt(2.0 * energy) + _DISCRETE_SAMPLING * math.sqrt(-2.0 * math.expm1(-K * dt))
    log_density = (
        (degrees_of_freedom - 1) * math.log(radius)
        - 0.5 * radius * radius
        - (0.5 * degrees_of_freedom - 1.0) * math.log(2.0)
        - float(gammaln(0.5 * degrees_of_freedom))
    )
    return HOUR * K * math.exp(log_density) * max(radius - (degrees_of_freedom - 1) / radius, 0.0)


def onset_threshold(per_hour: float, degrees_of_freedom: int, bandwidth: float, dt: float) -> float:
    """Energy of the no-contact hypothesis with that false-alarm rate; arguments as for
    `false_alarms_per_hour`."""
    # Above its maximum, near the mean energy d / 2, the rate decreases with the level.
    lower = 0.5 * degrees_of_freedom + math.sqrt(degrees_of_freedom)
    if false_alarms_per_hour(lower, degrees_of_freedom, bandwidth, dt) <= per_hour:
        return lower
    # Bisection: SciPy's root finders take as long to import as all the rest of this package.
    upper = _LARGEST
    while upper - lower > _TOLERANCE:
        middle = 0.5 * (lower + upper)
        if false_alarms_per_hour(middle, degrees_of_freedom, bandwidth, dt) > per_hour:
            lower = middle
        else:
            upper = middle
    return upper


def sample_threshold(per_hour: float, degrees_of_freedom: int, bandwidth: float) -> float:
    """The same for single measurements. A stream makes K independent decisions per second; each measurement
    counts as one of them."""
    probability = per_hour / (HOUR * 2.0 * math.pi * bandwidth)
    return float(chdtri(max(degrees_of_freedom, 1), min(probability, 0.5))) / 2.0


def release_threshold(degrees_of_freedom: int) -> float:
    """Energy of the no-contact hypothesis below which a contact ends."""
    return float(chdtri(max(degrees_of_freedom, 1), RELEASE_PROBABILITY)) / 2.0
