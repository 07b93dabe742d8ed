"""Velocities without most of their noise, for the derivatives by masses and delays."""

from dataclasses import replace

import numpy as np
from scipy.ndimage import gaussian_filter1d

from contactsense.calibration.free_motion import FreeMotion
from contactsense.calibration.residuals.recording_residuals import GAP

_WIDTH = 0.04
"""Standard deviation of the Gaussian window [s]: motion below 2 Hz passes, most of the noise does not."""
_REACH = 3.0
"""Standard deviations beyond which the window hardly counts."""


def with_smooth_velocities(recording: FreeMotion) -> FreeMotion:
    """A recording whose velocities are smoothed, without delay, between its gaps.

    What a mass contributes to a residual has the noise of the velocities, amplified as accelerations are, and
    the residual has the same noise. With both, a fit makes masses smaller. Smooth velocities are an
    instrumental variable: equations with the derivatives of the smooth motion hold at the true parameters.
    """
    width = _WIDTH / float(np.median(np.diff(recording.t)))
    parts = np.split(recording.qd, _after_gaps(recording))
    qd = np.vstack([gaussian_filter1d(part, width, axis=0, mode="nearest") for part in parts])
    return replace(recording, qd=qd)


def is_smooth(recording: FreeMotion) -> np.ndarray:
    """Whether the accelerations that follow from `with_smooth_velocities` are those of the motion: not near
    the ends of its parts, where half of the window is missing. Shape (N,)."""
    parts = np.split(recording.t, _after_gaps(recording))
    return np.concatenate(
        [(part > part[0] + _REACH * _WIDTH) & (part < part[-1] - _REACH * _WIDTH) for part in parts]
    )


def _after_gaps(recording: FreeMotion) -> np.ndarray:
    """Indices of the samples after gaps."""
    return np.asarray(np.flatnonzero(np.diff(recording.t) > GAP) + 1)
