"""Contact or not: which energy of "nothing touches" noise exceeds once in so many hours.

Twice that energy is the square of the length R of a vector of d residuals in units of their noise. Each of
them is white noise through the observer, an Ornstein-Uhlenbeck process of correlation time 1 / K, K = 2 pi
bandwidth. So R is a diffusion with the stationary density p(R) of a chi distribution, and it crosses a high
level from below at the rate

    K p(R) (R - (d - 1) / R)

(the flux of its Fokker-Planck equation towards an absorbing level). A sampled process slips over the level
between two samples: as if the level were higher by 0.5826 times the standard deviation of one step, sqrt(2 -
2 exp(-K dt)) (Siegmund's correction). A contact begins in the second of two samples in a row that are above
it, as sensors have outliers; the lesser of two neighbours is lower still by 1 / sqrt(pi) times that step.
`level` inverts that. The number of hours is the user's; that it comes true is a test with simulated noise.
"""

import math

from scipy.optimize import brentq
from scipy.special import gammaln
from scipy.stats import chi2

HOUR = 3600.0
RELEASE = 0.01
"""A contact is over when noise alone exceeds what is left with this probability."""
_SLIP = 0.5826 + 0.5642
"""Siegmund's constant, -zeta(1/2) / sqrt(2 pi), and 1 / sqrt(pi): by how much the highest of a random walk's
lesser neighbours stays below the highest of the path between, in standard deviations of a step; the second
found by simulation."""


def alarms_per_hour(energy: float, freedom: int, bandwidth: float, dt: float) -> float:
    """How often noise alone takes the energy of "nothing touches" over a level.

    Args:
        energy: The level: half the sum of squares in units of the noise.
        freedom: Number of residuals.
        bandwidth: Cut-off frequency of the observer [Hz].
        dt: Sample time [s].
    """
    K = 2.0 * math.pi * bandwidth
    radius = math.sqrt(2.0 * energy) + _SLIP * math.sqrt(-2.0 * math.expm1(-K * dt))
    log_density = (
        (freedom - 1) * math.log(radius)
        - 0.5 * radius * radius
        - (0.5 * freedom - 1.0) * math.log(2.0)
        - float(gammaln(0.5 * freedom))
    )
    return HOUR * K * math.exp(log_density) * max(radius - (freedom - 1) / radius, 0.0)


def level(per_hour: float, freedom: int, bandwidth: float, dt: float) -> float:
    """Energy of "nothing touches" that noise alone exceeds so often; arguments as for `alarms_per_hour`."""
    # The rate falls with the level from its summit on, which is near the mean of the energy, d / 2.
    low = 0.5 * freedom + math.sqrt(freedom)
    if alarms_per_hour(low, freedom, bandwidth, dt) <= per_hour:
        return low
    return float(
        brentq(lambda e: math.log(alarms_per_hour(e, freedom, bandwidth, dt) / per_hour), low, 500.0)
    )


def single_level(per_hour: float, freedom: int, bandwidth: float) -> float:
    """The same for single measurements: each counts as one look of a stream, which takes K of them a
    second."""
    probability = per_hour / (HOUR * 2.0 * math.pi * bandwidth)
    return float(chi2.isf(min(probability, 0.5), max(freedom, 1))) / 2.0


def release_level(freedom: int) -> float:
    """Energy of "nothing touches" below which a contact is over."""
    return float(chi2.isf(RELEASE, max(freedom, 1))) / 2.0
