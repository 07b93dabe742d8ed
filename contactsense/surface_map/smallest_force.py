"""Smallest force that is detected, from the noncentral chi-square distribution of the residuals' energy."""

import math

import numpy as np
from scipy.optimize import brentq
from scipy.stats import ncx2

from contactsense.detection.thresholds import SampleThresholds
from contactsense.scene import Scene
from contactsense.surface_map.sensor_response import wrench


def detected_size(scene: Scene, detection: float) -> float:
    """Length of the mean residuals, in units of their noise, that is detected with that probability.

    A measurement is a contact if the energy of "nothing touches", half the squared residuals, exceeds the
    threshold of the scene's false-alarm rate. Twice that energy is distributed as noncentral chi-square, with
    one degree of freedom per residual and the squared length of the mean residuals as its noncentrality
    (S. M. Kay, "Fundamentals of statistical signal processing: detection theory", 1998, section 2.2.3).

    Args:
        scene: With sensors and false alarms per hour.
        detection: Probability of detection in one measurement.
    """
    joints = len(scene.robot.joints)
    sizes = (6, joints, 6)
    usable = (
        scene.base_wrench is not None,
        scene.joint_torque is not None,
        scene.wrist_wrench is not None,
    )
    degrees = sum(size for size, used in zip(sizes, usable, strict=True) if used)
    level = 2.0 * SampleThresholds(scene, sizes).threshold(usable)
    missing = float(ncx2.sf(level, degrees, 1e-9)) - detection
    if missing >= 0.0:
        return 0.0
    # Far above its mean the length is normal with unit standard deviation.
    highest = (math.sqrt(level) + 10.0) ** 2
    return math.sqrt(brentq(lambda x: float(ncx2.sf(level, degrees, x)) - detection, 1e-9, highest))


def smallest_force(response: np.ndarray, size: float, point: np.ndarray, normal: np.ndarray) -> np.ndarray:
    """Smallest force along the inward normal that is detected.

    Args:
        response: `sensor_response` of the touched link at each place, shape (N, rows, 6).
        size: `detected_size`.
        point, normal: Places and outward normals, base frame, shape (N, 3) [m].

    Returns:
        Shape (N,) [N]; infinite where no sensor measures the push.
    """
    per_newton = np.linalg.norm(np.einsum("nij,nj->ni", response, wrench(-normal, point)), axis=1)
    with np.errstate(divide="ignore"):
        return np.asarray(size / per_newton)
