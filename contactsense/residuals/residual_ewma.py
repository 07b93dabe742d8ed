"""Exponentially weighted moving average (EWMA) of the residuals: for contacts that are weak but last.

A test of each sample finds a strong contact at once; a test of the average finds one whose torques are below
the noise of a sample. In statistical process control the two together are a combined Shewhart-EWMA chart (J.
M. Lucas and M. S. Saccucci, "Exponentially weighted moving average control schemes: properties and
enhancements", 1990).

Until there are as many samples as it averages over, it is the mean of all since its start, so that it soon
forgets the first ones.
"""

import math
from typing import Annotated, NamedTuple

from contactsense.residuals.observers import Observers, concatenate_residuals
from contactsense.robots.jit.array_views import copy
from contactsense.robots.jit.declaration import Floats, Records, record
from contactsense.robots.jit.kernel import inlined_kernel, kernel

RELATIVE_BANDWIDTH = 0.2
"""Cut-off frequency of the average relative to that of the observers."""


NOISE_SHARE = RELATIVE_BANDWIDTH / (1.0 + RELATIVE_BANDWIDTH)
"""Variance of white noise in the average over that in the observers' residuals."""


@record
class EwmaStatus:
    """Content of the average."""

    samples: float
    """Number of samples that it averages over, 0 before the first."""
    sensors: int
    """Code of the sensors whose residuals are in it."""
    variance_ratio: float
    """Variance of the average over that of one sample's white noise."""
    residual_covariance: float
    """Covariance of the average with the newest residual, in the same unit."""
    age: float
    """Mean age of its content, the observers' lag included [s]."""


class ResidualEwma(NamedTuple):
    """State of the average for one stream."""

    mean: Annotated[Floats, "6 * (joints + 1) + 2 * joints + 12 * link_sensors"]
    """Averages, see `contactsense.residuals.observers.concatenate_residuals`."""
    residual: Annotated[Floats, "6 * (joints + 1) + 2 * joints + 12 * link_sensors"]
    """Scratch: the newest residuals."""
    status: Annotated[Records[EwmaStatus], "1"]


@kernel
def restart_ewma(ewma: ResidualEwma) -> None:
    """Start again with the next sample."""
    ewma.status[0].samples = 0.0


@kernel
def update_ewma(
    ewma: ResidualEwma, observers: Observers, variance_ratio: float, sensors: int, dt: float, bandwidth: float
) -> None:
    """Add the observers' residuals. A sample with other sensors than before starts again.

    Args:
        ewma: Changed in place.
        observers: Of the stream.
        variance_ratio: Variance of their residuals over that of one sample's white noise.
        sensors: Code of the usable sensors, see `contactsense.sensors.usable_sensors.usable_residuals_code`.
        dt: Time since the last sample [s].
        bandwidth: Cut-off frequency of the observers [Hz].
    """
    status, residual, mean = ewma.status[0], ewma.residual, ewma.mean
    concatenate_residuals(residual, observers)
    K = 2.0 * math.pi * bandwidth
    if status.samples == 0.0 or status.sensors != sensors:
        copy(residual, mean)
        status.samples, status.sensors, status.age = 1.0, sensors, 1.0 / K
        status.variance_ratio = status.residual_covariance = variance_ratio
        return
    longest = 1.0 / -math.expm1(-RELATIVE_BANDWIDTH * K * dt)
    status.samples = min(status.samples + 1.0, max(longest, 1.0))
    weight = 1.0 / status.samples
    for k in range(residual.shape[0]):
        mean[k] += weight * (residual[k] - mean[k])
    status.variance_ratio, status.residual_covariance = average_noise(
        status.variance_ratio, status.residual_covariance, variance_ratio, weight, math.exp(-K * dt)
    )
    status.age = (1.0 - weight) * (status.age + dt) + weight / K


@kernel
def average_noise(
    variance: float, covariance: float, newest: float, weight: float, correlation: float
) -> tuple[float, float]:
    """Noise of a running average after a sample, whose noise is correlated with that of the one before.

    Args:
        variance, covariance: Variance of the average before, and its covariance with the residual before.
        newest: Variance of the newest residual.
        weight: Of the newest residual in the average.
        correlation: Between the newest residual and the one before.

    Returns:
        Variance of the average, and its covariance with the newest residual.
    """
    covariance *= correlation
    keep = 1.0 - weight
    return (
        keep * keep * variance + 2.0 * weight * keep * covariance + weight * weight * newest,
        keep * covariance + weight * newest,
    )


@inlined_kernel
def share_in_average(average_share: float, noise_share: float) -> float:
    """Variance of a model error in an average of residuals over that in a residual.

    Its share in the EWMA has been measured. Shorter averages are between that and a residual; longer ones
    count as the EWMA.

    Args:
        average_share: Its share in the EWMA.
        noise_share: Variance of white noise in this average over that in a residual.
    """
    remaining = min(max((noise_share - NOISE_SHARE) / (1.0 - NOISE_SHARE), 0.0), 1.0)
    return average_share + (1.0 - average_share) * remaining
