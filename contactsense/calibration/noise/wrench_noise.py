"""Noise of the force/torque sensors, estimated after calibration.

It is the larger one of two: the white noise of the readings themselves, and what a residual has beyond the
errors that a stream knows of (`contactsense.residuals.wrench_velocity_error`). The second includes errors of
the model.
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from contactsense.calibration.calibration_model import CalibrationModel
from contactsense.calibration.fit.robust_least_squares import MAD_SCALE
from contactsense.calibration.free_motion import FreeMotion
from contactsense.calibration.residuals.link_residuals import link_velocity_variance
from contactsense.calibration.residuals.recording_residuals import sample_time, velocity_covariance
from contactsense.residuals.momentum_observer import noise_variance_ratio
from contactsense.sensors.settings import LEAST_NOISE

_ORDER, _GAIN = 4, 70.0
"""Order of the differences that remove the motion from readings, and the variance of white noise in them."""


class WrenchResiduals(NamedTuple):
    """Residuals of a force/torque sensor in one recording, and what a stream knows of them."""

    residual: np.ndarray
    """About the sensor, shape (N, 6) [N, Nm]."""
    known_variance: np.ndarray
    """Due to velocities and instants of the samples, shape (N, 6) [N^2, Nm^2]."""
    readings: np.ndarray
    """Of the sensor, shape (M, 6) [N, Nm]."""
    variance_ratio: float
    """Variance of the residual over that of white noise in one sample."""


def wrench_residuals(
    arm: CalibrationModel,
    recording: FreeMotion,
    rows: np.ndarray,
    residual: np.ndarray,
    field: str,
    bandwidth: float,
) -> WrenchResiduals:
    """The residuals of a sensor.

    Args:
        arm: Parameters of arm and sensors.
        recording: Contact-free motion with readings of this sensor.
        rows: The samples that count.
        residual: Of these, of a link sensor in its own frame, of the base sensor about its place, base axes,
            shape (N, 6) [N, Nm].
        field: The sensor's key in `Scene.link_sensors`, or `base_wrench`.
        bandwidth: Cut-off frequency of the observer [Hz].
    """
    readings = recording.readings[field]
    ratio = noise_variance_ratio(bandwidth, sample_time(recording))
    if field != "base_wrench":
        known = link_velocity_variance(arm, recording, field, bandwidth)
        return WrenchResiduals(residual, known[rows], readings, ratio)
    move = arm.to_base_sensor
    covariance = velocity_covariance(arm, recording, bandwidth)[rows]
    return WrenchResiduals(residual, np.einsum("ij,njk,ik->ni", move, covariance, move), readings, ratio)


def wrench_noise(parts: Sequence[WrenchResiduals]) -> tuple[float, float]:
    """Standard deviation of one sample, of force [N] and moment [Nm]: of the axis with the most noise.

    Args:
        parts: The residuals of each recording.
    """
    squares = [(part.residual**2 - part.known_variance) / part.variance_ratio for part in parts]
    beyond = np.vstack(squares).mean(axis=0)
    differences = np.vstack([np.diff(part.readings, _ORDER, axis=0) for part in parts])
    white = (MAD_SCALE * np.median(np.abs(differences), axis=0)) ** 2 / _GAIN
    noise = np.maximum(np.sqrt(np.maximum(beyond, white)), LEAST_NOISE)
    return float(np.max(noise[:3])), float(np.max(noise[3:]))
