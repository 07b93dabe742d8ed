"""Velocities without most of their noise, for the derivatives by masses."""

from dataclasses import replace

import numpy as np
from scipy.ndimage import gaussian_filter1d

from contactsense.calibration.free_motion import FreeMotion
from contactsense.calibration.residuals.recording_residuals import GAP

_WIDTH = 0.04
"""Standard deviation of the Gaussian window [s]: motion below 2 Hz passes, most of the noise does not."""


def with_smooth_velocities(recording: FreeMotion) -> FreeMotion:
    """A recording whose velocities are smoothed, without delay, between its gaps.

    What a mass contributes to a residual has the noise of the velocities, amplified as accelerations are, and
    the residual has the same noise. With both, a fit makes masses smaller. Smooth velocities are an
    instrumental variable: equations with the derivatives of the smooth motion hold at the true parameters.
    """
    width = _WIDTH / float(np.median(np.diff(recording.t)))
    parts = np.split(recording.qd, np.flatnonzero(np.diff(recording.t) > GAP) + 1)
    qd = np.vstack([gaussian_filter1d(part, width, axis=0, mode="nearest") for part in parts])
    return replace(recording, qd=qd)
