"""Windows of a contact without a base sensor, compared by their torques.

A push more often changes its magnitude than its direction: hands tremble, and a force that sets in takes its
time. While a contact keeps place, direction and posture, its torques keep their direction in the space of the
joints, and the mean of torques of one direction is as good a measurement of link and place as those of one
moment, whatever their magnitudes. So windows agree if their torques have the same direction. The magnitude is
that of windows which agree in it, too.
"""

from typing import NamedTuple

import numpy as np

from contactsense.residuals.observers import first_torque
from contactsense.robots.jit.kernel import kernel
from contactsense.tracking.contact_track import ContactTrack


class TorqueDifference(NamedTuple):
    """Squared difference of the mean torques of two windows, in units of the noise of the shorter one."""

    whole: float
    """A chi-square variable of n degrees of freedom if the contact has not changed."""
    direction: float
    """From the nearest multiple of the torques of the longer window that is not negative, as no push becomes
    a pull: of n - 1 degrees of freedom if the contact has changed its magnitude alone."""


@kernel
def torque_difference(
    torque_noise: tuple[np.ndarray, float], track: ContactTrack, longer: int, shorter: int
) -> TorqueDifference:
    """Compare two windows.

    Args:
        torque_noise: As for `contactsense.tracking.contact_tracker.choose_window`.
        track: Windows.
        longer, shorter: Indices of the two.
    """
    variance, scale = torque_noise
    index = first_torque(variance.shape[0])
    whole, square, product, longer_square = 0.0, 0.0, 0.0, 0.0
    for k in range(variance.shape[0]):
        weight = 1.0 / (scale * variance[k] * track.windows[shorter].variance_ratio)
        torque, newer = track.mean[longer, index + k], track.mean[shorter, index + k]
        whole += weight * (torque - newer) * (torque - newer)
        square += weight * newer * newer
        product += weight * torque * newer
        longer_square += weight * torque * torque
    if product > 0.0:
        square = max(square - product * product / longer_square, 0.0)
    return TorqueDifference(whole, square)


@kernel
def present_magnitude(variance: np.ndarray, track: ContactTrack, window: int, present: int) -> float:
    """Magnitude of the torques in the window `present` over that in `window`, at least 0."""
    squared = _product(variance, track, window, window)
    if window == present or not squared > 0.0:
        return 1.0
    return max(_product(variance, track, window, present) / squared, 0.0)


@kernel
def _product(variance: np.ndarray, track: ContactTrack, i: int, j: int) -> float:
    """Inner product of the torques of two windows, in units of the noise of one sample."""
    index = first_torque(variance.shape[0])
    result = 0.0
    for k in range(variance.shape[0]):
        result += track.mean[i, index + k] * track.mean[j, index + k] / variance[k]
    return result
