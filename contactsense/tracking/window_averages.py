"""Means of the residuals over windows of growing length, see `contactsense.tracking.contact_tracker`."""

import math

import numpy as np

from contactsense.residuals.observers import Observers, concatenate_residuals
from contactsense.residuals.residual_ewma import ResidualEwma, average_noise
from contactsense.robots.jit.array_views import copy
from contactsense.robots.jit.kernel import kernel
from contactsense.robots.vectors import norm, vector
from contactsense.tracking.contact_track import NONE, WINDOWS, ContactTrack

WINDOW_GROWTH = 3.0
"""Ratio of the lengths of consecutive windows; the last is unbounded."""


@kernel
def restart_windows(track: ContactTrack) -> None:
    """Restart all windows from the newest residual and forget the links, after a change of contact."""
    track.link_weight[:] = 0.0
    for i in range(1, WINDOWS):
        _restart_window(track, i)


@kernel
def _restart_window(track: ContactTrack, i: int) -> None:
    """Let window i hold the newest residual, window 0, alone."""
    copy(track.mean[0], track.mean[i])
    window, newest = track.windows[i], track.windows[0]
    window.variance_ratio, window.residual_covariance = newest.variance_ratio, newest.residual_covariance
    window.samples, window.age = 1.0, newest.age


@kernel
def average_windows(
    track: ContactTrack,
    ewma: ResidualEwma,
    observers: Observers,
    variance_ratio: float,
    sensors: int,
    dt: float,
    bandwidth: float,
) -> None:
    """Add the observers' residuals to all windows. The first sample of a contact initializes them, and so
    does a sample with other sensors than before. A sustained contact begins with the average that showed it.

    Args:
        track: Changed in place.
        ewma: Of the stream, with this sample where the contact is sustained.
        observers: Of the stream.
        variance_ratio: Variance of their residuals over that of one sample's white noise.
        sensors: Code of the usable sensors, see `contactsense.sensors.usable_sensors.usable_residuals_code`.
        dt: Time since the last sample [s].
        bandwidth: Cut-off frequency of the observers [Hz].
    """
    residual, newest = track.mean[0], track.windows[0]
    concatenate_residuals(residual, observers)
    newest.variance_ratio = newest.residual_covariance = variance_ratio
    K = 2.0 * math.pi * bandwidth
    newest.age = 1.0 / K
    status = track.status[0]
    restart = status.phase == NONE or status.sensors != sensors
    status.sensors = sensors
    decay = math.exp(-K * dt)
    length = WINDOW_GROWTH / K
    for i in range(1, WINDOWS):
        window = track.windows[i]
        if restart and status.sustained:
            average = ewma.status[0]
            copy(ewma.mean, track.mean[i])
            window.variance_ratio = average.variance_ratio
            window.residual_covariance = average.residual_covariance
            window.samples, window.age = average.samples, average.age
            continue
        if restart:
            _restart_window(track, i)
            continue
        window.samples += 1.0
        weight = 1.0 / window.samples
        if i < WINDOWS - 1:
            weight = max(weight, min(dt / length, 1.0))
            length *= WINDOW_GROWTH
        mean = track.mean[i]
        old_share = _share_of_old(mean, residual, weight)
        for k in range(residual.shape[0]):
            mean[k] += weight * (residual[k] - mean[k])
        window.variance_ratio, window.residual_covariance = average_noise(
            window.variance_ratio, window.residual_covariance, variance_ratio, weight, decay
        )
        window.age = old_share * (window.age + dt) + (1.0 - old_share) * newest.age


@kernel
def _share_of_old(mean: np.ndarray, residual: np.ndarray, weight: float) -> float:
    """Share of a window's content in its force, once the newest residual has been added with that weight."""
    old, new = (1.0 - weight) * norm(vector(mean)), weight * norm(vector(residual))
    return old / (old + new) if old + new > 0.0 else 1.0 - weight
